"""A disk that fails at the n-th call of the door for output, and takes little at a time."""

import errno
import os
import stat
from contextlib import contextmanager

from kinetics.support import output

CALLS = ("open", "chmod", "write", "fsync", "replace")


class FailingDisk:
    """Stands for the module `os` in `kinetics.support.output`; counts calls over all files.

    at : which call fails, from 1; error : its number; calls : the names of all calls so far
    piece : bytes that one write takes, so that a file needs several
    """

    def __init__(self, at, error=errno.ENOSPC, piece=1000):
        self.at, self.error, self.piece, self.calls = at, error, piece, []

    def __getattr__(self, name):
        real = getattr(os, name)
        if name not in CALLS:
            return real

        def call(*arguments, **options):
            if _is_of_a_folder(name, arguments):  # its sync comes last, and may fail in silence
                return real(*arguments, **options)
            self.calls.append(name)
            if len(self.calls) == self.at:
                raise OSError(self.error, os.strerror(self.error))
            if name == "write":
                arguments = (arguments[0], arguments[1][: self.piece])
            return real(*arguments, **options)

        return call


def _is_of_a_folder(name, arguments):
    if name == "open":
        return arguments[1] == os.O_RDONLY
    return name == "fsync" and stat.S_ISDIR(os.fstat(arguments[0]).st_mode)


@contextmanager
def fail_here(monkeypatch, disk):
    """Let the door write to this disk."""
    with monkeypatch.context() as patch:
        patch.setattr(output, "os", disk)
        yield disk


def fail_at_each_call(monkeypatch, write, error=errno.ENOSPC):
    """Call `write` on a disk that fails at the first call, at the second, ... until none fails.

    Yields each failure, with the disk.
    """
    for at in range(1, 1000):
        with fail_here(monkeypatch, FailingDisk(at, error)) as disk:
            try:
                write()
            except OSError as failure:
                yield failure, disk
            else:
                assert len(disk.calls) < at
                return
    raise AssertionError("the disk fails for ever")
