"""The certificate of a compiled book, checked by means of its own: no code is shared with the compiler.

The book is explored by the checker of books; that fewer letters do not do is searched again (`book_search`); and that
weaker senses do not do follows from pairs of situations: in one, two cubes must bond, in the other they must not, and
whatever the letters are, they read the same in both.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from itertools import islice, product
from typing import Any, NamedTuple

from kinetics.assembly.checking.book_search import BookSearch, Join, PieceEvent, Pieces
from kinetics.assembly.checking.checker import check
from kinetics.assembly.deriving.derive import derive
from kinetics.assembly.rules.conditions import Senses
from kinetics.assembly.rules.rule_book import RuleBook
from kinetics.assembly.structure import Structure

STEPS = 1_000_000
MOST_CASES = 4096  # choices among pairs of joins of which one must be left out


class CheckedClaim(NamedTuple):
    """One claim; holds: None if it was not decided."""

    claim: str
    holds: bool | None

    def __str__(self) -> str:
        """For people."""
        return f"{ {True: 'holds', False: 'FALSE', None: 'not decided'}[self.holds] }: {self.claim}"


def certified(book: RuleBook, certificate: Mapping[str, Any], most_steps: int = STEPS) -> list[CheckedClaim]:
    """What is true of a certificate as `wellmixed rules compile --certificate` writes it.

    most_steps : of each search for a book of so many letters, some 20,000 a second
    ValueError if the certificate is not of this kind of book.
    """
    if book.target is None or book.seed_letter is not None:
        raise ValueError(f"book {book.name!r} names no target, or grows from a seed; such books have no certificate")
    try:
        return list(_claims(book, book.target, certificate, most_steps))
    except (KeyError, IndexError, TypeError, ValueError) as error:
        raise ValueError(
            f"the certificate lacks or garbles an entry ({type(error).__name__}: {error}); write it by rules compile"
        ) from None


def _claims(book: RuleBook, target: Structure, said: Mapping[str, Any], most_steps: int) -> Iterator[CheckedClaim]:
    """One claim after another."""
    letters, breaks = said["letters"], book.semantics.bonds == "break"

    def none(n: int, pieces: Pieces, joins: set[Join] | None, text: str) -> CheckedClaim:
        search = BookSearch(pieces, breaks, n, joins)
        found = search.finds_one(most_steps)
        holds = None if found is None else not found
        return CheckedClaim(f"no book of {n} letters{text} ({search.steps} answers tried)", holds)

    yield CheckedClaim("the certificate is of this book", said["fingerprint"] == book.fingerprint)
    yield CheckedClaim(f"the book has {letters} letters", letters == len(book.letters))
    correct = check(book).is_correct
    yield CheckedClaim("the book makes the target and parts of it, and every cube can still end in the target", correct)
    if not correct:
        return
    pieces, derived = Pieces(target, book.senses), derive(book)
    number = [pieces.placed(structure)[0] for structure in derived.structures.values()]
    made = {(*sorted(number[n] for n in a), number[c]) for a, (c, *_) in derived.events if len(a) == 2}
    yield CheckedClaim(f"the book makes {len(said['joins'])} joins", len(said["joins"]) == len(made))
    joins, text = (None, ", whatever its joins") if said["any_joins"] else (made, ", with the same joins")
    tried = {each["letters"] for each in said["exhausted"]}
    if said["is_fewest"]:
        yield CheckedClaim("all fewer letters were tried", tried.issuperset(range(1, letters)))
    yield from (none(n, pieces, joins, text) for n in sorted(tried))  # type: ignore[arg-type]
    for each in said["weaker_senses"] if joins is None else ():
        senses, turnings = Senses(**each["senses"]), each["situations"]
        text = " with " + ", ".join(f"{name} = {value}" for name, value in senses.as_dict().items())
        if not turnings:
            yield CheckedClaim(f"no book{text}: no reason is given", None)
        for turned in turnings:
            whole, pairs = _structure(turned["whole"]), turned["pairs"]
            pieces, most = Pieces(whole, senses), max([n["letters"] for n in each["exhausted"]], default=0)
            if {*whole.positions} != {*target.positions}:
                yield CheckedClaim(f"the target{text} is that of the book", False)
            elif pairs or not most:
                holds = _impossible(pieces, breaks, pairs)
                yield CheckedClaim(f"no book{text}, whatever its letters ({len(pairs)} pairs of situations)", holds)
            else:
                yield from (none(n, pieces, None, text) for n in range(1, most + 1))


def _structure(cubes: Sequence[Sequence[int]]) -> Structure:
    """A structure of (x, y, z, rotation)."""
    places = tuple((int(x), int(y), int(z)) for x, y, z, _ in cubes)
    return Structure(places, tuple(int(cube[3]) for cube in cubes), tuple(map(str, range(len(places)))))


def _impossible(pieces: Pieces, breaks: bool, pairs: Iterable[Mapping[str, Any]]) -> bool | None:
    """Whether every way to the target needs joins that cubes cannot distinguish from forbidden meetings."""

    def named(cubes: Sequence[Sequence[int]]) -> Structure:
        side = _structure(cubes)
        piece, order = pieces.placed(side)
        if piece < 0:
            raise ValueError(f"{side} is no part of the target")
        names = dict(zip(order, pieces.shapes[piece].letters, strict=True))
        return side.with_letters([names[letter] for letter in side.letters])

    def docked(meeting: Mapping[str, Any]) -> PieceEvent:
        (one, two), (i, j) = map(named, meeting["parts"]), meeting["docking"]
        return pieces.docking(one, i, two, j)

    apart: set[frozenset[Join]] = set()
    for pair in pairs:
        musts, other = [docked(must) for must in pair["must"]], docked(pair["must_not"])
        (first, second), (one, two) = other.readings, [must.readings for must in musts]
        alike = (first in one and second in two) or (second in one and first in two)
        if other.after[0][0] >= 0 or any(must.after[0][0] < 0 for must in musts) or not alike:
            return False
        apart.add(frozenset((*must.before, must.after[0][0]) for must in musts))  # type: ignore[misc]
    cases = list(islice(product(*apart), MOST_CASES + 1))  # of every set of joins, at least one is left out
    return None if len(cases) > MOST_CASES or any(pieces.can_make_target(case, breaks) for case in cases) else True
