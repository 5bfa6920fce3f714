"""What assembly costs with one letter a cube and with one a face: letters written and rules looked up, cube by cube.

Both are run side by side through the same random growth, move for move. A write is a letter that changes; a look-up is
one reading matched against the rules. As two cubes bond, each of them looks up once, or each of its faces does; in a
round of an internal wave so do all cubes whose own letter or a neighbour's has just changed. Meetings that the rules
refuse are not counted. A cube's cost counts at the faces that are bonded in the finished structure, F of them: a face
that never bonds would need no letter.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from itertools import combinations

import numpy as np

from kinetics.assembly.faces import scheme_of
from kinetics.assembly.rules.conditions import Combination, Semantics, Senses
from kinetics.assembly.rules.rule_book import RuleBook
from kinetics.assembly.structure import Structure, placements
from kinetics.support.arrays import Floats
from tests.results.face_grammar import FACES, FaceGrammar, Faces, Rewriting, letter_of, rewrite

COSTS = (
    "cube writes",
    "cube look-ups",
    "cube writes in waves",
    "cube look-ups in waves",
    "face writes",
    "face writes, open faces only",
    "face look-ups",
    "face writes in waves",
    "face look-ups in waves",
)
TARGETS = 3  # whose cubes are in the tank where a book needs no seed


@dataclass
class CubeWork:
    """What one cube has cost so far: [joins, waves] of the cube, and [joins, waves][own face] of its faces."""

    writes: Floats = field(default_factory=lambda: np.zeros(2))
    lookups: Floats = field(default_factory=lambda: np.zeros(2))
    face_writes: Floats = field(default_factory=lambda: np.zeros((2, 6)))
    face_lookups: Floats = field(default_factory=lambda: np.zeros((2, 6)))
    open_writes: Floats = field(default_factory=lambda: np.zeros(6))

    def costs(self, bonded: Sequence[int]) -> list[float]:
        """As COSTS, with the faces that are bonded in the end."""
        writes, lookups = self.face_writes[:, bonded].sum(axis=1), self.face_lookups[:, bonded].sum(axis=1)
        joins = [self.writes[0], self.lookups[0], self.writes[1], self.lookups[1]]
        return [*joins, writes[0], self.open_writes[bonded].sum(), lookups[0], writes[1], lookups[1]]


@dataclass
class _Part:
    """A structure in the making, its face letters, and what its cubes have cost."""

    structure: Structure
    faces: Faces
    work: list[CubeWork]


def growth_costs(book: RuleBook, seed: int) -> Floats:
    """One random growth of a book's target: a row a cube of the finished ones, F and then COSTS (cubes, 10).

    Without a seed cube, the cubes of TARGETS targets join at random, without breaks, until nothing bonds any more.
    ValueError: the book names no target. RuntimeError: cubes and faces come to different letters.
    """
    if book.target is None:
        raise ValueError(f"book {book.name!r} has no target to grow to; give it a [target]")
    rng, grammar = np.random.default_rng(seed), FaceGrammar(book)
    free, start = book.monomer(), book.seed()
    starts = [start] if start is not None else [free] * (TARGETS * len(book.target))
    parts = [_part(grammar, structure) for structure in starts]
    while True:
        pairs = list(combinations(range(len(parts)), 2)) if start is None else [(0, -1)]
        for pair in rng.permutation(len(pairs)).tolist():
            a, b = pairs[pair]
            grown = _joined(grammar, parts[a], parts[b] if b >= 0 else _part(grammar, free), rng)
            if grown is not None:
                parts = [part for n, part in enumerate(parts) if n not in (a, b)] + [grown]
                break
        else:
            break
    target = book.target.canonical(book.scheme)
    finished = (part for part in parts if part.structure.canonical(book.scheme) == target)
    rows = [row for part in finished for row in _rows(part)]
    return np.array(rows, dtype=float).reshape(-1, 1 + len(COSTS))


def _part(grammar: FaceGrammar, structure: Structure) -> _Part:
    return _Part(structure, grammar.faces(structure), [CubeWork() for _ in structure.letters])


def _rows(part: _Part) -> Iterator[list[float]]:
    structure = part.structure
    for cube, work in enumerate(part.work):
        bonded = [face for face in FACES if structure.cube_at(structure.faced(cube, face)) is not None]
        yield [len(bonded), *work.costs(bonded)]


def _joined(grammar: FaceGrammar, a: _Part, b: _Part, rng: np.random.Generator) -> _Part | None:
    """Two parts after one of the ways to join them, all equally likely, and the wave behind it; None: no way."""
    book = grammar.book
    views = {(j, face): book.view(b.structure, j, face) for j, face in b.structure.open_faces()}
    ways = [
        (i, face, j, its_face, twist)
        for i, face in a.structure.open_faces()
        for (j, its_face), view in views.items()
        if book.allows(book.view(a.structure, i, face), view)
        for twist in range(4)
    ]
    for way in rng.permutation(len(ways)).tolist():
        i, face, j, its_face, twist = ways[way]
        placement = placements(a.structure, i, face, b.structure, j, its_face)[twist]
        made = book.join(a.structure, i, b.structure, j, placement, settle=False)
        if made is not None:
            n = len(a.structure)
            before = a.structure.joined(b.structure.moved(placement))
            whole = _Part(before, [list(f) for f in (*a.faces, *b.faces)], [*a.work, *b.work])
            _dock(grammar, whole, made, n, (i, face), (n + j, its_face))
            _follow(grammar, whole, {cube for bond in before.bonds if bond[0] < n <= bond[1] for cube in bond})
            return whole
    return None


def _dock(
    grammar: FaceGrammar, whole: _Part, made: Structure, n_first: int, one: tuple[int, int], other: tuple[int, int]
) -> None:
    """Count and carry out what a join rewrites."""
    before, work = whole.structure, whole.work
    rewritings = grammar.docked(whole.faces, before, n_first, one, other)
    for rewriting, (cube, _) in zip(rewritings, (one, other), strict=True):
        work[cube].writes[0] += made.letters[cube] != before.letters[cube]
        work[cube].lookups[0] += 1
        _count(work[cube], 0, rewriting)
        own = range(n_first) if cube < n_first else range(n_first, len(before))
        for face in rewriting.letters:
            work[cube].open_writes[face] += before.cube_at(before.faced(cube, face)) not in own
    rewrite(whole.faces, rewritings)
    whole.structure = made
    _compare(grammar, whole)


def _follow(grammar: FaceGrammar, whole: _Part, fresh: set[int]) -> None:
    """Count and carry out the wave of internal rules behind a join, which begins at the cubes with new bonds."""
    book, work = grammar.book, whole.work
    if not book.internal:
        return
    while fresh:
        structure = whole.structure
        near = sorted(fresh.union(*(structure.neighbours(cube) for cube in fresh)))
        letters = list(structure.letters)
        for step in book.steps(structure):
            (cube,) = (c for c, letter in enumerate(step.letters) if letter != structure.letters[c])
            letters[cube] = step.letters[cube]
        rewritings = grammar.followed(whole.faces, structure, near)
        for rewriting in rewritings:
            cube = rewriting.cube
            work[cube].writes[1] += letters[cube] != structure.letters[cube]
            work[cube].lookups[1] += 1
            _count(work[cube], 1, rewriting)
        fresh = {cube for cube in near if letters[cube] != structure.letters[cube]}
        rewrite(whole.faces, rewritings)
        whole.structure = structure.with_letters(letters)
        _compare(grammar, whole)


def _count(work: CubeWork, kind: int, rewriting: Rewriting) -> None:
    work.face_lookups[kind] += 1
    for face in rewriting.letters:
        work.face_writes[kind, face] += 1


def _compare(grammar: FaceGrammar, whole: _Part) -> None:
    """RuntimeError where some face shows another letter than its cube has."""
    for cube, letter in enumerate(whole.structure.letters):
        if any(letter_of(face) != letter for face in whole.faces[cube]):
            raise RuntimeError(
                f"the per-face grammar of book {grammar.book.name!r} comes to {whole.faces[cube]} where the book has "
                f"{letter!r}, in {whole.structure}"
            )


def star_book(n_faces: int) -> RuleBook:
    """The worst case of section II: a seed whose letter changes with each of the cubes that dock at F of its faces."""
    if not 1 <= n_faces <= len(FACES):
        raise ValueError(f"n_faces = {n_faces}; a cube has 1 to 6 faces")
    counts = [f"s{n}" for n in range(n_faces + 1)]
    names = scheme_of("six").types[:n_faces]
    hosts = [
        Combination(rule=f"host {n + 1}", letter=(letter,), face=names, partner=("a",), becomes=counts[n + 1])
        for n, letter in enumerate(counts[:-1])
    ]
    guest = Combination(rule="dock", letter=("a",), face=("f1",), partner=tuple(counts[:-1]), roll=("0",), becomes="g")
    star = RuleBook(
        name=f"star of {n_faces}",
        letters=("a", "g", *counts),
        initial="a",
        senses=Senses(faces="six", roll=True),
        seed_letter=counts[0],
        semantics=Semantics(bonds="hold"),
        combine=(guest, *hosts),
    )
    whole = Structure(((0, 0, 0),), (0,), (counts[0],))
    for face in FACES[:n_faces]:
        twists = placements(whole, 0, face, star.monomer(), 0, 0)
        whole = next(made for twist in twists if (made := star.join(whole, 0, star.monomer(), 0, twist)) is not None)
    return replace(star, target=whole)
