"""The one door to files that are read, and what they may hold at most.

Beyond a limit a ValueError says what came, and what the limit is. A byte-order mark at the start of a text means
nothing and is skipped. A pipe is read like a file, up to the limit; what has no end or is no file is refused.
"""

from __future__ import annotations

import re
import stat
from collections.abc import Iterable
from pathlib import Path

TEXT_BYTES = 512 * 2**20  # of a text file that is read line by line
XML_BYTES = 64 * 2**20  # of an XML file, which takes some 30 times its size while it is read
RUN_BYTES = 2**32  # of the file of a mechanics run, which is read as a whole
MOST_SPECIES = 10**6
MOST_REACTIONS = 10**7
LONGEST_NAME = 10**5  # characters; a pattern of a large complex has thousands
CHUNK = 2**20  # bytes of a pipe that are read at once
KINDS = {stat.S_IFDIR: "a folder", stat.S_IFCHR: "a terminal or a device", stat.S_IFBLK: "a device"}
# Control characters, marks of direction, and halves of characters: they show a name as what it is not, or move the
# cursor of a terminal. Unicode Technical Report 36, sections 2.10 and 3.
BREAKS = re.compile("[\t\n\r]")  # that a text may have which is no name
HIDDEN = re.compile("[\0-\x1f\x7f-\x9f\u061c\u200e\u200f\u2028-\u202e\u2066-\u2069\ufeff\ud800-\udfff]")


def text_in(path: Path, most: int = TEXT_BYTES) -> str:
    """The text of a file of at most so many bytes, in UTF-8, without a byte-order mark."""
    try:
        return bytes_in(path, most).decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise ValueError(f"{path} is not UTF-8 text: {error}") from None


def bytes_in(path: Path, most: int = TEXT_BYTES) -> bytes:
    """The bytes of a file or pipe, of at most so many. ValueError if there is something else, or more."""
    try:
        info = path.stat()
    except FileNotFoundError:
        raise ValueError(f"{path} does not exist") from None
    if not (stat.S_ISREG(info.st_mode) or stat.S_ISFIFO(info.st_mode)):
        kind = KINDS.get(stat.S_IFMT(info.st_mode), "no file")
        raise ValueError(f"{path} is {kind}; expected a file, or a pipe")
    if info.st_size > most:
        raise ValueError(f"{path} has {info.st_size} bytes; at most {most} are read")
    with path.open("rb") as file:
        parts = [file.read(info.st_size)]  # all of a file, nothing of a pipe
        left = most - len(parts[0])
        while left >= 0 and (part := file.read(CHUNK)):
            parts.append(part)
            left -= len(part)
    if left < 0:
        raise ValueError(f"{path} has more than {most} bytes; at most that many are read")
    return b"".join(parts)


def check_count(path: Path, what: str, count: int, most: int) -> None:
    """A ValueError for more of something than a file may hold."""
    if count > most:
        raise ValueError(f"{path} has {count} {what}; at most {most} are read")


def check_names(path: Path, names: Iterable[str]) -> None:
    """A ValueError for a name that is too long, or holds characters that cannot be seen."""
    for name in names:
        if len(name) > LONGEST_NAME:
            raise ValueError(
                f"{path} has a name of {len(name)} characters, {name[:40]!r}...; at most {LONGEST_NAME} are read"
            )
        check_visible(f"{path} has a name", name)


def check_visible(what: str, text: str) -> None:
    """A ValueError for a text that holds control characters or marks of direction.

    >>> check_visible("a.rxn has a name", "ATP")
    >>> check_visible("a.rxn has a name", "A\\u202eB")
    Traceback (most recent call last):
    ...
    ValueError: a.rxn has a name with the invisible character U+202E, after 'A'; write it without
    """
    found = HIDDEN.search(text)
    if found:
        before = text[: found.start()][-40:]
        raise ValueError(
            f"{what} with the invisible character U+{ord(found[0]):04X}, "
            f"{f'after {before!r}' if before else 'at its start'}; write it without"
        )
