"""The cache of compiled kernels: an edit of any kernel of the room is seen, and old code does not pile up."""

import contextlib
import importlib
import multiprocessing
import os
import shutil
import sys
import time
from pathlib import Path

import numba
import pytest

import kinetics
from kinetics.kernels import compiled

KERNELS = Path(compiled.__file__).parent
CALLEE = (
    '"""A step."""\n\nfrom kinetics.kernels.compiled import compiled\n\n\n@compiled\ndef step(x):\n    return x + 1\n'
)
CALLER = (
    '"""A kernel that calls it."""\n\nfrom kinetics.kernels.callee import step\n'
    "from kinetics.kernels.compiled import compiled\n\n\n@compiled\ndef twice(x):\n    return step(step(x))\n"
)
CALL = "from kinetics.kernels.caller import twice; print(twice(0), sum(twice.stats.cache_hits.values()))"
PLAIN = "from numba import njit\n\n\ndef compiled(function):\n    return njit(cache=True)(function)\n"


@pytest.fixture
def room(tmp_path):
    """A scratch copy of the kernels with one that calls another across files."""
    folder = tmp_path / "kinetics" / "kernels"
    shutil.copytree(KERNELS, folder, ignore=shutil.ignore_patterns("__pycache__"))
    (tmp_path / "kinetics" / "__init__.py").touch()
    (folder / "callee.py").write_text(CALLEE, encoding="utf-8")
    (folder / "caller.py").write_text(CALLER, encoding="utf-8")
    return folder


FORK = multiprocessing.get_context("fork")


@pytest.fixture(scope="module", autouse=True)
def _warm():
    """What Numba makes ready for its first function, once for all forks."""
    numba.njit(lambda x: x + 1)(0)


def begun(room, code=CALL):
    """A process that imports the room anew; as a fork of this one it has Numba already."""
    process = FORK.Process(target=run_anew, args=(room.parents[1], code, said := room.parents[1] / f"{time.time_ns()}"))
    process.start()
    process.said = said
    return process


def run_anew(folder, code, said):
    for name in [name for name in sys.modules if name.partition(".")[0] == "kinetics"]:
        del sys.modules[name]
    numba.config.CACHE_DIR = ""
    sys.dont_write_bytecode = True  # edits within a second leave byte code of the same time and size behind
    sys.path.insert(0, str(folder))
    importlib.invalidate_caches()
    os.chdir(folder)
    with said.open("w") as out, contextlib.redirect_stdout(out):
        exec(code, {"__name__": "__main__"})


def output(process):
    process.join()
    assert process.exitcode == 0
    return process.said.read_text().split()


def edit(file, old, new):
    text = file.read_text(encoding="utf-8")
    assert old in text
    file.write_text(text.replace(old, new), encoding="utf-8")


def folders(room):
    return sorted((room / "__pycache__").glob(f"{compiled.PREFIX}*"))


def test_an_edit_of_a_callee_in_another_file_is_seen(room):
    assert output(begun(room)) == ["2", "0"]
    assert output(begun(room)) == ["2", "1"]  # from the cache
    edit(room / "callee.py", "x + 1", "x + 10")
    assert output(begun(room)) == ["20", "0"]
    assert output(begun(room)) == ["20", "1"]
    edit(room / "callee.py", "x + 10", "x + 1")  # back to sources that were compiled before
    assert output(begun(room)) == ["2", "1"]


def test_what_is_cached_is_loaded_for_forks_and_nothing_is_compiled(room):
    load = "from kinetics.kernels import caller, compiled; compiled.load_cached(caller); "
    load += "print(len(caller.twice.signatures), sum(caller.twice.stats.cache_hits.values()))"
    assert output(begun(room, load)) == ["0", "0"]
    assert output(begun(room)) == ["2", "0"]
    assert output(begun(room, load)) == ["1", "1"]
    for index in room.glob("__pycache__/*/caller.*.nbi"):
        index.write_bytes(b"damaged")
    assert output(begun(room, load)) == ["0", "0"]


def test_with_plain_numba_the_stale_code_runs(room):
    """A control that must fail: what the cache is for."""
    (room / "compiled.py").write_text(PLAIN, encoding="utf-8")
    assert output(begun(room)) == ["2", "0"]
    edit(room / "callee.py", "x + 1", "x + 10")
    assert output(begun(room)) == ["2", "1"]


def test_old_code_does_not_pile_up_and_processes_may_race(room):
    """Several processes at once, and a process with older sources that finds its folder gone."""
    old = begun(room, f"import kinetics.kernels.caller, time\nopen('ready', 'w').close()\n{waiting('go')}\n{CALL}")
    while not (room.parents[1] / "ready").exists():
        assert old.is_alive()
        time.sleep(0.01)
    for value in range(2, 6):
        edit(room / "callee.py", f"x + {value - 1}\n", f"x + {value}\n")
        for process in [begun(room) for _ in range(1 + (value == 5))]:
            assert output(process)[0] == str(2 * value)
    assert len(folders(room)) == compiled.KEPT
    (room.parents[1] / "go").touch()
    assert output(old)[0] == "2"
    assert len(folders(room)) <= compiled.KEPT
    assert list(room.glob("__pycache__/**/*.nbi"))


def waiting(name):
    """Code that waits until a file is there; the test goes on whenever it comes."""
    return f"import os\nwhile not os.path.exists('{name}'): time.sleep(0.01)"


def begun_and_edited(room, before_edit):
    """A process that takes its first kernel, goes on once the callee was edited, and prints what it computes."""
    process = begun(room, f"{before_edit}\nimport time\nopen('ready', 'w').close()\n{waiting('go')}\n{CALL}")
    while not (room.parents[1] / "ready").exists():
        assert process.is_alive()
        time.sleep(0.01)
    edit(room / "callee.py", "x + 1", "x + 10")
    (room.parents[1] / "go").touch()
    return output(process)


@pytest.mark.parametrize("is_guarded", [True, False], ids=["guarded", "control"])
def test_an_edit_during_a_run_is_not_stored_as_the_old_sources(room, is_guarded):
    """The kernels are imported after the edit, the hash was taken before."""
    if not is_guarded:  # a control that must fail
        edit(room / "compiled.py", "self.is_mixed |= ", "self.is_mixed &= ")
        edit(
            room / "compiled.py",
            "return not self.is_mixed and sources_hash(self.folder) == self.sources",
            "return True",
        )
    assert begun_and_edited(room, "import kinetics.kernels.clock") == ["20", "0"]
    edit(room / "callee.py", "x + 10", "x + 1")
    assert output(begun(room)) == (["2", "0"] if is_guarded else ["20", "1"])


def test_after_an_edit_during_a_run_nothing_is_loaded_from_the_old_cache(room):
    """The callee is of the new sources; the caller in the cache was compiled with the old one."""
    assert output(begun(room)) == ["2", "0"]
    assert begun_and_edited(room, "import kinetics.kernels.clock") == ["20", "0"]


DAMAGE = """
from pathlib import Path
from kinetics.kernels.caller import twice
from kinetics.kernels.compiled import compiled
twice(0)
for ending in ("nbi", "nbc"):
    for damaged in (b"", b"none of it", None):
        (path,) = Path("kinetics").glob(f"**/caller*.{ending}")
        data = path.read_bytes()
        path.write_bytes(data[: len(data) // 2] if damaged is None else damaged)
        for _ in range(2):
            again = compiled(twice.py_func)
            print(again(0), sum(again.stats.cache_hits.values()))
"""


def test_damaged_files_of_the_cache_are_compiled_anew(room):
    assert output(begun(room, DAMAGE)) == ["2", "0", "2", "1"] * 6


def test_a_folder_that_cannot_be_written_is_no_error(room):
    code = (
        "from kinetics.kernels.caller import twice\nimport shutil, pathlib\n"
        "folder = pathlib.Path(twice._cache._cache_path)\nfolder.parent.mkdir(exist_ok=True)\n"
        "folder.write_text('in the way')\nprint(twice(0))"
    )
    assert output(begun(room, code)) == ["2"]


def test_the_hash_is_of_all_sources_of_the_room(room):
    seen = {compiled.sources_hash(room)}
    edit(room / "callee.py", "A step", "One step")
    seen.add(compiled.sources_hash(room))
    (room / "callee.py").rename(room / "called.py")
    seen.add(compiled.sources_hash(room))
    assert len(seen) == 3


def test_kernels_are_compiled_in_a_thread_that_no_interrupt_reaches(room):
    code = (
        "import threading\nfrom kinetics.kernels import caller, compiled\nseen = []\n"
        "compiled.KernelCache.load_overload = lambda *_: seen.append(threading.current_thread())\n"
        "print(caller.twice(0), threading.main_thread() in seen, len(seen) > 1)"
    )
    assert output(begun(room, code)) == ["2", "False", "True"]


def test_constants_do_not_compile_a_callee_anew(room):
    edit(room / "caller.py", "step(step(x))", "step(0) + step(1) + x - 1")
    code = "from kinetics.kernels.caller import step, twice; print(twice(0), len(step.signatures))"
    assert output(begun(room, code)) == ["2", "1"]


@pytest.mark.parametrize("package", ["kinetics", "mechsim"])
def test_every_kernel_is_compiled_by_the_one_decorator(package):
    for path in (Path(kinetics.__file__).parents[1] / package / "kernels").glob("*.py"):
        assert path.name == "compiled.py" or "njit" not in path.read_text(encoding="utf-8"), path
