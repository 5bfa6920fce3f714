"""What all tests share: `--validate`, drawing without a display, and the command as a user has it."""

import json
import os
import subprocess
import sys
from pathlib import Path
from typing import NamedTuple

import pytest

os.environ["MPLBACKEND"] = "Agg"  # before anything imports matplotlib, here and in subprocesses


def pytest_addoption(parser):
    parser.addoption("--validate", action="store_true", help="also make the long statistical runs")


def pytest_collection_modifyitems(config, items):
    if config.getoption("--validate"):
        return
    skip = pytest.mark.skip(reason="a long statistical run; made with --validate")
    for item in items:
        if "validate" in item.keywords:
            item.add_marker(skip)


COMMAND = Path(sys.executable).with_name("wellmixed")


class Done(NamedTuple):
    """What a command left: exit code, standard output and standard error."""

    code: int
    out: str
    err: str

    @property
    def json(self):
        """The one object on standard output; nothing else may be there."""
        assert self.code == 0, self.err
        assert self.out.count("\n") == 1
        return json.loads(self.out)


@pytest.fixture(scope="session")
def wellmixed():
    """wellmixed(*arguments, cwd=): run the installed command in a process of its own, its output in pipes."""

    def run(*arguments, cwd):
        command = [str(COMMAND), *map(str, arguments)]
        done = subprocess.run(command, cwd=cwd, capture_output=True, text=True, timeout=300, check=False)
        return Done(done.returncode, done.stdout, done.stderr)

    return run
