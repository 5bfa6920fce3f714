"""A table of commands by states of the standard streams, each cell in a fork that ends as a process of Python does.

A process of its own for each cell would import everything anew. A fork gets its streams as Python makes them at its
start, None where a descriptor is closed, and ends with a last flush, as Python does.
"""

import contextlib
import gc
import io
import json
import os
import subprocess
import sys
from pathlib import Path

from click.testing import CliRunner

from wellmixed import main as wellmixed

WELL = "all is well"
# state of standard output, of standard error; "whole" goes to a file
STATES = {
    WELL: ("whole", "whole"),
    "output full": ("full", "whole"),
    "output closed": ("closed", "whole"),
    "output unread": ("unread", "whole"),
    "error full": ("whole", "full"),
    "error closed": ("whole", "closed"),
    "both full": ("full", "full"),
    "both closed": ("closed", "closed"),
    "both unread": ("unread", "unread"),
}


def table(commands, folder):
    """{command: {state: exit code}}; each cell runs in folder/command/state, with its streams beside, .out and .err."""
    arguments = [sys.executable, __file__, json.dumps(commands), str(folder)]
    done = subprocess.run(arguments, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


def become(descriptor, state, name):
    """Give this process a standard stream in such a state, as it has it when Python starts."""
    if state == "closed":
        os.close(descriptor)
        stream = None
    else:
        if state == "unread":
            unread, opened = os.pipe()
            os.close(unread)
        else:
            opened = os.open("/dev/full" if state == "full" else name, os.O_WRONLY | os.O_CREAT)
        os.dup2(opened, descriptor)
        os.close(opened)
        buffer = io.BufferedWriter(io.FileIO(descriptor, "wb", closefd=False))
        stream = io.TextIOWrapper(buffer, "utf-8", line_buffering=descriptor == 2)
    named = {1: "stdout", 2: "stderr"}[descriptor]
    setattr(sys, named, stream)
    setattr(sys, f"__{named}__", stream)


def end_of(words):
    """Run a command and end this process with its code, or with 120 where Python's last flush would fail."""
    code = 1
    try:
        wellmixed(words, prog_name="wellmixed")
    except SystemExit as end:
        code = end.code
        try:
            for stream in filter(None, (sys.stdout, sys.stderr)):
                stream.flush()
        except OSError:
            code = 120
    finally:
        os._exit(code)


def main(commands, folder):
    """Print the table. Each command runs here first, so that its forks find all that it needs imported."""
    codes = {command: {} for command in commands}
    for command, words in commands.items():
        for state in STATES:
            (Path(folder) / command / state).mkdir(parents=True)
        with contextlib.chdir(Path(folder) / command / WELL):
            CliRunner().invoke(wellmixed, words)
        gc.freeze()
        for state, (out, err) in STATES.items():
            place = Path(folder) / command / state
            child = os.fork()
            if child == 0:
                become(1, out, f"{place}.out")
                become(2, err, f"{place}.err")
                os.chdir(place)
                end_of(words)
            codes[command][state] = os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])
    print(json.dumps(codes))  # noqa: T201


if __name__ == "__main__":
    main(json.loads(sys.argv[1]), sys.argv[2])
