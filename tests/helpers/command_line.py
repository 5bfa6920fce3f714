"""The command as a user has it: installed and in a process of its own, or called within this one."""

import contextlib
import json
import subprocess
import sys
import warnings
from pathlib import Path
from typing import NamedTuple

from click.testing import CliRunner

from wellmixed import main

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


def run(*arguments, cwd):
    """Run the command, its output in pipes."""
    command = [str(COMMAND), *map(str, arguments)]
    done = subprocess.run(command, cwd=cwd, capture_output=True, text=True, timeout=300, check=False)
    return Done(done.returncode, done.stdout, done.stderr)


def run_here(*arguments, cwd):
    """The same within this process, without the second that Python and its libraries take to start."""
    with contextlib.chdir(cwd), warnings.catch_warnings():
        show = warnings.showwarning
        try:
            done = CliRunner().invoke(main, [str(argument) for argument in arguments], catch_exceptions=False)
        finally:
            warnings.showwarning = show  # the command shows warnings in its own way
    return Done(done.exit_code, done.stdout, done.stderr)
