"""Networks of rule books that took long to derive, kept in the user's cache: derived once, not once a command.

A file is named by the book's fingerprint and holds, as JSON, what `derive` found, with the hash of the sources that
derived it and a checksum. What is cut, altered, of other sources or of another user is derived and written anew;
without a folder that can be written, all works as well. Files are replaced whole, so that processes may share them and
a folder may be removed at any time.

WELLMIXED_CACHE names another folder, or turns this off by `off`. A folder that others may write to can be trusted no
more than they can: a checksum shows damage, not intent.
"""

from __future__ import annotations

import contextlib
import functools
import hashlib
import json
import math
import os
import stat
import sys
import time
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

from kinetics.assembly.deriving.derive import Derivation, derive
from kinetics.assembly.deriving.explore import StructureEvent
from kinetics.assembly.deriving.ways import RateClass
from kinetics.assembly.rules.rule_book import RuleBook
from kinetics.assembly.structure import Structure
from kinetics.support.limits import bytes_in
from kinetics.support.output import write_whole

FOLDER = "WELLMIXED_CACHE"
OFF = "off"
WORTH = 0.05  # seconds of deriving; a network that takes less is derived as quickly as read
MOST_BYTES = 2**26  # of a file
KEPT = 64  # files
FORMAT = 1


def derive_cached(book: RuleBook, progress: Callable[[int, int], None] | None = None) -> Derivation:
    """The network of a rule book as `derive` gives it under the usual caps, from the user's cache if it is there.

    Errors are those of `derive`; none comes of the cache.

    >>> from kinetics.assembly import RuleBook
    >>> from kinetics.assembly.deriving.cached import derive_cached
    >>> list(derive_cached(RuleBook.load("line4")).structures)
    ['monomer', 'dimer', 'trimer', 'quadmer']
    """
    path = _path_of(book)
    found = None if path is None else _read(path, book)
    if found is not None:
        return found
    began = time.thread_time()
    made = derive(book, progress=progress)
    if path is not None and time.thread_time() - began >= WORTH:
        _keep(path, made)
    return made


def cache_folder() -> Path | None:
    """The folder of networks in the user's cache, which need not exist; None if there is to be none."""
    stated = os.environ.get(FOLDER, "")
    if stated == OFF:
        return None
    if stated:
        return Path(stated) / "networks"
    try:
        home = Path.home()
    except RuntimeError:  # a user without a home
        return None
    if sys.platform == "darwin":
        base = home / "Library" / "Caches"
    elif sys.platform == "win32":
        base = Path(os.environ.get("LOCALAPPDATA") or home / "AppData" / "Local")
    else:  # XDG Base Directory Specification 0.8: a relative path is none
        base = Path(os.environ.get("XDG_CACHE_HOME", ""))
        base = base if base.is_absolute() else home / ".cache"
    return base / "wellmixed" / "networks"


@functools.cache
def sources_hash() -> str | None:
    """A hash of the sources that derive; None if there are none to read, as in a package of byte code."""
    home = Path(__file__).parents[1]
    seen = hashlib.sha256(f"{FORMAT}".encode())
    try:
        files = [path for folder in (home, home / "deriving", home / "rules") for path in sorted(folder.glob("*.py"))]
        for path in files:
            text = bytes_in(path)
            seen.update(f"\n{path.name} {len(text)}\n".encode() + text)
    except (OSError, ValueError):  # ValueError: one of them is gone
        return None
    return seen.hexdigest() if files else None


def _path_of(book: RuleBook) -> Path | None:
    folder = cache_folder()
    return None if folder is None else folder / f"{book.fingerprint}.json"


def _keep(path: Path, made: Derivation) -> None:
    """Write a derivation; it is only the faster for it, so that no failure matters."""
    sources = sources_hash()
    if sources is None or not made.is_closed:
        return
    body = json.dumps(_content(made), separators=(",", ":"))
    head = {"sources": sources, "book": made.book.fingerprint, "sha256": hashlib.sha256(body.encode()).hexdigest()}
    with contextlib.suppress(OSError, ValueError):  # ValueError: something else than a file is there
        path.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
        write_whole(path, f"{json.dumps(head)}\n{body}\n")
        _remove_old(path.parent)


def _remove_old(folder: Path) -> None:
    """Remove all files but the last `KEPT`."""
    made = {path: path.stat().st_mtime for path in folder.glob("*.json")}
    for path in sorted(made, key=made.__getitem__)[: max(0, len(made) - KEPT)]:
        path.unlink(missing_ok=True)


def _read(path: Path, book: RuleBook) -> Derivation | None:
    """The derivation in a file, or None if the file is not whole, ours, and of these sources."""
    try:
        info = path.lstat()  # a link or a pipe is not followed
        if not stat.S_ISREG(info.st_mode) or (hasattr(os, "geteuid") and info.st_uid != os.geteuid()):
            return None
        head, body = bytes_in(path, MOST_BYTES).removesuffix(b"\n").split(b"\n")
        said = json.loads(head)
        expected = {"sources": sources_hash(), "book": book.fingerprint, "sha256": hashlib.sha256(body).hexdigest()}
        return _derivation(book, json.loads(body)) if said == expected else None
    except (OSError, ValueError, TypeError, KeyError, IndexError, AttributeError, RecursionError):
        return None


def _content(made: Derivation) -> dict[str, Any]:
    """What a file holds of a derivation, in plain lists; numbers of ways keep all their digits."""
    classes = {each: k for k, each in enumerate(made.rate_classes)}
    return {
        "structures": [[name, s.positions, s.rotations, s.letters] for name, s in made.structures.items()],
        "classes": list(classes),
        "events": [[*event, [[classes[each], n] for each, n in ways.items()]] for event, ways in made.events.items()],
        "fired": sorted(made.book.fired),
    }


def _derivation(book: RuleBook, content: dict[str, Any]) -> Derivation:
    """The derivation of `_content`; a ValueError if it is of no such book."""
    structures = {
        str(name): Structure(tuple(map(_whole, positions)), _whole(rotations), tuple(map(str, letters)))
        for name, positions, rotations, letters in content["structures"]
    }
    classes = [
        RateClass(str(event), _whole(sizes), (str(faces[0]), str(faces[1])), int(touched))
        for event, sizes, faces, touched in content["classes"]
    ]
    events = {
        StructureEvent(_whole(before), _whole(after)): {classes[_whole([k])[0]]: float(n) for k, n in ways}
        for before, after, ways in content["events"]
    }
    letters = {letter for each in structures.values() for letter in each.letters}
    places = {place for event in events for side in event for place in side}
    counts = [n for ways in events.values() for n in ways.values()]
    is_sound = (
        len(structures) == len(content["structures"])
        and len(events) == len(content["events"])
        and letters <= set(book.letters)
        and places <= set(range(len(structures)))
        and all(math.isfinite(n) and n > 0 for n in counts)
    )
    if not is_sound:
        raise ValueError("a network that this book cannot have")
    book.fired.update(map(str, content["fired"]))
    return Derivation(book, structures, events)


def _whole(numbers: Iterable[Any]) -> tuple[Any, ...]:
    """A tuple of whole numbers, and of nothing else."""
    found = tuple(numbers)
    if not all(type(number) is int for number in found):
        raise ValueError("a number that is not whole")
    return found
