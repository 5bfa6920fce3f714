"""Faults planted into books that are right by how they are made: which finding each must give is known beforehand."""

from dataclasses import replace

import numpy as np

from kinetics.assembly.rules.conditions import Combination, Dissociation, Internal
from tests.helpers.tree_books import FREE, face_types, gap_of, pairs_book, tree_book

SIX = tuple(face_types(n) for n in range(6))


def planted(fault, seed):
    """A book that is right, and the same book with a fault."""
    rng = np.random.default_rng([seed, sorted(FAULTS).index(fault)])
    sound = BASES.get(fault, _any_tree)(int(rng.integers(1 << 30)), rng)
    return sound, replace(FAULTS[fault][1](sound, rng), name=f"{fault} {seed}")


def endless_pairing(book, rng):
    """A cube that loses a bond becomes x, which pairs with a free cube and lets it go again, for ever."""
    return _with(
        book,
        combine=_bond("pair", "x", _some(SIX, rng), "x", FREE, _some(SIX, rng), "y", neighbours=[]),
        dissociate=[
            Dissociation(rule="let go", letter="x", becomes="x"),
            Dissociation(rule="go", letter="y", becomes=FREE),
            Dissociation(rule="fall", letter=_losing(book, rng), becomes="x"),
        ],
    )


def closed_circle(book, rng):
    """Lone cubes become x, which pairs with its like alone: as y and y, and falls apart into x and x again."""
    face = _some(SIX, rng)
    return _with(
        book,
        combine=[Combination(rule="pair", letter="x", face=face, partner="x", partner_face=face, becomes="y")],
        dissociate=[
            Dissociation(rule="part", letter="y", becomes="x"),
            Dissociation(rule="fall", letter=_losing(book, rng), neighbours=[], becomes="x"),
        ],
    )


def dead_end(book, rng):
    """A lone cube becomes x, which nothing bonds to."""
    return _with(book, dissociate=[Dissociation(rule="fall", letter=_losing(book, rng), neighbours=[], becomes="x")])


def off_target(book, rng):
    """A free cube bonds to a face where the target has no cube; it goes again."""
    cube = int(rng.integers(len(book.target)))
    covered = {book.target.face_towards(cube, book.target.positions[n]) for n in book.target.neighbours(cube)}
    face = SIX[_some([n for n in range(6) if n not in covered], rng)]
    letter = book.target.letters[cube]
    return _with(
        book,
        combine=_bond("astray", FREE, _some(SIX, rng), "x", letter, face, letter),
        dissociate=[Dissociation(rule="back", letter="x", becomes=FREE)],
    )


def restless(book, rng):
    """Beside a certain neighbour a letter changes in a circle of two or three, for ever."""
    one, other = _some(book.target.bonds, rng)
    letter, neighbour = book.target.letters[one], book.target.letters[other]
    circle = (letter, "x", "y")[: int(rng.integers(2, 4))]
    return _with(
        book,
        internal=[
            Internal(rule=f"turn {n}", letter=now, has=neighbour, becomes=circle[(n + 1) % len(circle)])
            for n, now in enumerate(circle)
        ],
    )


def squeezed(book, rng):
    """A free cube bonds where it comes to lie between two opposite cubes."""
    gap, host = gap_of(book.target.positions)
    letter, face = book.target.letters[host], SIX[book.target.face_towards(host, gap)]
    return _with(book, combine=_bond("in between", FREE, _some(SIX, rng), "x", letter, face, letter))


def holding(book, rng):
    """Bonds hold: two halves of the target each wait for what the other has."""
    return replace(book, semantics=book.semantics.replace(bonds="hold"))


def never_free(book, rng):
    """A cube of the first pair becomes x once alone, and x is good for its old place only: two of them are too many."""
    first, second, *rest = book.combine
    again = (
        first.replace(letter=(*first.letter, "x")),
        second.replace(partner=(*second.partner, "x")),
    )
    changed = _with(book, dissociate=[Dissociation(rule="fall", letter="0", neighbours=[], becomes="x")])
    return replace(changed, combine=(*again, *rest))


def remainder(book, rng):
    """The target is what a break leaves of a larger structure, so its own cubes are too few to make it: for certain."""
    last = 3 if rng.random() < 0.5 else 0
    kept = [n for n in range(4) if n != last]
    return replace(book, target=book.target.part(kept))


def _tree(low, high, **options):
    return lambda seed, rng: tree_book(seed, int(rng.integers(low, high + 1)), **options)


def _any_tree(seed, rng):
    """A tree of three or four cubes, with a seed or without, or a path made of pairs."""
    kind = rng.integers(3)
    return pairs_book(seed) if kind == 0 else tree_book(seed, int(rng.integers(3, 5)), seeded=bool(kind == 1))


# Fault -> the kind of the finding that it must give, and how it is planted.
FAULTS = {
    "endless pairing": ("trap", endless_pairing),
    "closed circle": ("trap", closed_circle),
    "dead end": ("dead end", dead_end),
    "off target": ("off-target", off_target),
    "restless": ("livelock", restless),
    "squeezed": ("squeezed", squeezed),
    "holding": ("starvation", holding),
    "never free": ("starvation", never_free),
    "remainder": ("starvation", remainder),
}
BASES = {
    "squeezed": _tree(5, 5, has_gap=True),
    "holding": _tree(3, 4),
    "never free": _tree(3, 4),
    "remainder": lambda seed, rng: pairs_book(seed),
}
WARNINGS = ("squeezed", "holding", "never free")  # it may go well; the others are errors


def _with(book, combine=(), dissociate=(), internal=()):
    """The book with more rules, tried before its own, and letters for them."""
    return replace(
        book,
        letters=(*book.letters, "x", "y"),
        combine=(*combine, *book.combine),
        dissociate=(*dissociate, *book.dissociate),
        internal=tuple(internal),
    )


def _bond(name, letter, face, becomes, partner, partner_face, partner_becomes, **more):
    """The two rules by which two cubes bond."""
    one = Combination(
        rule=name, letter=letter, face=face, partner=partner, partner_face=partner_face, becomes=becomes, **more
    )
    other = Combination(
        rule=f"{name} too",
        letter=partner,
        face=partner_face,
        partner=letter,
        partner_face=face,
        becomes=partner_becomes,
        **more,
    )
    return [one, other]


def _losing(book, rng):
    """The letter of a cube of the target, all of which lose bonds."""
    return _some(book.target.letters, rng)


def _some(choices, rng):
    return choices[int(rng.integers(len(choices)))]
