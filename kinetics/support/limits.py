"""What files from outside may hold at most; beyond it a ValueError says what came, and what the limit is."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

TEXT_BYTES = 512 * 2**20  # of a text file that is read line by line
XML_BYTES = 64 * 2**20  # of an XML file, which takes some 30 times its size while it is read
MOST_SPECIES = 10**6
MOST_REACTIONS = 10**7
LONGEST_NAME = 10**5  # characters; a pattern of a large complex has thousands


def text_in(path: Path, most: int = TEXT_BYTES) -> str:
    """The text of a file of at most so many bytes, in UTF-8."""
    check_size(path, most)
    try:
        return path.read_text(encoding="utf-8")
    except UnicodeDecodeError as error:
        raise ValueError(f"{path} is not UTF-8 text: {error}") from None


def check_size(path: Path, most: int) -> None:
    """A ValueError for a file of more bytes."""
    size = path.stat().st_size
    if size > most:
        raise ValueError(f"{path} has {size} bytes; at most {most} are read")


def check_count(path: Path, what: str, count: int, most: int) -> None:
    """A ValueError for more of something than a file may hold."""
    if count > most:
        raise ValueError(f"{path} has {count} {what}; at most {most} are read")


def check_names(path: Path, names: Iterable[str]) -> None:
    """A ValueError for a name that is too long."""
    longest = max(names, key=len, default="")
    if len(longest) > LONGEST_NAME:
        raise ValueError(
            f"{path} has a name of {len(longest)} characters, {longest[:40]!r}...; at most {LONGEST_NAME} are read"
        )
