"""Whatever fails, a command ends with one message and a stated exit code; Ctrl-C says what is kept."""

import errno
import os
import re
import resource
import signal
import subprocess
import sys
from pathlib import Path

import pytest
from command_line import COMMAND, run_here, told

from kinetics.support.cli.failures import FAULT, INTERRUPTED, MISTAKE, OUTSIDE, judged

ROOT = Path(__file__).parents[1]
SCENE = (ROOT / "mechsim" / "scenes" / "line4.toml").read_text(encoding="utf-8")
PREDICT = ["predict", "line4", "--rates", "table3", "--cubes", 6, "--runs", 5, "--duration", 1]
# Follows paths, which takes kernels that have no twin in C, and few.
ALONG = ["scan", "line4", "--rates", "table3", "--over", "cubes=6", "--max-states", "0", "--runs", "5"]
ALONG += ["--ask", "P=? [ F[1,200] dimer >= 1 ]"]
SIMULATE = ["simulate", "line4", "--cubes", 6, "--duration", 0.1]


def failed(done, code):
    """The message of a command that has ended with this code, and with no traceback."""
    assert done.code == code, done.err
    assert "Traceback" not in done.err
    (line,) = [line for line in done.err.splitlines() if line.startswith("Error: ")]
    return line


# What a user gave


def net_of(terms):
    """A .net file whose rate is a sum of so many names."""
    names = [f"k{i}" for i in range(terms)]
    lines = [
        *("begin parameters", *(f"{i} {name} 0.1" for i, name in enumerate(names, 1)), "end parameters"),
        *("begin functions", f"1 f() {'+'.join(names)}", "end functions"),
        *("begin species", "1 A 10", "2 B 0", "end species", "begin reactions", "1 1 2 f", "end reactions"),
    ]
    return "\n".join(lines) + "\n"


@pytest.mark.parametrize("terms", [3, 400, 5000])
def test_sums_of_many_names_are_read_or_refused(tmp_path, terms):
    (tmp_path / "sum.net").write_text(net_of(terms), encoding="utf-8")
    done = run_here("rules", "derive", "sum.net", cwd=tmp_path)
    if done.code != 0:
        assert terms > 3
        assert "sum" in failed(done, 2) or "is nested too deeply" in failed(done, 2)


@pytest.mark.parametrize("encoding", ["klingon", "hex", "rot13", "punycode", "undefined", "utf-7", "utf-32", "cp037"])
def test_documents_of_unknown_encodings_are_refused(tmp_path, encoding):
    head = f'<?xml version="1.0" encoding="{encoding}"?>\n<sbml xmlns="http://www.sbml.org/sbml/level3/version2/core" '
    (tmp_path / "model.xml").write_text(head + 'level="3" version="2"><model/></sbml>', encoding="ascii")
    failed(run_here("rules", "derive", "model.xml", cwd=tmp_path), 2)


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("step = 0.00525", "step = 1e-320", "numerics.step = 1e-320: should be a number at least 1e-09"),
        ("step = 0.00525", "step = 1e308", "is not a whole number of steps of 1e+308"),
        ("hold = 0.0105", "hold = 1e308", "agitation.hold = 1e+308 is inf steps"),
        ("hold = 0.0105", "hold = 1e300", "agitation.hold = 1e+300 is 1.9e+302 steps"),
        ("edge = 0.15", "edge = 1e200", ""),
        ("edge = 0.15", "edge = 1e-200", ""),
        ("sigma = 4.0", "sigma = 1e308", ""),
        ("size = [2.0, 2.0, 3.0]", "size = [1e200, 1e200, 1e200]", ""),
    ],
)
def test_extreme_settings_are_refused(tmp_path, old, new, said):
    assert old in SCENE
    (tmp_path / "scene.toml").write_text(SCENE.replace(old, new), encoding="utf-8")
    done = run_here("simulate", "scene.toml", *SIMULATE[2:], cwd=tmp_path)
    if said or done.code not in (0, 4):  # 4: stopped by the guard
        assert said in failed(done, 2)


@pytest.mark.parametrize(
    ("option", "value"), [("--duration", "1e308"), ("--duration", "1e300"), ("--poses", "1e308"), ("--poses", "1e14")]
)
def test_extreme_times_are_refused(tmp_path, option, value):
    length = () if option == "--duration" else ("--duration", 0.1)
    done = run_here("simulate", "line4", "--cubes", 6, *length, option, value, cwd=tmp_path)
    assert "expected at most 1e+15 steps" in failed(done, 2)


@pytest.mark.parametrize("factor", ["number", "scale"])
@pytest.mark.parametrize("level", ["1e308", "1e300", "1e-320", "1e-300", "5e-324"])
def test_extreme_levels_of_a_study_are_refused(tmp_path, factor, level):
    name = {"number": "number", "scale": "similarity"}[factor]
    shipped = (ROOT / "mechsim" / "studies" / "shipped" / f"{name}.toml").read_text(encoding="utf-8")
    head, *_ = shipped.split("[[paper]]")
    (tmp_path / "own.toml").write_text(re.sub(r"levels = .*", f"levels = [{level}]", head), encoding="utf-8")
    assert "own.toml" in failed(run_here("study", "first-times", "own.toml", "--collect", cwd=tmp_path), 2)


# What fails outside


@pytest.mark.parametrize(
    ("error", "code", "said"),
    [
        (ValueError("cubes = 0"), MISTAKE, "cubes = 0"),
        (FileNotFoundError(errno.ENOENT, "No such file or directory", "a.toml"), MISTAKE, "directory: a.toml"),
        (PermissionError("a.csv is protected"), MISTAKE, "a.csv is protected"),
        (OSError(errno.ENOSPC, "No space left on device", "a.csv"), OUTSIDE, "No space left on device: a.csv"),
        (OSError(errno.EIO, "Input/output error"), OUTSIDE, "Input/output error"),
        (OSError("no Dask scheduler answers"), OUTSIDE, "no Dask scheduler answers"),
        (ConnectionResetError("gone"), OUTSIDE, "gone"),
        (ChildProcessError("workers cannot be started"), OUTSIDE, "workers cannot be started"),
        (MemoryError(), OUTSIDE, "not enough memory; ask for less"),
        (MemoryError("Unable to allocate 8 TiB"), OUTSIDE, "not enough memory (Unable to allocate 8 TiB)"),
        (RecursionError("maximum recursion depth exceeded"), MISTAKE, "is nested too deeply"),
        (OverflowError("int too large"), MISTAKE, "(int too large)"),
        (
            ModuleNotFoundError("No module named 'libsbml'", name="libsbml"),
            MISTAKE,
            "pip install 'python-libsbml>=5.20'",
        ),
        (ModuleNotFoundError("No module named 'nothing'", name="nothing"), FAULT, "fault of wellmixed"),
        (RuntimeError("the book is wrong"), FAULT, "RuntimeError: the book is wrong (test_failures.py:"),
        (KeyError("quad"), FAULT, "please report it, with what --debug shows"),
    ],
)
def test_every_error_has_a_message_and_a_code(monkeypatch, tmp_path, error, code, said):
    def fail(*_, **__):
        raise error

    monkeypatch.setattr("kinetics.commands.predict.described", fail)
    done = run_here(*PREDICT, cwd=tmp_path, faults=True)
    assert said in failed(done, code)
    assert judged(error)[0] == code
    with pytest.raises(type(error)):  # the control: its traceback is there for who asks
        run_here("--debug", *PREDICT, cwd=tmp_path)


def test_a_limit_on_the_size_of_files(tmp_path):
    (tmp_path / "table.csv").write_text("older")

    def limit():
        resource.setrlimit(resource.RLIMIT_FSIZE, (100, 100))

    command = list(map(str, [COMMAND, *PREDICT, "--csv", "table.csv"]))
    here = os.environ | {"PYTHONDONTWRITEBYTECODE": "1"}  # Python does not notice that it has cut its own files
    done = subprocess.run(
        command, cwd=tmp_path, env=here, capture_output=True, text=True, check=False, preexec_fn=limit
    )
    assert done.returncode == OUTSIDE
    assert done.stderr.endswith("Error: File too large; could not write: table.csv\n")
    assert (tmp_path / "table.csv").read_text() == "older"


def test_a_full_disk_under_the_store_of_runs(tmp_path, monkeypatch):
    def full(_):
        raise OSError(errno.ENOSPC, "No space left on device")

    with monkeypatch.context() as patch:
        patch.setattr("mechsim.runs.file_locks.os.fsync", full)
        done = run_here(*SIMULATE, cwd=tmp_path)
    assert "No space left on device; could not write" in failed(done, OUTSIDE)
    assert not list(tmp_path.glob("runs/.*"))
    assert run_here(*SIMULATE, cwd=tmp_path).code == 0  # the control


def test_a_scheduler_that_is_gone(tmp_path):
    pytest.importorskip("distributed")
    done = run_here(*SIMULATE, "--scheduler", "tcp://127.0.0.1:9", cwd=tmp_path)
    assert "no Dask scheduler answers at 'tcp://127.0.0.1:9'" in failed(done, OUTSIDE)


# Ctrl-C

NOTHING = "Interrupted: nothing of it is kept, and the same command starts over; files already written are complete.\n"
RUNS = "Interrupted: finished runs are kept in {}; the same command makes only the missing ones.\n"


@pytest.mark.parametrize(
    ("command", "where", "said"),
    [
        (PREDICT, "kinetics.commands.predict.described", NOTHING),
        (["rules", "derive", "line4"], "kinetics.assembly.deriving.derive.explore", NOTHING),
        (SIMULATE, "mechsim.runs.ensemble._Driver.run", RUNS.format("runs")),
        ([*SIMULATE, "--runs-folder", "mine"], "mechsim.runs.ensemble._Driver.run", RUNS.format("mine")),
        (["study", "first-times", "number"], "mechsim.runs.ensemble._Driver.run", RUNS.format("runs")),
        (["calibrate", "line4", "--out", "r.toml"], "mechsim.runs.ensemble._Driver.run", RUNS.format("runs")),
        (["validate", "line4", "--rates", "table3"], "mechsim.runs.ensemble._Driver.run", RUNS.format("runs")),
        (["demo", "--folder", "here"], "mechsim.runs.ensemble._Driver.run", RUNS.format("here/runs")),
        (["trust", "accuracy", "mechanics", "line4"], "mechsim.accuracy.measuring.measure", RUNS.format("runs")),
    ],
)
def test_ctrl_c_says_what_is_kept(tmp_path, monkeypatch, command, where, said):
    def interrupt(*_, **__):
        raise KeyboardInterrupt

    monkeypatch.setattr(where, interrupt)
    done = run_here(*command, cwd=tmp_path)
    assert done.code == 130
    assert done.err.endswith(said)


@pytest.mark.parametrize("cause", [KeyboardInterrupt(), None])
def test_an_error_that_a_library_makes_of_ctrl_c_is_an_interrupt(tmp_path, monkeypatch, cause):
    """As Numba's is, where it compiles at that moment; the control has no such cause, and is a fault."""

    def compile_it(*_, **__):
        raise RuntimeError("failed in nopython mode") from cause

    monkeypatch.setattr("kinetics.commands.predict.described", compile_it)
    done = run_here(*PREDICT, cwd=tmp_path, faults=True)
    assert done.code == (INTERRUPTED if cause else FAULT)
    assert (done.err == NOTHING) is bool(cause)


# SIGTERM, and signals at awkward moments

COMMAND_OF_ONE_LINE = """
import signal, sys, time
import click
import kinetics.support.cli.process as process
from kinetics.sampling.streamed import unbroken
from wellmixed import main
end, interrupt = lambda: signal.raise_signal(signal.SIGTERM), lambda: signal.raise_signal(signal.SIGINT)

@main.command()
def wait():
    {line}
    print("done")

main(["wait"])
"""
IN_A_CLEANING = "type('Left', (), {'__del__': lambda _: interrupt()})(); time.sleep(9)"  # where Python drops exceptions
INTO_AN_ANSWER = "import wellmixed; wellmixed.interrupted = lambda _: end(); end()"  # while the first is answered


@pytest.mark.parametrize(
    ("line", "ignored", "code", "said"),
    [
        ("end()", (), INTERRUPTED, NOTHING),
        ("end()", (signal.SIGINT,), INTERRUPTED, NOTHING),
        ("interrupt()", (signal.SIGINT,), 0, ""),
        ("end()", (signal.SIGTERM,), 0, ""),
        ("exec('with unbroken(): end(); print(1, file=sys.stderr)')", (), INTERRUPTED, f"1\n{NOTHING}"),
        ("exec('with unbroken(): end(); print(1, file=sys.stderr)')", (signal.SIGINT,), INTERRUPTED, f"1\n{NOTHING}"),
        ("raise click.Abort", (), INTERRUPTED, NOTHING),
        (IN_A_CLEANING, (), INTERRUPTED, NOTHING),
        (INTO_AN_ANSWER, (), INTERRUPTED, "\n"),  # click's, which ends the line of a terminal's ^C
        ("process._lost = end", (), INTERRUPTED, ""),  # as the last of the output is written
        ("process.sys.exit = lambda _: end()", (), -signal.SIGTERM, ""),  # as Python ends
        ("process.sys.exit = lambda _: interrupt()", (), -signal.SIGINT, ""),
    ],
)
def test_sigterm_is_as_ctrl_c_and_one_more_is_no_traceback(tmp_path, line, ignored, code, said):
    def ignore():
        for number in (signal.SIGINT, signal.SIGTERM):
            signal.signal(number, signal.SIG_IGN if number in ignored else signal.SIG_DFL)

    command = [sys.executable, "-c", COMMAND_OF_ONE_LINE.format(line=line)]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False, preexec_fn=ignore)
    assert (done.returncode, done.stderr) == (code, said)
    assert done.stdout == ("done\n" if code <= 0 or "_lost" in line else "")


# A read-only installation


def test_without_a_folder_for_compiled_kernels_a_line_says_so(tmp_path):
    """As nobody, without a home, and with no folder that may be written beside the sources."""
    code = f"""
import sys
sys.path.insert(0, {str(ROOT)!r})
from numba.core import caching
def refuse(self):
    raise OSError(30, "Read-only file system")
caching._CacheLocator.ensure_cache_path = refuse
from wellmixed import main
main({ALONG} + ["--scans-folder", sys.argv[1]])
"""
    environment = {key: value for key, value in os.environ.items() if key not in ("HOME", "NUMBA_CACHE_DIR")}
    run = [sys.executable, "-c", code, "one"]
    brief = environment | {"NUMBA_OPT": "0"}  # what is compiled is kept nowhere
    done = subprocess.run(run, cwd=tmp_path, env=brief, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert "dimer" in done.stdout
    (line,) = told(done.stderr).splitlines()
    assert line.startswith("Warning: there is no folder for compiled kernels")
    run[-2:] = code.replace("caching._CacheLocator", "ignored = type('Other', (), {}); ignored"), "other"  # the control
    done = subprocess.run(run, cwd=tmp_path, env=environment, capture_output=True, text=True, check=False)
    assert (done.returncode, told(done.stderr)) == (0, "")


# Another project's package


@pytest.mark.parametrize("name", ["kinetics", "mechsim", "calibration"])
def test_another_project_s_package_is_noticed(tmp_path, name):
    """It is not even imported: the one on PyPI dies in pandas."""
    (tmp_path / name).mkdir()
    (tmp_path / name / "__init__.py").write_text("raise RuntimeError('imported')\n")
    code = f"import sys; sys.path[:0] = [{str(tmp_path)!r}, {str(ROOT)!r}]; from wellmixed import main; main()"
    done = subprocess.run([sys.executable, "-c", code], cwd=tmp_path, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout) == (MISTAKE, "")
    assert done.stderr.startswith(f"Error: {tmp_path / name / '__init__.py'} is another project's package {name}")
    assert f"pip uninstall {name}" in done.stderr
    assert "pip install --force-reinstall --no-deps wellmixed" in done.stderr
    (tmp_path / name / "__init__.py").unlink()  # the control: a folder without a package stands in nobody's way
    done = subprocess.run([sys.executable, "-c", code], cwd=tmp_path, capture_output=True, text=True, check=False)
    assert "Usage: " in done.stdout + done.stderr


def test_a_package_that_is_missing_is_named(tmp_path):
    code = "import sys; sys.path[:] = [p for p in sys.path if 'site-packages' not in p or p]\n"
    code += "import importlib.util as u; find = u.find_spec\n"
    code += "u.find_spec = lambda name: None if name == 'mechsim' else find(name)\n"
    code += f"sys.path.insert(0, {str(ROOT)!r}); import wellmixed"
    done = subprocess.run([sys.executable, "-c", code], cwd=tmp_path, capture_output=True, text=True, check=False)
    assert done.returncode == MISTAKE
    assert done.stderr.startswith("Error: the package mechsim of wellmixed is missing; install it again")
