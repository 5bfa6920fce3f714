"""Everything that the cubes of a rule book can become, found by trying every join and every break.

Structures are explored from the smallest up. Each is joined with those explored before it, at one face of every orbit
of its symmetry and at every twist that gives something new, and broken at every bond that holds two parts together.
"""

from __future__ import annotations

import heapq
from collections import defaultdict
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import product
from typing import NamedTuple

from kinetics.assembly.faces import compose, scheme_of, turned
from kinetics.assembly.rules import LivelockError, RuleBook, View
from kinetics.assembly.structure import NORMALS, Placement, Structure, placements

MAX_CUBES = 12  # or the target's size
MAX_SPECIES = 2000
Indices = tuple[int, ...]
_COMPOSE = compose.tolist()
_TURNED = turned.tolist()


class Event(NamedTuple):
    """A join or a break: indices of the structures before and after, rising."""

    before: Indices
    after: Indices


class RateClass(NamedTuple):
    """Ways that have one rate constant in common: kind of event, sizes and face types of the two sides, rising."""

    event: str
    sizes: tuple[int, int]
    faces: tuple[str, str]

    def __str__(self) -> str:
        """`join 1 f1 + 2 f1`."""
        return f"{self.event} {' + '.join(f'{n} {face}' for n, face in zip(self.sizes, self.faces, strict=True))}"


class Join(NamedTuple):
    """Two structures and what they make."""

    first: Structure
    second: Structure
    made: Structure


@dataclass(frozen=True, eq=False)
class Exploration:
    """What was found.

    structures : canonical, in the order of discovery
    events : for each join and break, the ways N by rate class
    beyond : the smallest join that goes beyond max_cubes, left out of the events; None: there is none
    squeezed : ways of a join in which a cube has to slip in between two opposite ones
    livelocks : events after which the internal rules never rest, in words; left out of the events
    stopped : why the exploration ended early; "" where it is complete
    """

    book: RuleBook
    max_cubes: int
    max_species: int
    structures: tuple[Structure, ...]
    events: Mapping[Event, Mapping[RateClass, float]]
    beyond: Join | None
    squeezed: Mapping[Event, float]
    livelocks: tuple[str, ...]
    stopped: str

    @property
    def is_closed(self) -> bool:
        """Whether these are proven to be all structures there are."""
        return self.beyond is None and not self.stopped and not self.livelocks


class _Site(NamedTuple):
    """One of the alike open faces of a structure."""

    cube: int
    face: int
    view: View
    alike: int  # how many faces the symmetry puts into this one's place
    turns: tuple[int, ...]  # rotations that keep structure and face


def explore(
    book: RuleBook,
    max_cubes: int | None = None,
    max_species: int = MAX_SPECIES,
    first_beyond: bool = False,
    progress: Callable[[int, int], None] | None = None,
    slow_waves: bool = False,
) -> Exploration:
    """Explore what free cubes, and the seed if the book has one, can become.

    max_cubes, max_species : caps; larger products are left out, more structures end the exploration.
        max_cubes is by default 12, or the size of the book's target if that is larger
    first_beyond : end as soon as the book is known not to be closed
    progress : told the numbers of structures explored and found
    slow_waves : internal rules act on one cube at a time, in any order, and joins and breaks come in between; such
        steps are events of one structure before and one after
    Ctrl-C ends the exploration; what was found is returned.
    """
    if max_cubes is None:
        max_cubes = max(MAX_CUBES, 0 if book.target is None else len(book.target))
    if max_cubes < 1 or max_species < 1:
        raise ValueError(f"max_cubes = {max_cubes}, max_species = {max_species}; both must be at least 1")
    explorer = _Explorer(book, max_cubes, max_species, slow_waves)
    stopped = ""
    try:
        explorer.run(first_beyond, progress)
    except _TooManyError as error:
        stopped = str(error)
    except KeyboardInterrupt:
        stopped = f"interrupted with {len(explorer.explored)} of {len(explorer.order)} structures explored"
    return Exploration(
        book,
        max_cubes,
        max_species,
        tuple(explorer.order),
        explorer.events,
        explorer.beyond,
        explorer.squeezed,
        tuple(explorer.livelocks),
        stopped,
    )


class _TooManyError(Exception):
    """More structures than the cap."""


class _Explorer:
    def __init__(self, book: RuleBook, max_cubes: int, max_species: int, slow_waves: bool):
        self.book, self.max_cubes, self.max_species, self.slow_waves = book, max_cubes, max_species, slow_waves
        self.order: list[Structure] = []
        self.index: dict[Structure, int] = {}
        self.waiting: list[tuple[int, int]] = []  # (size, index), smallest first
        self.explored: list[int] = []
        self.sites: dict[int, list[_Site]] = {}
        self.holders: defaultdict[View, list[int]] = defaultdict(list)  # explored structures that show a view
        self.partners: dict[View, list[View]] = {}
        self.events: defaultdict[Event, defaultdict[RateClass, float]] = defaultdict(lambda: defaultdict(float))
        self.squeezed: defaultdict[Event, float] = defaultdict(float)
        self.livelocks: list[str] = []
        self.beyond: Join | None = None

    def run(self, first_beyond: bool, progress: Callable[[int, int], None] | None) -> None:
        for start in (self.book.monomer(), self.book.seed()):
            if start is not None:
                self.entered(start, "the start")
        while self.waiting:
            _, new = heapq.heappop(self.waiting)
            structure = self.order[new]
            self.sites[new] = _sites(self.book, structure)
            self.explored.append(new)
            for view in {site.view for site in self.sites[new]}:
                self.show(view)
                self.holders[view].append(new)
            for old in self.candidates(new):
                self.join(old, new)
            if self.book.semantics.bonds == "break":
                self.part(new)
            if self.slow_waves:
                self.follow(new)
            if progress is not None:
                progress(len(self.explored), len(self.order))
            if first_beyond and self.beyond is not None and len(self.beyond.made) == self.max_cubes + 1:
                return

    def show(self, view: View) -> None:
        """Find out once which of the known views a new one may bond with."""
        if view in self.partners:
            return
        self.partners[view] = []
        for other in self.partners:
            if self.book.allows(view, other):
                self.partners[view].append(other)
                if other != view:
                    self.partners[other].append(view)

    def candidates(self, new: int) -> list[int]:
        """Explored structures that some face of `new` may bond with."""
        views = {site.view for site in self.sites[new]}
        return sorted({old for view in views for other in self.partners[view] for old in self.holders[other]})

    def join(self, old: int, new: int) -> None:
        before = (min(old, new), max(old, new))
        if len(self.order[old]) < len(self.order[new]):
            old, new = new, old  # the smaller one is put into the lattice of the other
        first, second = self.order[old], self.order[new]
        size = len(first) + len(second)
        if size > self.max_cubes and self.beyond is not None and size >= len(self.beyond.made):
            return
        what = f"the join of {first} and {second}"
        try:
            for made, share, rate_class in _joined(
                self.book, first, self.sites[old], second, self.sites[new], not self.slow_waves
            ):
                if size > self.max_cubes:
                    self.beyond = Join(first, second, made)
                    return
                event = Event(before, (self.entered(made, what),))
                self.events[event][rate_class] += share
                if _squeezes(made, len(first)):
                    self.squeezed[event] += share
        except LivelockError as error:
            self.livelocks.append(f"{what}: {error}")

    def part(self, new: int) -> None:
        what = f"a break of {self.order[new]}"
        try:
            for fragments, share, rate_class in breaks(self.book, self.order[new], not self.slow_waves):
                ends = sorted(self.entered(part, what) for part in fragments)
                self.events[Event((new,), tuple(ends))][rate_class] += share
        except LivelockError as error:
            self.livelocks.append(f"{what}: {error}")

    def follow(self, new: int) -> None:
        structure = self.order[new]
        for changed in self.book.steps(structure):
            event = Event((new,), (self.entered(changed, f"an internal rule in {structure}"),))
            self.events[event][RateClass("internal", (len(structure), 0), ("", ""))] += 1

    def entered(self, structure: Structure, what: str) -> int:
        """Index of a structure; a new one waits to be explored."""
        canonical = structure.canonical(self.book.scheme)
        if canonical not in self.index:
            if len(self.order) == self.max_species:
                raise _TooManyError(
                    f"book {self.book.name!r} makes more than max_species = {self.max_species} structures, the last "
                    f"by {what}; guard its rules, or raise the cap"
                )
            self.index[canonical] = len(self.order)
            heapq.heappush(self.waiting, (len(canonical), len(self.order)))
            self.order.append(canonical)
        return self.index[canonical]


def joins(book: RuleBook, a: Structure, b: Structure) -> Iterator[tuple[Structure, float, RateClass]]:
    """Every way to join two structures: (joined structure, its share in N, rate class); alike ways come as one.

    N counts pairs of open faces, each of the four twists a quarter.
    """
    return _joined(book, a, _sites(book, a), b, _sites(book, b))


def breaks(
    book: RuleBook, structure: Structure, settle: bool = True
) -> Iterator[tuple[tuple[Structure, Structure], float, RateClass]]:
    """Every way to break one bond of a structure: (the two fragments, their share in N, rate class)."""
    for i, j in structure.bonds:
        if structure.sides(i, j) is None:
            continue
        face_i, face_j = (structure.face_towards(c, structure.positions[d]) for c, d in ((i, j), (j, i)))
        bonds = [(i, j), (j, i)] if book.semantics.update == "sequential" else [(i, j)]
        for bond in bonds:
            (_, first), (_, second) = book.break_bond(structure, *bond, settle=settle)
            sizes = (len(first), len(second)) if bond == (i, j) else (len(second), len(first))
            yield (first, second), 1 / len(bonds), _class(book, "break", sizes, (face_i, face_j))


def _joined(
    book: RuleBook,
    a: Structure,
    sites_a: Sequence[_Site],
    b: Structure,
    sites_b: Sequence[_Site],
    settle: bool = True,
) -> Iterator[tuple[Structure, float, RateClass]]:
    for s, t in product(sites_a, sites_b):
        if not book.allows(s.view, t.view):
            continue
        rate_class = _class(book, "join", (len(a), len(b)), (s.face, t.face))
        ways = [(a, s.cube, b, t.cube, p, n) for p, n in _twists(a, s, b, t)]
        if book.semantics.update == "sequential":  # either cube may be the first to write
            ways += [(b, t.cube, a, s.cube, p, n) for p, n in _twists(b, t, a, s)]
        total = sum(way[-1] for way in ways)
        for first, i, second, j, placement, alike in ways:
            joined = book.join(first, i, second, j, placement, settle=settle)
            if joined is not None:
                yield joined, s.alike * t.alike * alike / total, rate_class


def _twists(a: Structure, s: _Site, b: Structure, t: _Site) -> list[tuple[Placement, int]]:
    """Placements that differ, and how many of the four each stands for."""
    four = placements(a, s.cube, s.face, b, t.cube, t.face)
    if len(s.turns) == len(t.turns) == 1:
        return [(placement, 1) for placement in four]
    found: dict[int, list[Placement]] = defaultdict(list)
    for placement in four:
        alike = (_COMPOSE[g][_COMPOSE[placement.rotation][h]] for g in s.turns for h in t.turns)
        found[min(alike)].append(placement)
    return [(group[0], len(group)) for group in found.values()]


def _sites(book: RuleBook, structure: Structure) -> list[_Site]:
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
            sites.append(_Site(cube, face, view, len(orbit), tuple(turns)))
    return sites


def _class(book: RuleBook, event: str, sizes: tuple[int, int], faces: tuple[int, int]) -> RateClass:
    types = scheme_of(book.scheme).types
    (n, first), (m, second) = sorted(zip(sizes, (types[face] for face in faces), strict=True))
    return RateClass(event, (n, m), (first, second))


def _squeezes(joined: Structure, n_first: int) -> bool:
    """Whether a cube of one part lies between two opposite cubes of the other, which it could hardly get past."""

    def is_other(cube: int, place: tuple[int, int, int]) -> bool:
        other = joined.cube_at(place)
        return other is not None and (other < n_first) != (cube < n_first)

    return any(
        is_other(cube, (x + u, y + v, z + w)) and is_other(cube, (x - u, y - v, z - w))
        for cube, (x, y, z) in enumerate(joined.positions)
        for u, v, w in NORMALS[::2]
    )
