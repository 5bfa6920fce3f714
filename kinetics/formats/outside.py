"""Other people's programs, run on text that may be hostile: in an empty folder, with limits of time and memory."""

from __future__ import annotations

import os
import signal
import sys
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

# Puts the text into its file, sets the limits of its own process, then becomes the program. Systems without `resource`
# have the limit of time alone.
LAUNCHER = """
import os, sys
from pathlib import Path
Path(sys.argv[3]).write_bytes(sys.stdin.buffer.read())
try:
    import resource
    seconds, memory = map(int, sys.argv[1:3])
    resource.setrlimit(resource.RLIMIT_CPU, (seconds, seconds + 5))  # a signal of its own, before the last one
    resource.setrlimit(resource.RLIMIT_AS, (memory, memory))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
except ImportError:
    pass
os.execv(sys.argv[4], sys.argv[4:])
"""


CLOCK = 10  # times the limit of processor time, on a busy machine


@dataclass(frozen=True)
class Program:
    """A program that translates a model.

    name : what messages call it
    command : absolute path and arguments
    seconds : of processor time, and of ten times as much by the clock
    memory : bytes of address space
    cure : what a user does about a model that takes more
    """

    name: str
    command: Sequence[str]
    seconds: int
    memory: int
    cure: str

    def translated(self, path: Path, text: str, given: str, made: str) -> str:
        """What it makes of a text: both are files of its empty folder.

        path : the user's file, for messages
        given, made : names of the files that it reads and writes
        """
        import subprocess

        with tempfile.TemporaryDirectory() as folder:
            settings = [str(self.seconds), str(self.memory), given]
            try:
                done = subprocess.run(  # noqa: S603 - of no shell; the arguments are ours
                    [sys.executable, "-P", "-c", LAUNCHER, *settings, *self.command],
                    cwd=folder,
                    env={**os.environ, "PYTHONSAFEPATH": "1"},
                    input=text.encode(),
                    stdout=subprocess.PIPE,
                    stderr=subprocess.STDOUT,
                    timeout=CLOCK * self.seconds,
                    check=False,
                )
            except subprocess.TimeoutExpired:
                raise self._beyond(path) from None
            if done.returncode == -getattr(signal, "SIGXCPU", 0) != 0:
                raise self._beyond(path)
            output = Path(folder) / made
            if done.returncode == 0 and output.is_file():
                return output.read_text(encoding="utf-8")
        raise ValueError(f"{path}: {self.name} refused it: {_last_words(done.stdout) or f'code {done.returncode}'}")

    def _beyond(self, path: Path) -> ValueError:
        limits = f"{self.seconds} s of processor time, or {CLOCK * self.seconds} s by the clock"
        return ValueError(f"{path}: {self.name} took more than {limits}; {self.cure}")


def _last_words(output: bytes) -> str:
    """The end of what a program has said, on one line."""
    return " ".join(output.decode("utf-8", errors="replace").split())[-400:]
