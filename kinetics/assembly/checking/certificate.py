"""The certificate of a compiled book, checked by means of its own: no code is shared with the compiler.

The book is explored by the checker of books; that fewer letters do not do is searched again (`book_search`); and that
weaker senses do not do follows from pairs of situations: in one, two cubes must bond, in the other they must not, and
whatever the letters are, they read the same in both.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from itertools import islice, product
from typing import Any, NamedTuple

from kinetics.assembly.checking.book_search import STEPS, BookSearch, Made, StepsError
from kinetics.assembly.checking.checker import check
from kinetics.assembly.deriving.derive import derive
from kinetics.assembly.faces import roll, scheme_of
from kinetics.assembly.rules.conditions import Senses
from kinetics.assembly.rules.rule_book import RuleBook
from kinetics.assembly.structure import Structure

MOST_CASES = 4096  # choices among pairs of joins of which one must be left out


class CheckedClaim(NamedTuple):
    """One claim; holds: None where it was not decided."""

    claim: str
    holds: bool | None

    def __str__(self) -> str:
        """For people."""
        return f"{ {True: 'holds', False: 'FALSE', None: 'not decided'}[self.holds] }: {self.claim}"


def certified(book: RuleBook, certificate: Mapping[str, Any], most_steps: int = STEPS) -> list[CheckedClaim]:
    """What is true of a certificate as `wellmixed rules compile --certificate` writes it.

    most_steps : of each search for a book with fewer letters; a few thousand a second
    ValueError where the certificate is not of this kind of book.
    """
    target = book.target
    if target is None or book.seed_letter is not None:
        raise ValueError(f"book {book.name!r} names no target, or grows from a seed; such books have no certificate")
    try:
        return list(_claims(book, target, certificate, most_steps))
    except (KeyError, IndexError, TypeError, ValueError) as error:
        raise ValueError(
            f"the certificate lacks or garbles an entry ({type(error).__name__}: {error}); write it by rules compile"
        ) from None


def _claims(
    book: RuleBook, target: Structure, certificate: Mapping[str, Any], most_steps: int
) -> Iterator[CheckedClaim]:
    """One claim after another."""
    letters, any_joins = certificate["letters"], certificate["any_joins"]
    yield CheckedClaim("the certificate is of this book", certificate["fingerprint"] == book.fingerprint)
    yield CheckedClaim(f"the book has {letters} letters", letters == len(book.letters))
    correct = check(book).is_correct
    yield CheckedClaim("the book makes the target and parts of it, and every cube can come home", correct)
    joins = None if any_joins else _joins_of(book)
    said = "whatever its joins" if any_joins else "with the same joins"
    for fewer in range(1, letters) if certificate["is_fewest"] else ():
        found, steps = _search(target, book.senses, book, fewer, joins, most_steps)
        yield CheckedClaim(f"no book of its kind has {fewer} letters, {said} ({steps} answers tried)", found)
    for each in certificate["weaker_senses"] if any_joins else ():
        senses = Senses(**each["senses"])
        named = ", ".join(f"{name} = {value}" for name, value in senses.model_dump().items())
        tried = [entry["letters"] for entry in each["exhausted"]]
        if not each["situations"]:
            yield CheckedClaim(f"no book with {named}: no reason is given", None)
        for turned in each["situations"]:
            whole, pairs = _structure(turned["whole"]), turned["pairs"]
            if {*whole.positions} != {*target.positions}:
                yield CheckedClaim(f"with {named}, the target is that of the book", False)
            elif pairs or not tried:
                text = f"no book with {named}, whatever its letters ({len(pairs)} pairs of situations)"
                yield CheckedClaim(text, _impossible(book, whole, senses, pairs))
            else:
                for n in range(1, max(tried) + 1):
                    found, steps = _search(whole, senses, book, n, None, most_steps)
                    yield CheckedClaim(f"no book of {n} letters with {named} ({steps} answers tried)", found)


def _search(
    whole: Structure, senses: Senses, book: RuleBook, letters: int, joins: frozenset[Made] | None, most_steps: int
) -> tuple[bool | None, int]:
    """Whether no book has so many letters, and how many answers were tried."""
    search = BookSearch(whole, senses, book.semantics.bonds == "break", letters, joins=joins, most_steps=most_steps)
    try:
        return search.search().rules is None, search.steps
    except StepsError:
        return None, search.steps


def _bare(structure: Structure, scheme: str) -> Structure:
    return structure.with_letters(("#",) * len(structure)).canonical(scheme)


def _joins_of(book: RuleBook) -> frozenset[Made]:
    """The joins of a book, by shapes."""
    derived = derive(book)
    shapes = [_bare(structure, book.scheme) for structure in derived.structures.values()]
    return frozenset(
        (*_sorted(shapes[before[0]], shapes[before[1]]), shapes[after[0]])
        for before, after in derived.events
        if len(before) == 2
    )


def _sorted(a: Structure, b: Structure) -> tuple[Structure, Structure]:
    one, two = sorted((a, b), key=repr)
    return one, two


def _structure(cubes: Sequence[Sequence[int]]) -> Structure:
    """A structure of (x, y, z, rotation)."""
    places = tuple((int(x), int(y), int(z)) for x, y, z, _ in cubes)
    return Structure(places, tuple(int(cube[3]) for cube in cubes), ("#",) * len(places))


def _impossible(book: RuleBook, whole: Structure, senses: Senses, pairs: Iterable[Mapping[str, Any]]) -> bool | None:
    """Whether the target cannot be made of joins that cubes can tell from meetings that must not bond."""
    search = BookSearch(whole, senses, book.semantics.bonds == "break", 1)
    apart: set[frozenset[Made]] = set()
    for pair in pairs:
        musts = [_Docked(must, senses) for must in pair["must"]]
        other = _Docked(pair["must_not"], senses)
        for docked in (*musts, other):
            if not {docked.join[0], docked.join[1]} <= search.pieces:
                return False
        if other.join[2] in search.pieces or any(must.join[2] not in search.pieces for must in musts):
            return False
        first, second = other.readings
        if not (
            (first in musts[0].readings and second in musts[1].readings)
            or (second in musts[0].readings and first in musts[1].readings)
        ):
            return False
        apart.add(frozenset(must.join for must in musts))
    cases = list(islice(product(*apart), MOST_CASES + 1))
    if len(cases) > MOST_CASES:
        return None
    for left_out in cases:  # of every set of joins, at least one
        search.opened = dict.fromkeys(left_out, (False, 0))
        if search.is_hopeful():
            return None
    return True


class _Docked:
    """Two parts that dock.

    join : their shapes, and that of what they would make
    readings : of the two cubes, with names for letters that tell the part and the place in it, up to symmetry
    """

    def __init__(self, meeting: Mapping[str, Any], senses: Senses):
        a, b = map(_structure, meeting["parts"])
        i, j = meeting["docking"]
        scheme = senses.faces
        self.join: Made = (*_sorted(_bare(a, scheme), _bare(b, scheme)), _bare(a.joined(b), scheme))
        names = [_names(part, scheme) for part in (a, b)]
        self.readings = [
            self._reading(a, i, names[0], b, j, names[1], senses),
            self._reading(b, j, names[1], a, i, names[0], senses),
        ]

    @staticmethod
    def _reading(
        own: Structure,
        cube: int,
        names: list[object],
        other: Structure,
        partner: int,
        theirs: list[object],
        senses: Senses,
    ) -> tuple[object, ...]:
        types = scheme_of(senses.faces).types
        face = own.face_towards(cube, other.positions[partner])
        behind = own.cube_at(own.faced(cube, face ^ 1)) if senses.across else None
        return (
            names[cube],
            types[face],
            sorted((names[n] for n in own.neighbours(cube)), key=repr),
            None if behind is None else names[behind],
            theirs[partner],
            types[other.face_towards(partner, own.positions[cube])],
            roll(senses.faces, own.rotations[cube], face, other.rotations[partner]) if senses.roll else "",
            sorted((theirs[n] for n in other.touching(own.positions[cube])), key=repr) if senses.touched else (),
        )


def _names(part: Structure, scheme: str) -> list[object]:
    """For each cube its part and the place in it; one name for places that symmetry exchanges."""
    shape = _bare(part, scheme)
    images = [[shape.places[turn.of(place)] for place in shape.positions] for turn in shape.symmetries(scheme)]
    return [(shape, min(image[number] for image in images)) for number in part.canonical_cubes(scheme)]
