"""External programs run on untrusted text: in an empty folder, with a minimal environment and limits."""

from __future__ import annotations

import json
import os
import signal
import sys
import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

# Puts the texts into their files, sets the limits of its own process, then becomes the program. Systems without
# `resource` have the limit of time alone.
LAUNCHER = """
import json, os, sys
from pathlib import Path
for name, text in json.loads(sys.stdin.buffer.read()).items():
    Path(name).write_bytes(text.encode())
try:
    import resource
    seconds, memory = map(int, sys.argv[1:3])
    resource.setrlimit(resource.RLIMIT_CPU, (seconds, seconds + 5))  # a signal of its own, before the last one
    resource.setrlimit(resource.RLIMIT_AS, (memory, memory))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
except ImportError:
    pass
os.execv(sys.argv[3], sys.argv[3:])
"""


CLOCK = 10  # times the limit of processor time, on a busy machine
# What Python and the libraries of its packages are found by; nothing else of the user's environment is passed on.
KEPT = ("PYTHONHOME", "PYTHONPATH", "LD_LIBRARY_PATH", "DYLD_LIBRARY_PATH", "SYSTEMROOT")


@dataclass(frozen=True)
class Program:
    """A program that translates a model.

    name : what messages call it
    command : absolute path and arguments
    seconds : of processor time, and of ten times as much by the clock
    memory : bytes of address space
    cure : what a user does about a model that takes more
    stopped : what it says if it stops before it is done; None if it never does
    """

    name: str
    command: Sequence[str]
    seconds: int
    memory: int
    cure: str
    stopped: bytes | None = None

    def translated(self, path: Path, given: Mapping[str, str], made: str) -> str:
        """The translation of a text, made in an empty folder that is also the program's home.

        path : the user's file, for messages
        given : name -> text of the files that it reads
        made : name of the file that it writes
        """
        import subprocess

        with tempfile.TemporaryDirectory() as folder:
            bare = {"PATH": os.defpath, "LC_ALL": "C", "HOME": folder, "TMPDIR": folder, "PYTHONSAFEPATH": "1"}
            try:
                done = subprocess.run(  # noqa: S603 - of no shell; the arguments are ours
                    [sys.executable, "-P", "-c", LAUNCHER, str(self.seconds), str(self.memory), *self.command],
                    cwd=folder,
                    env=bare | {name: os.environ[name] for name in KEPT if name in os.environ},
                    input=json.dumps(dict(given)).encode(),
                    stdout=subprocess.PIPE,
                    stderr=subprocess.STDOUT,
                    timeout=CLOCK * self.seconds,
                    check=False,
                )
            except subprocess.TimeoutExpired:
                raise self._beyond(path) from None
            if done.returncode == -getattr(signal, "SIGXCPU", 0) != 0:
                raise self._beyond(path)
            if self.stopped is not None and self.stopped in done.stdout:
                raise ValueError(f"{path}: {self.name} stopped before it came to an end; {self.cure}")
            output = Path(folder) / made
            if done.returncode == 0 and output.is_file():
                return output.read_text(encoding="utf-8")
        raise ValueError(f"{path}: {self.name} refused it: {_last_words(done.stdout) or f'code {done.returncode}'}")

    def _beyond(self, path: Path) -> ValueError:
        limits = f"{self.seconds} s of processor time, or {CLOCK * self.seconds} s by the clock"
        return ValueError(f"{path}: {self.name} took more than {limits}; {self.cure}")


def _last_words(output: bytes) -> str:
    """The end of a program's output, on one line."""
    return " ".join(output.decode("utf-8", errors="replace").split())[-400:]
