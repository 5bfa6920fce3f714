"""Ways in which structures join and break, counted by geometry and grouped by rate class."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator, Sequence
from itertools import product
from typing import NamedTuple

from kinetics.assembly.faces import NORMALS, compose, scheme_of, turned
from kinetics.assembly.rules.rule_book import RuleBook, View
from kinetics.assembly.structure import Placement, Structure, placements

_COMPOSE = compose.tolist()
_TURNED = turned.tolist()


class RateClass(NamedTuple):
    """A class of ways that share one rate constant: kind of event, sizes and face types of the two sides, ascending.

    touched : pairs of faces that meet as the two sides come together, 2 for a free cube beside two others; of a break
        always 1, because only a bond that alone holds two parts together breaks
    """

    event: str
    sizes: tuple[int, int]
    faces: tuple[str, str]
    touched: int = 1

    def __str__(self) -> str:
        """`join 1 f1 + 2 f1 touching 1`, `break 1 f1 + 2 f1`."""
        sides = " + ".join(f"{n} {face}" for n, face in zip(self.sizes, self.faces, strict=True))
        return f"{self.event} {sides}" + (f" touching {self.touched}" if self.event == "join" else "")


class Site(NamedTuple):
    """One of the alike open faces of a structure."""

    cube: int
    face: int
    view: View
    alike: int  # how many faces the symmetry puts into this one's place
    turns: tuple[int, ...]  # rotations that keep structure and face


class Fragment(NamedTuple):
    """A part that a break leaves: its cubes as they were numbered in the whole, and its structure."""

    members: tuple[int, ...]
    structure: Structure


def joins(book: RuleBook, a: Structure, b: Structure) -> Iterator[tuple[Structure, float, RateClass]]:
    """Every way to join two structures: (joined structure, its share in N, rate class); alike ways come as one.

    The joined structure has a's cubes first, then b's. N counts pairs of open faces, each of the four twists a quarter.
    """
    return joins_at(book, a, sites_of(book, a), b, sites_of(book, b))


def breaks(
    book: RuleBook, structure: Structure, settle: bool = True
) -> Iterator[tuple[tuple[Fragment, Fragment], float, RateClass]]:
    """Every way to break one bond of a structure: (the two fragments, their share in N, rate class)."""
    for i, j in structure.bonds:
        if structure.sides(i, j) is None:
            continue
        face_i, face_j = (structure.face_towards(c, structure.positions[d]) for c, d in ((i, j), (j, i)))
        bonds = [(i, j), (j, i)] if book.semantics.update == "sequential" else [(i, j)]
        for bond in bonds:
            first, second = (Fragment(*side) for side in book.break_bond(structure, *bond, settle=settle))
            parts = (first, second) if bond == (i, j) else (second, first)
            sizes = (len(parts[0].members), len(parts[1].members))
            yield (first, second), 1 / len(bonds), class_of(book, "break", sizes, (face_i, face_j))


def joins_at(
    book: RuleBook,
    a: Structure,
    sites_a: Sequence[Site],
    b: Structure,
    sites_b: Sequence[Site],
    settle: bool = True,
) -> Iterator[tuple[Structure, float, RateClass]]:
    """`joins` at known sites; settle: whether the internal rules follow at once."""
    for s, t in product(sites_a, sites_b):
        if not book.allows(s.view, t.view):
            continue
        rate_class = class_of(book, "join", (len(a), len(b)), (s.face, t.face))
        ways = [(a, s.cube, b, t.cube, p, n) for p, n in _twists(a, s, b, t)]
        if book.semantics.update == "sequential":  # either cube may be the first to write
            ways += [(b, t.cube, a, s.cube, p, n) for p, n in _twists(b, t, a, s)]
        total = sum(way[-1] for way in ways)
        for first, i, second, j, placement, alike in ways:
            made = book.join(first, i, second, j, placement, settle=settle)
            if made is not None:
                if first is not a:  # written first, so its cubes come first
                    made = made.reordered((*range(len(b), len(made)), *range(len(b))))
                found = rate_class._replace(touched=touched(made, len(a)))
                yield made, s.alike * t.alike * alike / total, found


def _twists(a: Structure, s: Site, b: Structure, t: Site) -> list[tuple[Placement, int]]:
    """Distinct placements, and how many of the four twists each represents."""
    four = placements(a, s.cube, s.face, b, t.cube, t.face)
    if len(s.turns) == len(t.turns) == 1:
        return [(placement, 1) for placement in four]
    found: dict[int, list[Placement]] = defaultdict(list)
    for placement in four:
        alike = (_COMPOSE[g][_COMPOSE[placement.rotation][h]] for g in s.turns for h in t.turns)
        found[min(alike)].append(placement)
    return [(group[0], len(group)) for group in found.values()]


def sites_of(book: RuleBook, structure: Structure) -> list[Site]:
    """One open face of each orbit of the structure's symmetry."""
    symmetries = structure.symmetries(book.scheme)
    reached: set[tuple[int, int]] = set()
    sites = []
    for cube, face in structure.open_faces():
        direction = _TURNED[structure.rotations[cube]][face]
        if (cube, direction) in reached:
            continue
        orbit, turns = {(cube, direction)}, []
        for symmetry in symmetries:
            image = structure.places[symmetry.of(structure.positions[cube])], _TURNED[symmetry.rotation][direction]
            orbit.add(image)
            if image == (cube, direction):
                turns.append(symmetry.rotation)
        reached |= orbit
        view = book.view(structure, cube, face)
        if view is not None:
            sites.append(Site(cube, face, view, len(orbit), tuple(turns)))
    return sites


def class_of(book: RuleBook, event: str, sizes: tuple[int, int], faces: tuple[int, int]) -> RateClass:
    """The rate class of a join of, or a break into, two structures of these sizes at these faces (0..5)."""
    types = scheme_of(book.scheme).types
    (n, first), (m, second) = sorted(zip(sizes, (types[face] for face in faces), strict=True))
    return RateClass(event, (n, m), (first, second))


def touched(joined: Structure, n_first: int) -> int:
    """How many faces of one part, the first cubes, meet a face of the other."""
    others = range(n_first, len(joined))
    if n_first < len(others):
        return sum(other >= n_first for cube in range(n_first) for other in joined.neighbours(cube))
    return sum(other < n_first for cube in others for other in joined.neighbours(cube))


def squeezes(joined: Structure, n_first: int) -> bool:
    """Whether a cube of one part lies between two opposite cubes of the other, which leave little room to pass."""

    def is_other(cube: int, place: tuple[int, int, int]) -> bool:
        other = joined.cube_at(place)
        return other is not None and (other < n_first) != (cube < n_first)

    return any(
        is_other(cube, (x + u, y + v, z + w)) and is_other(cube, (x - u, y - v, z - w))
        for cube, (x, y, z) in enumerate(joined.positions)
        for u, v, w in NORMALS[::2]
    )
