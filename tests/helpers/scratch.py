"""A scratch copy of the packages, in which a test adds a member by one file and one line and runs its contract."""

import shutil
from pathlib import Path

from tests.mutation.judging import in_fork, pytest_in

ROOT = Path(__file__).parents[2]
COPIED = ("kinetics", "mechsim", "calibration", "tests/helpers", "tests/contracts")
QUIETLY = ("-p", "no:hypothesispytest")  # which would import hypothesis; no contract uses it


def scratch_copy(folder: Path) -> Path:
    """The packages, the contracts and what they share, copied into a folder of their own.

    Their byte code comes along, compiled kernels do not.
    """
    for name in COPIED:
        shutil.copytree(ROOT / name, folder / name, ignore=shutil.ignore_patterns("kernels-*"))
    for name in ("pyproject.toml", "wellmixed.py", "tests/conftest.py"):
        shutil.copy(ROOT / name, folder / name)
    return folder


def add_line(file: Path, after: str, line: str) -> None:
    """Add one line after the one that contains `after`, which must stand there once."""
    lines = file.read_text(encoding="utf-8").splitlines(keepends=True)
    (place,) = [i for i, text in enumerate(lines) if after in text]
    lines.insert(place + 1, line + "\n")
    file.write_text("".join(lines), encoding="utf-8")


def run_contract(copy: Path, contract: str, *arguments: str, plain: bool = False) -> tuple[int, str]:
    """Run one contract of the copy in a fork, which imports the copy and nothing of the original.

    Returns the exit code of pytest, and what it said.
    plain : kernels are not compiled
    """
    where = [copy / "tests" / "contracts" / contract, f"--rootdir={copy}", "-c", copy / "pyproject.toml"]
    command = [*QUIETLY, *map(str, where), *arguments]
    outcome, code = in_fork(lambda: pytest_in(copy, command, plain), copy, 3600.0)
    return code, outcome.said
