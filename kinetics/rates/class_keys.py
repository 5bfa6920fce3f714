"""Class rates files told from others, and their keys, which name classes from the particular to the general.

    "join 1 f1 + 2 f1 touching 2"   event, sizes, faces, and how many faces meet
    "join f1 + f1 touching 2"       whatever the sizes
    "join touching 2"               whatever the faces
    "join"                          event alone

Of a break the two last are one, because a bond that breaks is the only one between its parts: "break 1 f1 + 2 f1",
"break f1 + f1", "break".
"""

from __future__ import annotations

import re
from pathlib import Path
from typing import TYPE_CHECKING

from kinetics.support.config import read_toml

if TYPE_CHECKING:
    from kinetics.assembly import RateClass

_KEY = re.compile(r"(join|break)(?: (?:(\d+) )?(?!touching\b)(\w+) \+ (?:(\d+) )?(\w+))?(?: touching ([1-9]\d*))?")


def class_keys(rate_class: RateClass) -> tuple[str, str, str, str]:
    """Keys of a class: with sizes, with faces, with the number of faces that meet, the event alone.

    >>> from kinetics.assembly import RateClass
    >>> from kinetics.rates import class_keys
    >>> class_keys(RateClass("join", (1, 2), ("f1", "f1")))
    ('join 1 f1 + 2 f1 touching 1', 'join f1 + f1 touching 1', 'join touching 1', 'join')
    """
    event, _, faces, touched = rate_class
    meeting = f" touching {touched}" if event == "join" else ""
    return str(rate_class), f"{event} {' + '.join(sorted(faces))}{meeting}", event + meeting, event


def plain_key(key: str) -> str:
    """A key as classes are printed, the smaller side first; ValueError for what is no key."""
    match = _KEY.fullmatch(" ".join(key.split()))
    event, n, first, m, second, touched = (None,) * 6 if match is None else match.groups()
    is_whole = (n is None) == (m is None)
    if event is None or not is_whole or (touched is None and event == "join" and first is not None):
        raise ValueError(
            f"{key!r} is no rate class; expected one as in 'join 1 f1 + 2 f1 touching 1', 'join f1 + f1 touching 1', "
            "'join touching 1' or 'join', and of a break 'break 1 f1 + 2 f1', 'break f1 + f1' or 'break'"
        )
    if event == "break" and touched is not None:
        raise ValueError(f"{key!r}: a bond that breaks is the only one between its parts; leave out 'touching'")
    meeting = "" if touched is None else f" touching {touched}"
    if first is None or second is None:
        return event + meeting
    if n is None or m is None:
        return f"{event} {' + '.join(sorted((first, second)))}{meeting}"
    sides = sorted(((int(n), first), (int(m), second)))
    return f"{event} {' + '.join(f'{size} {face}' for size, face in sides)}{meeting}"


def more_general(key: str) -> tuple[str, ...]:
    """The keys that stand for a plain key where it has no entry, the particular first.

    >>> from kinetics.rates import more_general
    >>> more_general("join 1 f1 + 2 f1 touching 2")
    ('join f1 + f1 touching 2', 'join touching 2', 'join')
    """
    match = _KEY.fullmatch(key)
    if match is None:
        raise ValueError(f"{key!r} is no rate class")
    event, _, first, _, second, touched = match.groups()
    meeting = "" if touched is None else f" touching {touched}"
    faces = [] if first is None else [f"{event} {' + '.join(sorted((first, second)))}{meeting}"]
    return tuple(k for k in dict.fromkeys([*faces, event + meeting, event]) if k != key)


def number_touched(key: str) -> int | None:
    """The number of faces that meet, where a key says it."""
    match = _KEY.fullmatch(key)
    return None if match is None or match[6] is None else int(match[6])


def are_by_class(name_or_path: str | Path) -> bool:
    """Whether this is a file of rates by class.

    >>> from tempfile import TemporaryDirectory
    >>> from kinetics.rates import ClassRates, are_by_class
    >>> with TemporaryDirectory() as folder:
    ...     ClassRates.uniform(join=1e-4).save(f"{folder}/classes.toml")
    ...     print(are_by_class(f"{folder}/classes.toml"), are_by_class("table3"))
    True False
    """
    return _has_table(name_or_path, "classes")


def are_fitted(name_or_path: str | Path) -> bool:
    """Whether this is a file of parameters that were fitted to data.

    >>> from kinetics.rates import are_fitted
    >>> are_fitted("table3")
    False
    """
    return _has_table(name_or_path, "parameters")


def _has_table(name_or_path: str | Path, table: str) -> bool:
    path = Path(name_or_path)
    return path.suffix == ".toml" and path.is_file() and table in read_toml(path)
