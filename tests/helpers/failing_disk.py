"""A disk that fails at the n-th call of the door for output, and takes little at a time."""

import errno
import os

from kinetics.support import output

CALLS = ("open", "chmod", "write", "fsync", "replace")
PIECE = 1000  # bytes that one write takes, so that a file needs several


class FailingDisk:
    """Stands for the module `os` in `kinetics.support.output`; counts calls over all files.

    at : which call fails, from 1; error : its number; calls : the names of all calls so far
    """

    def __init__(self, at, error=errno.ENOSPC):
        self.at, self.error, self.calls = at, error, []

    def __getattr__(self, name):
        real = getattr(os, name)
        if name not in CALLS:
            return real

        def call(*arguments, **options):
            if name == "open" and arguments[1] == os.O_RDONLY:  # of a folder, to sync it: the files are there by then
                return real(*arguments, **options)
            self.calls.append(name)
            if len(self.calls) == self.at:
                raise OSError(self.error, os.strerror(self.error))
            if name == "write":
                arguments = (arguments[0], arguments[1][:PIECE])
            return real(*arguments, **options)

        return call


def fail_at_each_call(monkeypatch, write, error=errno.ENOSPC):
    """Call `write` on a disk that fails at the first call, at the second, ... until none fails.

    Yields each failure, with the disk. The sync of a folder alone may fail in silence: all is in its place by then.
    """
    for at in range(1, 1000):
        disk = FailingDisk(at, error)
        with monkeypatch.context() as patch:
            patch.setattr(output, "os", disk)
            try:
                write()
            except OSError as failure:
                yield failure, disk
            else:
                if len(disk.calls) < at:
                    return
                assert disk.calls[at - 1] == "fsync"
    raise AssertionError("the disk fails for ever")
