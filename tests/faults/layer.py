"""A layer between Python and the disk: it counts the calls that change a folder, notes them, and strikes at one.

It stands in the place of the functions of `os` that the store of runs and the door for output use, in the process that
installs it and in those forked from it, which share one count. So a driver and its workers are struck as one.
"""

from __future__ import annotations

import errno
import io
import json
import mmap
import os
import signal
import struct
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

KILL, HALF, FAIL, DEAD, HANG = "kill", "kill halfway", "fail once", "fail from there on", "hang"


@dataclass(frozen=True)
class Fault:
    """What happens at which call, from 1.

    KILL: kill -9 before it. HALF: half of it (of the bytes of a write), then kill -9. FAIL: this call raises `error`,
    a write after half of its bytes. DEAD: all calls from this one on raise it. HANG: it never returns.
    """

    kind: str
    at: int
    error: int = errno.EIO


class Layer:
    """Counts, notes and strikes, for one folder.

    trace : file of notes outside the folder, one JSON list a line: the call, its paths, the bytes that stand there then
    fault : None: none
    """

    def __init__(self, folder: Path, trace: Path, fault: Fault | None = None) -> None:
        self.folder, self.fault = os.path.realpath(folder), fault
        self.count = mmap.mmap(-1, 8)  # shared with forked processes
        self.notes = os.open(trace, os.O_WRONLY | os.O_CREAT | os.O_APPEND | os.O_TRUNC, 0o600)

    def install(self) -> None:
        """Stand in the way from now on; there is no way back but the end of the process."""
        os.open, os.fdopen, os.write = self._open(os.open), self._fdopen(os.fdopen), self._write(os.write)
        os.fsync, os.rename, os.replace = self._fsync(os.fsync), self._rename(os.rename), self._rename(os.replace)
        os.mkdir, os.rmdir, os.unlink = map(self._on_path, ("mkdir", "rmdir", "unlink"))

    def note(self, *event: str) -> None:
        """A line of the trace; whole, also beside those of other processes."""
        REAL_WRITE(self.notes, (json.dumps(event) + "\n").encode())

    def call(self, name: str, do: Callable[[], Any], half: Callable[[], Any] | None = None) -> Any:
        """One call that changes the folder."""
        (before,) = struct.unpack("q", self.count[:8])
        self.count[:8] = struct.pack("q", before + 1)
        self.note("call", name, str(os.getpid()))
        fault, at = self.fault, before + 1
        if fault is not None and (at == fault.at or (at > fault.at and fault.kind == DEAD)):
            if half is not None and fault.kind in (HALF, FAIL):
                half()
            if fault.kind in (KILL, HALF):
                os.kill(os.getpid(), signal.SIGKILL)
            if fault.kind == HANG:
                time.sleep(3600)
            raise OSError(fault.error, os.strerror(fault.error))
        return do()

    def covers(self, path: str) -> bool:
        """Is it in the folder?"""
        return path == self.folder or path.startswith(self.folder + os.sep)

    def wrote(self, descriptor: int) -> None:
        """Note what a file holds now."""
        path = name_of(descriptor)
        if Path(path).exists():
            self.note("content", path, Path(path).read_bytes().hex())

    def _open(self, real: Callable[..., int]) -> Callable[..., int]:
        def opened(path: Any, flags: int, *rest: Any, **options: Any) -> int:
            name = _full(path, options)
            if not flags & os.O_CREAT or not self.covers(name):
                return real(path, flags, *rest, **options)
            is_new = not os.path.lexists(name)
            descriptor = self.call("open", lambda: real(path, flags, *rest, **options))
            if is_new:
                self.note("create", name)
            return descriptor

        return opened

    def _fdopen(self, real: Callable[..., Any]) -> Callable[..., Any]:
        layer = self

        class Raw(io.FileIO):
            def write(self, data: Any) -> int:
                raw, content = super(), bytes(data)
                written = layer.call(
                    "write", lambda: raw.write(content), lambda: raw.write(content[: len(content) // 2])
                )
                layer.wrote(self.fileno())
                return written

            def truncate(self, size: int | None = None) -> int:
                raw = super()
                length = layer.call("truncate", lambda: raw.truncate(size))
                layer.wrote(self.fileno())
                return length

        def opened(descriptor: int, mode: str = "r", *rest: Any, **options: Any) -> Any:
            if mode != "a+b" or not self.covers(name_of(descriptor)):
                return real(descriptor, mode, *rest, **options)
            return io.BufferedRandom(Raw(descriptor, "ab+"))

        return opened

    def _write(self, real: Callable[..., int]) -> Callable[..., int]:
        def write(descriptor: int, data: Any) -> int:
            if not self.covers(name_of(descriptor)):
                return real(descriptor, data)
            content = bytes(data)
            half = content[: len(content) // 2]
            content = half if len(content) > LITTLE else content
            written = self.call("write", lambda: real(descriptor, content), lambda: real(descriptor, half))
            self.wrote(descriptor)
            return written

        return write

    def _fsync(self, real: Callable[..., None]) -> Callable[..., None]:
        def fsync(descriptor: Any) -> None:
            name = name_of(descriptor if isinstance(descriptor, int) else descriptor.fileno())
            if not self.covers(name):
                return real(descriptor)
            self.call("fsync", lambda: real(descriptor))
            return self.note("sync", name)

        return fsync

    def _on_path(self, name: str) -> Callable[..., None]:
        real = getattr(os, name)

        def change(path: Any, *rest: Any, **options: Any) -> None:
            full = _full(path, options)
            if not self.covers(full) or os.path.lexists(full) == (name == "mkdir"):  # nothing will change
                return real(path, *rest, **options)
            self.call(name, lambda: real(path, *rest, **options))
            return self.note(name, full)

        return change

    def _rename(self, real: Callable[..., None]) -> Callable[..., None]:
        def rename(old: Any, new: Any, **options: Any) -> None:
            names = os.path.abspath(old), os.path.abspath(new)  # noqa: PTH100 - as the caller wrote it
            if not self.covers(names[0]):
                return real(old, new, **options)
            self.call("rename", lambda: real(old, new, **options))
            return self.note("rename", *names)

        return rename


REAL_WRITE = os.write
LITTLE = 1000  # bytes; of more, a disk may take a part at a time


def name_of(descriptor: int) -> str:
    """The path that an open file has now."""
    try:
        return os.readlink(f"/proc/self/fd/{descriptor}")  # noqa: PTH115
    except OSError:
        return ""


def read_trace(trace: Path) -> list[list[str]]:
    """All notes, in order; a last line that was cut off is none."""
    lines = trace.read_text(encoding="utf-8").split("\n")
    return [json.loads(line) for line in lines[:-1]]


def _full(path: Any, options: dict[str, Any]) -> str:
    above = name_of(options["dir_fd"]) if options.get("dir_fd") is not None else ""
    return os.path.abspath(os.path.join(above, os.fspath(path)))  # noqa: PTH100, PTH118
