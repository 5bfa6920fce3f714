"""The one door to files that are written: whole or not at all, and nowhere but at the path asked for.

A file is written under a temporary name beside its target, synced, and renamed. The temporary name is random and is
opened with O_EXCL and O_NOFOLLOW, so that nothing planted beforehand is written through. Where any step fails (a full
or failing disk, a limit, Ctrl-C), what stood at the target is as it was. A process killed with SIGKILL may leave a
`.wellmixed-*.part` behind, which nothing reads. `append_line` alone adds to a file that is there.

Runs have a door of their own, `mechsim.runs.file_locks`, whose writers of one file take turns.
"""

from __future__ import annotations

import contextlib
import os
import re
import shutil
import stat
import tempfile
from collections.abc import Iterator, Mapping
from pathlib import Path

NAME = re.compile(r"[A-Za-z0-9_][A-Za-z0-9._-]*")
LONGEST_NAME = 80  # characters; file systems take 255, and endings are added
ANEW = os.O_WRONLY | os.O_CREAT | os.O_EXCL | getattr(os, "O_NOFOLLOW", 0) | getattr(os, "O_BINARY", 0)
MORE = os.O_RDWR | os.O_APPEND | os.O_CREAT | getattr(os, "O_NOFOLLOW", 0) | getattr(os, "O_BINARY", 0)
KINDS = {stat.S_IFLNK: "a symbolic link", stat.S_IFDIR: "a folder"}


def write_whole(path: str | Path, content: bytes | str) -> Path:
    """Put `content`, text as UTF-8, at `path`; it is on disk before this returns. Returns the path.

    An older file keeps its permissions. ValueError: there is something else than a file. OSError: names the path; what
    stood there stays.
    """
    target = Path(path)
    write_together({target: content})
    return target


def write_together(contents: Mapping[Path, bytes | str]) -> None:
    """Put files that belong together at their paths, in order: none is renamed before all are written and synced."""
    waiting: dict[Path, Path] = {}
    try:
        for path, content in contents.items():
            check_target(path)
            with _named(path):
                waiting[path] = _beside(path, content.encode() if isinstance(content, str) else content)
        for path in list(waiting):
            with _named(path):
                os.replace(waiting[path], path)  # noqa: PTH105 - where tests let it fail
            del waiting[path]
    finally:
        for temporary in waiting.values():
            temporary.unlink(missing_ok=True)
    for folder in {path.parent for path in contents}:
        _sync_folder(folder)


def append_line(path: str | Path, line: str) -> None:
    """Add a line to the file at `path`, made if missing; it is on disk before this returns.

    A process that dies on the way may leave the line torn, so a reader must leave out what is no whole line; the next
    line begins anew behind it. OSError: names the path. ValueError: there is something else than a file.
    """
    target = Path(path)
    check_target(target)
    with _named(target):
        descriptor = os.open(target, MORE, 0o666)
        try:
            size = os.fstat(descriptor).st_size
            is_torn = size > 0 and os.pread(descriptor, 1, size - 1) != b"\n"
            left = memoryview(b"\n" * is_torn + line.encode() + b"\n")
            while left:
                left = left[os.write(descriptor, left) :]
            os.fsync(descriptor)
        finally:
            os.close(descriptor)
        if not size:
            _sync_folder(target.parent)


@contextlib.contextmanager
def scratch_folder(contents: Mapping[str, str]) -> Iterator[Path]:
    """A private folder with these files, name -> text, which is gone after the block; nothing of it is synced."""
    with tempfile.TemporaryDirectory() as folder:
        for name, text in contents.items():
            Path(folder, name).write_bytes(text.encode())
        yield Path(folder)


@contextlib.contextmanager
def new_folder(path: str | Path) -> Iterator[Path]:
    """A folder that takes the name `path` once all that is written into it is there; on failure it is removed.

    ValueError: something of that name is there already, or the folder above is not.
    """
    goal = Path(path)
    if os.path.lexists(goal):
        raise ValueError(f"{goal} already exists; give another name, or remove it")
    if not goal.absolute().parent.is_dir():
        raise ValueError(f"the folder of {goal} does not exist; make it first")
    made = goal.absolute().parent / f".wellmixed-{os.urandom(8).hex()}.part"
    try:
        made.mkdir()
    except OSError as error:  # of the name that was asked for
        raise type(error)(error.errno, f"no folder can be made here, {error.strerror}", str(goal)) from None
    try:
        yield made
        made.rename(goal)
    except BaseException:
        shutil.rmtree(made, ignore_errors=True)
        raise
    _sync_folder(goal.absolute().parent)


def check_target(path: str | Path) -> None:
    """ValueError if a file at `path` would take the place of a link, a folder or a device; PermissionError where
    the file there is protected from writing.
    """
    try:
        mode = Path(path).lstat().st_mode
    except FileNotFoundError:
        return
    if not stat.S_ISREG(mode):
        kind = KINDS.get(stat.S_IFMT(mode), "a device or a pipe")
        raise ValueError(f"{path} is {kind}, which is not written to; give the path of a file")
    if not os.access(path, os.W_OK):
        raise PermissionError(f"{path} is write-protected; name another file, or allow writing")


def checked_name(name: str, what: str) -> str:
    """`name` if it may become part of a file's name, whatever file it was read from; else ValueError.

    what : whose name it is, for the message
    """
    if NAME.fullmatch(name) and len(name) <= LONGEST_NAME:
        return name
    raise ValueError(
        f"{what} {name[:LONGEST_NAME]!r}: it names files, so at most {LONGEST_NAME} letters, digits, dots, - and _ "
        "are expected, the first no dot and no -"
    )


def _beside(path: Path, content: bytes) -> Path:
    """A synced file with this content under a temporary name in the folder of `path`; it is removed on failure."""
    temporary = path.with_name(f".wellmixed-{os.urandom(8).hex()}.part")
    descriptor = os.open(temporary, ANEW, 0o666)  # less the user's mask, as for any new file
    try:
        try:
            with contextlib.suppress(FileNotFoundError):
                os.chmod(temporary, stat.S_IMODE(path.lstat().st_mode))  # noqa: PTH101 - as above
            left = memoryview(content)
            while left:
                left = left[os.write(descriptor, left) :]
            os.fsync(descriptor)
        finally:
            os.close(descriptor)
    except BaseException:
        temporary.unlink(missing_ok=True)
        raise
    return temporary


@contextlib.contextmanager
def _named(path: Path) -> Iterator[None]:
    """An OSError within names `path`, not the temporary file."""
    try:
        yield
    except OSError as error:
        raise OSError(error.errno, f"{error.strerror or error}; could not write", str(path)) from error


def _sync_folder(folder: Path) -> None:
    """Keep the new names through a power failure. Some file systems cannot; the old or the new file is there then."""
    with contextlib.suppress(OSError):
        descriptor = os.open(folder, os.O_RDONLY)
        try:
            os.fsync(descriptor)
        finally:
            os.close(descriptor)
