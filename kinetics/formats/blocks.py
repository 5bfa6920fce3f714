"""The blocks of a .net file, each line with its number."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

from kinetics.support.limits import MOST_REACTIONS, MOST_SPECIES, check_count, check_names

NEEDED = ("species", "reactions")
READ = ("parameters", "functions", "species", "reactions", "groups")
# What a network was generated from; the blocks above say all of it again.
SKIPPED = (
    "molecule types",
    "observables",
    "reaction rules",
    "compartments",
    "energy patterns",
    "population maps",
    "population types",
)


class Line(NamedTuple):
    """Words of one line, and what stood behind its #."""

    number: int
    words: Sequence[str]
    comment: str


def blocks_of(path: Path, text: str) -> dict[str, list[Line]]:
    """The lines of every block that is read; a ValueError with the line number if the file is damaged."""
    blocks: dict[str, list[Line]] = {}
    inside: str | None = None
    began = 0
    for number, line in enumerate(text.splitlines(), 1):
        content, _, comment = line.partition("#")
        words = content.split()
        if not words:
            continue
        if words[0] == "end":
            if " ".join(words[1:]) not in (inside, "model"):
                raise ValueError(f"{path}, line {number}: {content.strip()!r}, but {_open_block(inside, began)}")
            inside = None
        elif words[0] == "begin":
            name = " ".join(words[1:])
            if name == "model":
                continue
            if inside is not None:
                raise ValueError(f"{path}, line {number}: {content.strip()!r}, but {_open_block(inside, began)}")
            if name not in (*READ, *SKIPPED) or name in blocks:
                fault = "comes twice" if name in blocks else f"is not one of {', '.join((*READ, *SKIPPED))}"
                raise ValueError(f"{path}, line {number}: the block {name!r} {fault}")
            inside, began = name, number
            blocks[name] = []
        elif inside is None:
            _check_outside(path, number, content.strip())
        elif inside in READ:
            blocks[inside].append(Line(number, words, comment))
    if inside is not None:
        raise ValueError(f"{path}: {_open_block(inside, began)}; the file may be truncated")
    missing = [name for name in NEEDED if name not in blocks]
    if missing:
        raise ValueError(f"{path} has no block {missing[0]!r}; is it a .net file of BioNetGen?")
    for name, most in (("species", MOST_SPECIES), ("reactions", MOST_REACTIONS)):
        check_count(path, name, len(blocks[name]), most)
    named = (name for name in ("parameters", "functions", "species") if name in blocks)
    check_names(path, (word for name in named for line in blocks[name] for word in line.words[1:2]))
    return blocks


def _open_block(inside: str | None, began: int) -> str:
    return "no block is open" if inside is None else f"the block {inside!r} of line {began} has no end yet"


def _check_outside(path: Path, number: int, text: str) -> None:
    """ValueError unless a line between blocks is a setting that leaves the network as it is."""
    if re.fullmatch(r'substanceUnits\("Number"\);?|(setOption|version)\(.*\);?', text):
        return
    raise ValueError(f"{path}, line {number}: {text[:80]!r} outside any block is not read; leave it out of the file")
