"""Files that several processes write: whole or not at all, one writer after the other, by locks that die with them."""

from __future__ import annotations

import errno
import fcntl
import os
from pathlib import Path
from typing import BinaryIO

SHARED = os.O_RDWR | os.O_APPEND | os.O_CREAT | os.O_NOFOLLOW  # how a file is opened for a lock


def write_locked(path: Path, data: bytes) -> None:
    """Put `data` at `path`, whole or not at all, and on disk before this returns.

    OSError names the file, or its folder; what stood there stays. Not the door of other files,
    `kinetics.support.output`: here the temporary file has a fixed name and is locked, so that writers of one file take
    turns, and the next one takes over what a killed one left. A link at that name is not followed.
    """
    temporary = path.with_name(f".{path.name}.tmp")
    try:
        with lock(temporary, fcntl.LOCK_EX) as file:
            try:
                file.truncate(0)
                file.write(data)
                file.flush()
                os.fsync(file.fileno())
                file.seek(0)
                if file.read() != data:  # some full or failing disks do not say so
                    raise OSError(errno.EIO, "the bytes written do not read back")
                temporary.replace(path)
            finally:
                if is_open(temporary, file):
                    temporary.unlink()
    except OSError as error:
        raise OSError(error.errno, f"{error.strerror}; could not write", str(path)) from error
    sync_folder(path.parent)


def set_aside(path: Path, file: BinaryIO, aside: Path) -> None:
    """Rename the file at `path`, open here, unless another process has done so and written it anew."""
    if is_open(path, file):
        path.replace(aside)


def sync_folder(folder: Path) -> None:
    """Put the names in a folder on disk. OSError names the folder."""
    try:
        descriptor = os.open(folder, os.O_RDONLY)
        try:
            os.fsync(descriptor)
        finally:
            os.close(descriptor)
    except OSError as error:
        raise OSError(error.errno, f"{error.strerror}; could not write", str(folder)) from error


def lock(path: Path, kind: int) -> BinaryIO:
    """The file at `path`, made if missing, open under a lock that dies with its holder (flock)."""
    while True:
        file = os.fdopen(os.open(path, SHARED, 0o666), "a+b")
        try:
            if os.fstat(file.fileno()).st_nlink > 1:
                raise OSError(errno.EMLINK, "it has another name, under which it would be overwritten")
            fcntl.flock(file, kind)
        except OSError as error:
            file.close()
            raise OSError(error.errno, error.strerror, str(path)) from None
        if is_open(path, file):
            return file
        file.close()  # its last holder renamed or removed it while we waited


def is_open(path: Path, file: BinaryIO) -> bool:
    """Is the file at `path` the one that is open here?"""
    try:
        return os.path.samestat(path.stat(), os.fstat(file.fileno()))
    except FileNotFoundError:
        return False
