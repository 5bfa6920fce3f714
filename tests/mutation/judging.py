"""Runs a room's tests on a mutant: in a copy of the project, in a fork of a process that has loaded the libraries.

Limits are of processor time, so that a busy machine kills no mutant; a wall clock ends what waits for ever.
"""

from __future__ import annotations

import importlib
import os
import resource
import shutil
import signal
import sys
import tempfile
import time
import traceback
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).parents[2]
COPIED = ("kinetics", "mechsim", "calibration", "tests", "wellmixed.py", "pyproject.toml")
LINKED = ("results", "docs", "notebooks", "README.md", "ARCHITECTURE.md")
PATIENCE, LEAST_PATIENCE = 4, 20.0  # times what the tests take, of processor time; s
LONGEST_WAIT = 900.0  # s, by the wall clock
LIBRARIES = (
    *("numpy", "scipy.stats", "scipy.sparse.linalg", "scipy.optimize", "pandas", "numba", "msgspec", "click"),
    "hypothesis",  # whose plugin imports it at the end of every session: three quarters of what a small test takes
)


@dataclass(frozen=True)
class Outcome:
    """What came of the tests: whether all passed, what they took (s of processor time), what was said if not."""

    passed: bool
    seconds: float
    said: str


@contextmanager
def copy_of(root: Path = ROOT) -> Iterator[Path]:
    """A copy of the project, with what is compiled."""
    with tempfile.TemporaryDirectory(prefix="mutation") as folder:
        tree = Path(folder)
        for name in COPIED:
            if (root / name).is_dir():
                shutil.copytree(root / name, tree / name)
            elif (root / name).exists():
                shutil.copy2(root / name, tree / name)
        for name in LINKED:
            (tree / name).symlink_to(root / name)
        yield tree


@contextmanager
def changed(path: Path, source: str) -> Iterator[None]:
    """Another text in a file, for a while."""
    sound = path.read_text(encoding="utf-8")
    path.write_text(source, encoding="utf-8")
    try:
        yield
    finally:
        path.write_text(sound, encoding="utf-8")


def run_tests(tree: Path, arguments: tuple[str, ...], seconds: float = 3600.0, plain: bool = False) -> Outcome:
    """Run tests of a copy until the first that fails, for so much processor time at most. RuntimeError: none is there.

    plain : kernels are not compiled
    """
    for name in (*LIBRARIES, "pytest", "_pytest.assertion.rewrite"):
        with suppress(ImportError):
            importlib.import_module(name)
    command = ["-x", *arguments]
    outcome, code = in_fork(lambda: pytest_in(tree, command, plain), tree, seconds)
    if code in (4, 5):  # what was asked for is no test; whatever else it says, a test has failed
        raise RuntimeError(f"pytest ended with {code}: {outcome.said}")
    return outcome


def pytest_in(tree: Path, arguments: list[str], plain: bool) -> int:
    """Run tests of a copy in this process, a fork, which forgets what it has imported of the project itself."""
    import numba

    numba.config.DISABLE_JIT = plain  # type: ignore[attr-defined]
    for name, module in list(sys.modules.items()):
        file = Path(getattr(module, "__file__", None) or "/")
        if file.is_relative_to(ROOT) and "site-packages" not in file.parts:
            del sys.modules[name]
    os.chdir(tree)
    for name in ("CI", "BUILD_NUMBER"):  # where they are set, pytest repeats all of each failure in its summary
        os.environ.pop(name, None)
    os.environ |= {"PYTHONPATH": str(tree), "OPENBLAS_NUM_THREADS": "1", "MPLBACKEND": "Agg"}
    sys.path[:] = [str(tree), *(place for place in sys.path if Path(place or ".").resolve() != ROOT)]
    sys.dont_write_bytecode = True  # of a mutant
    import pytest

    # The fork has imported hypothesis before pytest could rewrite its assertions, which are none of ours.
    quiet = ("-W", "ignore::pytest.PytestAssertRewriteWarning")
    return int(pytest.main(["-q", "-n", "0", "-p", "no:cacheprovider", *quiet, *arguments]))


def in_fork(work: Callable[[], int], tree: Path, seconds: float) -> tuple[Outcome, int]:
    """What came of work in a child, and its exit code; minus the signal where one ended it."""
    said = tree / "said.txt"
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DeprecationWarning)  # later Pythons warn where there are threads
        child = os.fork()
    if not child:
        code = 70
        try:
            os.setsid()
            out = os.open(said, os.O_WRONLY | os.O_CREAT | os.O_TRUNC, 0o600)
            os.dup2(out, 1)
            os.dup2(out, 2)
            sys.stdout, sys.stderr = (os.fdopen(number, "w", closefd=False) for number in (1, 2))
            limit = int(seconds) + 1
            resource.setrlimit(resource.RLIMIT_CPU, (limit, limit))
            code = work()
        except BaseException:  # noqa: BLE001 - told by the exit code
            traceback.print_exc()
        finally:
            sys.stdout.flush()
            os._exit(code)
    end = time.monotonic() + LONGEST_WAIT
    while True:
        done, status, used = os.wait4(child, os.WNOHANG)
        if done:
            break
        if time.monotonic() > end:
            os.killpg(child, signal.SIGKILL)
        time.sleep(0.02)
    with suppress(ProcessLookupError):  # whom it started and left behind
        os.killpg(child, signal.SIGKILL)
    code = os.waitstatus_to_exitcode(status)
    text = said.read_text(encoding="utf-8", errors="replace") if said.exists() else ""
    return Outcome(code == 0, used.ru_utime + used.ru_stime, text[-4000:]), code
