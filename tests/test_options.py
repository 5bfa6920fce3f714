"""Options of all commands: those that want a package say so first, files may be several, other values may not."""

import re
import sys
import tomllib
from importlib.metadata import packages_distributions
from pathlib import Path

import pytest
from command_line import run_here
from command_tree import commands
from json_outputs import command_of

from kinetics.support.packages import EXTRAS

ROOT = Path(__file__).parents[1]
LINE = ("line4", "--rates", "table3", "--cubes", 6)
PREDICT = ("predict", *LINE, "--runs", 5, "--duration", 1)
SCAN = ("scan", *LINE, "--over", "1+1->2=1e-4,1e-3", "--ask", "E[monomer] @ 10")
SIMULATE = ("simulate", "line4", "--cubes", 2, "--duration", 0.1)

# Packages that come with extras


@pytest.mark.parametrize(
    ("command", "package"),
    [
        ((*PREDICT, "--plot", "a.png"), "matplotlib"),
        ((*PREDICT, "--csv", "a.csv"), "pandas"),
        ((*PREDICT, "--trajectories-csv", "a.csv"), "pandas"),
        ((*PREDICT, "--elasticity-plot", "a.png"), "matplotlib"),
        ((*PREDICT, "--html", "a.html"), "plotly"),
        ((*SCAN, "--parquet", "a.parquet"), "pyarrow"),
        ((*SCAN, "--parquet", "a.parquet"), "pandas"),
        ((*SCAN, "--csv", "a.csv"), "pandas"),
        ((*SCAN, "--plot", "a.png"), "matplotlib"),
        (("rules", "derive", *LINE, "--out", "a.xml"), "libsbml"),
        (("passage", *LINE, "--species", "dimer", "--plot", "a.pdf"), "matplotlib"),
        (("rules", "check", "line4", "--plot", "a.svg"), "matplotlib"),
        (("rules", "draw", "line4", "--out", "a.svg"), "matplotlib"),
        (("rules", "grow", "line4", "--cubes", 9, "--strip", "a.png"), "matplotlib"),
        ((*SCAN, "--cubes", 6, "--html", "a.html"), "plotly"),
        (("rules", "rank", "line4", "--csv", "a.csv"), "pandas"),
        ((*SIMULATE, "--picture", "a.png"), "matplotlib"),
        ((*SIMULATE, "--growth", "a.png"), "matplotlib"),
        ((*SIMULATE, "--plot", "a.png"), "matplotlib"),
        (("trust", "accuracy", "kinetics", *LINE, "--csv", "a.csv"), "pandas"),
        (("trust", "accuracy", "mechanics", "line4", "--csv", "a.csv"), "pandas"),
        (("study", "plan", "line4", "--out", "plan.toml", "--plot", "a.png"), "matplotlib"),
        (("calibrate", "line4", "--out", "rates.toml", "--report", "a.html"), "matplotlib"),
        (("validate", "line4", "--rates", "table3", "--report", "a.html"), "matplotlib"),
        (("validate", "line4", "--rates", "table3", "--csv", "a.csv"), "pandas"),
        (("runs", "render", "abcdef", "--out", "a.html"), "plotly"),
        (("runs", "render", "abcdef", "--out", "a.mp4"), "imageio_ffmpeg"),
        (("runs", "export", ".", "--out", "tables"), "pyarrow"),
        (("runs", "loads", ".", "--plot", "a.png"), "matplotlib"),
        (("runs", "crowding", ".", "--csv", "a.csv"), "pandas"),
    ],
)
def test_what_an_option_needs_is_looked_for_before_any_work(tmp_path, monkeypatch, command, package):
    monkeypatch.setitem(sys.modules, package, None)
    done = run_here(*command, cwd=tmp_path)
    assert (done.code, done.out) == (2, "")
    assert done.err == f"Error: this needs {package}; install it by: pip install '{EXTRAS[package]}'\n"
    assert not list(tmp_path.iterdir())


def test_what_pip_is_to_install_is_what_the_extras_ask_for():
    extras = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]["optional-dependencies"]
    asked = {line.split(";")[0].strip() for extra in extras.values() for line in extra}
    assert set(EXTRAS.values()) <= asked
    distributions = packages_distributions()  # a package is imported by another name than it is installed by
    for package, line in EXTRAS.items():
        for distribution in distributions.get(package, ()):
            assert line.lower().startswith(distribution.lower().replace("_", "-")) or package == "bionetgen"


# An option given twice


def test_figures_and_tables_may_be_several(tmp_path):
    files = [f"{name}.{kind}" for kind in ("svg", "csv") for name in "ab"]
    options = [("--plot" if file.endswith("svg") else "--csv", file) for file in files]
    assert run_here(*PREDICT, *sum(options, ()), cwd=tmp_path).code == 0
    assert [(tmp_path / file).stat().st_size > 100 for file in files] == [True] * 4
    assert (tmp_path / "a.csv").read_bytes() == (tmp_path / "b.csv").read_bytes()
    assert run_here(*SCAN, "--parquet", "a.parquet", "--parquet", "b.parquet", cwd=tmp_path).code == 0
    assert (tmp_path / "a.parquet").read_bytes() == (tmp_path / "b.parquet").read_bytes()
    (tmp_path / "options.toml").write_text('[predict]\nplot = "c.svg"\ncsv = ["c.csv", "d.csv"]\n')
    assert run_here("--config", "options.toml", *PREDICT, cwd=tmp_path).code == 0
    assert {"c.svg", "c.csv", "d.csv"} <= {file.name for file in tmp_path.iterdir()}


@pytest.mark.parametrize(
    ("command", "said"),
    [
        ((*PREDICT, "--runs", 6), "--runs was given twice, with 5 and with 6"),
        ((*PREDICT, "--runs=6"), "--runs was given twice, with 5 and with 6"),
        ((*PREDICT, "--tank", 2, 2, 3, "--tank", 2, 2, 4), "--tank was given twice, with 2 2 3 and with 2 2 4"),
        (
            ("rules", "derive", *LINE, "--out", "a.net", "--out", "b.net"),
            "--out was given twice, with a.net and with b.net",
        ),
        (("rules", "grow", "line4", "--seed", 1, "--seed", 2), "--seed was given twice, with 1 and with 2"),
    ],
)
def test_two_values_for_one_are_refused(tmp_path, command, said):
    done = run_here(*command, cwd=tmp_path)
    assert done.code == 2
    assert done.err.endswith(f"Error: {said}; it takes one value, so leave one out\n")
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    "more", [("--runs", 5), ("--times", 0.5, "--times", 1), ("--json", "--json"), ("--initial", "monomer=6")]
)
def test_the_same_value_twice_is_one(tmp_path, more):
    command = [word for word in PREDICT if word != "--duration" or "--times" not in more]
    if "--times" in more:
        command.remove(1)
    if "--initial" in more:
        command = [*command[:4], *command[6:], "--initial", "monomer=6"]
    assert run_here(*command, *more, cwd=tmp_path).code == 0


# Errors name options that there are


CLOCK = "up: A -> B, 1 + sin(t)\nA = 5\n"
REFUSALS = [
    ("passage", "clock.rxn", "--species", "B"),
    ("ask", "clock.rxn", "P=? [ F<=3 B>=5 ]"),
    ("predict", "clock.rxn", "--method", "transient", "--times", 1),
    ("trust", "verify", "clock.rxn", "--times", 1),
    ("trust", "accuracy", "kinetics", "clock.rxn", "--duration", 1),
    ("passage", "line4", "--species", "dimer"),
    ("ask", "line4", "--rates", "table3", "E[dimer] @ 1"),
    ("scan", "line4", "--rates", "table3", "--over", "k=1,2", "--ask", "E[dimer] @ 1"),
    ("rules", "derive", "line4", "--out", "a.net"),
    ("trust", "verify", "line4"),
    ("rules", "rank", "line4"),
    ("rules", "check", "nothing"),
    ("rules", "grow", "line4", "--cubes", 9, "--posterior-draws", 5),
    ("runs", "render", "abcdef", "--out", "a.png"),
    ("runs", "replay", "abcdef"),
    ("runs", "loads", "."),
    ("runs", "crowding", "."),
    ("runs", "export", ".", "--out", "tables"),
    ("study", "first-times", "nothing"),
    ("study", "rates", "nothing"),
    ("study", "plan", "line4", "--out", "plan.txt"),
    ("calibrate", "line4", "--events", __file__, "--out", "rates.toml"),
    ("validate", "line4", "--rates", "nothing"),
    ("simulate", "line4"),
]


def strangers(words, said):
    """Options that a message names and the command lacks; those of a command that it quotes are looked for there."""
    options = {name: {spelled for p in command.params for spelled in p.opts} for name, command in commands()}
    options["wellmixed"] = set()
    for quoted in re.findall(r"`(?:wellmixed )?([^`]*)`", said):
        known = options[command_of(quoted.split())]
        yield from (option for option in re.findall(r"--[a-z-]+", quoted) if option not in known)
    plain = re.sub(r"`[^`]*`", "", said)
    yield from (option for option in re.findall(r"(?<![\w-])--[a-z][a-z-]*", plain) if option not in options[words])


@pytest.mark.parametrize("command", REFUSALS)
def test_errors_name_options_that_the_command_has_and_no_arguments_of_python(tmp_path, command):
    (tmp_path / "clock.rxn").write_text(CLOCK)
    done = run_here(*command, cwd=tmp_path)
    assert done.code == 2, done.out
    said = done.err.partition("Error: ")[2]
    assert not list(strangers(command_of(command), said)), said
    assert not re.search(r"\b(max_[a-z]+|within|copies_per_unit)\b ?=|\bmax_[a-z]+\b|method 'general'", said), said


def test_a_message_that_names_another_command_s_option_is_seen():
    assert list(strangers("passage", "raise --max-states, or --truncate, as in `wellmixed scan --max-states 0`")) == [
        "--max-states"
    ]
