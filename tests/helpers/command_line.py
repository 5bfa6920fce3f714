"""The `wellmixed` command in tests: in a process of its own, as a user has it, or in this one, which is cheaper."""

import contextlib
import json
import re
import subprocess
import sys
import warnings
from pathlib import Path
from typing import NamedTuple

from click.testing import CliRunner
from json_outputs import command_of, see

COMMAND = Path(sys.executable).with_name("wellmixed")


class Done(NamedTuple):
    """The outcome of a command: exit code, standard output, and what it told on standard error."""

    code: int
    out: str
    err: str

    @property
    def json(self):
        """The one object on standard output; nothing else may be there."""
        assert self.code == 0, self.err
        assert self.out.count("\n") == 1
        return json.loads(self.out)


def told(text):
    """What a command has told on standard error but how far it is, which it says on a slow machine alone."""
    return "".join(line for line in text.splitlines(keepends=True) if not re.match("forecast: |.* so far", line))


def run(*arguments, cwd):
    """Run the installed command, its output in pipes. A command that hangs is ended by the time limit of the test."""
    command = [str(COMMAND), *map(str, arguments)]
    done = subprocess.run(command, cwd=cwd, capture_output=True, text=True, check=False)
    if "--json" in command and done.stdout.startswith("{"):
        see(command_of(arguments), json.loads(done.stdout))
    return Done(done.returncode, done.stdout, told(done.stderr))


def run_here(*arguments, cwd, faults=False):
    """Run the command in this process, which spares the imports. A fault of ours is raised, unless it is asked for."""
    from kinetics.support.cli.failures import FAULT
    from wellmixed import main

    with contextlib.chdir(cwd), warnings.catch_warnings():
        warnings.simplefilter("default")  # lines on standard error, as in a process of its own
        done = CliRunner().invoke(main, list(map(str, arguments)), prog_name="wellmixed")
    if done.exception is not None and not isinstance(done.exception, SystemExit):
        raise done.exception
    assert faults or done.exit_code != FAULT, done.stderr
    return Done(done.exit_code, done.stdout, told(done.stderr))
