"""The command as a user has it: the installed one in a process of its own, or within the test's."""

import json
import os
import subprocess
import sys
from pathlib import Path
from typing import NamedTuple

from click.testing import CliRunner

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
    """Run the command within this process, which spares its start and that of the server of workers."""
    from wellmixed import main

    before = Path.cwd()
    os.chdir(cwd)
    try:
        done = CliRunner().invoke(main, [*map(str, arguments)])
    finally:
        os.chdir(before)
    if done.exception is not None and not isinstance(done.exception, SystemExit):
        raise done.exception
    return Done(done.exit_code, done.stdout, done.stderr)
