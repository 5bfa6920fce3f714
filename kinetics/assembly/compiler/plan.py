"""The geometry of a target: its parts, how they join and break, and what the cubes read as they do.

Letters are unknowns here: one for each part and each set of its cubes that symmetry makes alike.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import product
from typing import NamedTuple

from kinetics.assembly.compiler.target import PLACEHOLDER, Target
from kinetics.assembly.deriving.ways import Site, sites_of
from kinetics.assembly.faces import Position, roll, scheme_of
from kinetics.assembly.rules.conditions import Senses
from kinetics.assembly.rules.rule_book import RuleBook, View
from kinetics.assembly.structure import Placement, Structure, placements

MOST = 8  # cubes
Form = tuple[tuple[int, int, int, int], ...]  # (x, y, z, seen rotation) of each cube, sorted, smallest x, y, z at 0


class Reading(NamedTuple):
    """What a cube reads as it docks; letters as unknowns, multisets sorted, -1 for no cube."""

    own: int
    face: str
    around: tuple[int, ...]
    across: int
    partner: int
    partner_face: str
    roll: str | None
    touched: tuple[int, ...] | None


class Loss(NamedTuple):
    """What a cube reads as it loses a bond."""

    own: int
    lost: int
    around: tuple[int, ...]


class Meeting(NamedTuple):
    """Cube i of part a and cube j of part b side by side, b put into a's lattice."""

    a: int
    i: int
    b: int
    j: int
    placement: Placement


class Channel(NamedTuple):
    """Parts a and b make c (a join), or c falls into them (a break); a >= b."""

    a: int
    b: int
    c: int


class Wave(NamedTuple):
    """What goes through a part after an event.

    part : the part that comes of it
    before : for each of its cubes, the unknown that was its letter
    writers : the cubes that took part in the event, and what they read
    """

    part: int
    before: tuple[int, ...]
    writers: tuple[tuple[int, Reading | Loss], ...]


@dataclass(frozen=True, eq=False)
class Part:
    """A connected piece of the target, up to rotation.

    unknowns : the unknown that stands for each cube's letter
    symmetries : where each cube goes under each rotation that puts the part onto itself
    """

    structure: Structure
    unknowns: tuple[int, ...]
    symmetries: tuple[tuple[int, ...], ...]
    name: str

    def __len__(self) -> int:
        return len(self.structure)


Docking = tuple[Reading, Reading]


class Way(NamedTuple):
    """One of the ways of a join: an example of the meeting, and the waves that such meetings start."""

    meeting: Meeting
    waves: tuple[Wave, ...]


@dataclass(frozen=True, eq=False)
class Plan:
    """All that can happen to the parts of a target.

    parts : smallest first; the first is a free cube, the last the target
    joins : the ways of each join of two parts into a part, by what the two cubes read
    foreign : what two cubes read where their parts would make something else, no larger than the target, with an
        example
    excess : the same for parts a >= b that are larger than the target together; found when first asked for, as that
        costs the most
    breaks : for each break, the waves that follow in the pieces
    places : of the target's cubes as the user gave them, which of the last part they are
    """

    target: Target
    senses: Senses
    parts: tuple[Part, ...]
    joins: dict[Channel, dict[Docking, Way]]
    foreign: dict[Docking, Meeting]
    breaks: dict[Channel, tuple[Wave, ...]]
    places: tuple[int, ...]
    excess: Callable[[int, int], dict[Docking, Meeting]]

    @cached_property
    def pieces(self) -> dict[int, frozenset[int]]:
        """The parts that breaks leave of each part."""
        found: dict[int, set[int]] = {part: set() for part in range(len(self.parts))}
        for broken in self.breaks:
            found[broken.c].update(broken[:2])
        return {part: frozenset(left) for part, left in found.items()}

    def foreign_of(self, a: int, b: int) -> list[Docking]:
        """What two cubes read where the parts a >= b meet and would make no part of the target."""
        if len(self.parts[a]) + len(self.parts[b]) > len(self.parts[-1]):
            return list(self.excess(a, b))
        return self._foreign.get((a, b), [])

    @cached_property
    def _foreign(self) -> dict[tuple[int, int], list[Docking]]:
        found: dict[tuple[int, int], list[Docking]] = {}
        for docking, meeting in self.foreign.items():
            found.setdefault((meeting.a, meeting.b), []).append(docking)
        return found

    @property
    def n_unknowns(self) -> int:
        """How many letters are asked for, at most."""
        return max(self.parts[-1].unknowns) + 1

    def name(self, channel: Channel) -> str:
        """`2.a+1->3.b`."""
        a, b, c = (self.parts[n].name for n in channel)
        return f"{a}+{b}->{c}"

    def reached(self, joins: Iterable[Channel], breaks: bool) -> set[int]:
        """The parts that free cubes can become."""
        found, before = {0}, 0
        joins = list(joins)
        while len(found) > before:
            before = len(found)
            found |= {join.c for join in joins if join.a in found and join.b in found}
            if breaks:
                found |= {part for broken in self.breaks if broken.c in found for part in broken[:2]}
        return found

    def leading_home(self, joins: Iterable[Channel], breaks: bool, reached: set[int]) -> set[int]:
        """The parts, of those that are reached, which can become part of the target."""
        target = len(self.parts) - 1
        home, before = {target} & reached, 0
        joins = [join for join in joins if join.a in reached and join.b in reached]
        falls = [broken for broken in self.breaks if breaks and broken.c in reached]
        while len(home) > before:
            before = len(home)
            home |= {part for join in joins if join.c in home for part in join[:2]}
            home |= {broken.c for broken in falls if not home.isdisjoint(broken[:2])}
        return home


def planned(target: Target, senses: Senses, tick: Callable[[], None] = lambda: None) -> Plan:
    """The plan of a target whose cubes sense that much.

    tick : called again and again; it may raise to end the work
    """
    if len(target) > MOST:
        raise ValueError(f"target {target.name!r} has {len(target)} cubes; all its parts are tried up to {MOST} only")
    return _Planner(target, senses, tick).plan()


def pieces_of(whole: Structure, scheme: str, tick: Callable[[], None] = lambda: None) -> set[Structure]:
    """The connected pieces of a structure up to rotation, itself among them."""
    subsets = {frozenset({cube}) for cube in range(len(whole))}
    fresh = subsets
    while fresh:
        tick()
        fresh = {s | {n} for s in fresh for cube in s for n in whole.neighbours(cube) if n not in s} - subsets
        subsets |= fresh
    return {whole.part(sorted(subset)).canonical(scheme) for subset in subsets}


class _Planner:
    def __init__(self, target: Target, senses: Senses, tick: Callable[[], None]):
        self.target, self.senses, self.tick = target, senses, tick
        self.seen = scheme_of(senses.faces).reduced.tolist()
        self.reader = RuleBook("reader", (PLACEHOLDER,), PLACEHOLDER, senses)
        self.forms: dict[Form, tuple[int, tuple[int, ...]]] = {}  # of every part in every turn: part, its cubes
        self.parts = self.find_parts()
        letters = [tuple(map(str, part.unknowns)) for part in self.parts]
        self.read = [part.structure.with_letters(names) for part, names in zip(self.parts, letters, strict=True)]
        self.sites = [sites_of(self.reader, structure) for structure in self.read]
        # Without them, a cube reads the same at every twist.
        self.reads_twist = senses.roll or senses.touched
        self.extent = sorted(max(c) - min(c) for c in zip(*target.positions, strict=True))
        self.joins: dict[Channel, dict[Docking, dict[Wave, Meeting]]] = {}
        self.known_excess: dict[tuple[int, int], dict[Docking, Meeting]] = {}

    def plan(self) -> Plan:
        joins, foreign = self.joins, dict[Docking, Meeting]()
        for a in range(len(self.parts)):
            for b in range(a + 1):
                if len(self.parts[a]) + len(self.parts[b]) <= len(self.target):
                    self.dock(a, b, joins, foreign)
        whole = self.target.structure(self.senses.faces)
        known = self.known(whole.positions, whole.rotations)
        assert known is not None  # noqa: S101  the target is a part of itself
        return Plan(
            self.target,
            self.senses,
            tuple(self.parts),
            {
                channel: {d: Way(next(iter(waves.values())), tuple(waves)) for d, waves in ways.items()}
                for channel, ways in sorted(joins.items())
            },
            foreign,
            self.breaks(),
            known[1],
            self.excess,
        )

    def excess(self, a: int, b: int) -> dict[Docking, Meeting]:
        """See `Plan`."""
        if (a, b) not in self.known_excess:
            found: dict[Docking, Meeting] = {}
            self.dock(a, b, {}, found)
            self.known_excess[a, b] = found
        return self.known_excess[a, b]

    @cached_property
    def kinds(self) -> set[tuple[object, ...]]:
        """What readings of joins are before docking, but for the letters; others are never open."""
        return {_before_docking(r) for ways in self.joins.values() for docking in ways for r in docking}

    def find_parts(self) -> list[Part]:
        """The connected pieces of the target, each once."""
        unique = pieces_of(self.target.structure(self.senses.faces), self.senses.faces, self.tick)
        structures = sorted(unique, key=lambda s: (len(s), s.positions, s.rotations))
        names = _names([len(structure) for structure in structures])
        parts: list[Part] = []
        unknown = 0
        for number, (structure, name) in enumerate(zip(structures, names, strict=True)):
            self.tick()
            symmetries = tuple(
                tuple(structure.places[symmetry.of(place)] for place in structure.positions)
                for symmetry in structure.symmetries(self.senses.faces)
            )
            first = [min(symmetry[cube] for symmetry in symmetries) for cube in range(len(structure))]
            orbits = {cube: unknown + n for n, cube in enumerate(sorted(set(first)))}
            unknown += len(orbits)
            parts.append(Part(structure, tuple(orbits[cube] for cube in first), symmetries, name))
            for rotation in range(24):
                turned = structure.moved(Placement(rotation, (0, 0, 0)))
                form, order = self.form(turned.positions, turned.rotations)
                self.forms.setdefault(form, (number, order))
        return parts

    def form(self, positions: Sequence[Position], rotations: Sequence[int]) -> tuple[Form, tuple[int, ...]]:
        """How cubes look wherever they are, and the order in which that takes them."""
        x0, y0, z0 = (min(c) for c in zip(*positions, strict=True))
        cubes = [
            ((x - x0, y - y0, z - z0, self.seen[r]), cube)
            for cube, ((x, y, z), r) in enumerate(zip(positions, rotations, strict=True))
        ]
        cubes.sort()
        return tuple(cube for cube, _ in cubes), tuple(order for _, order in cubes)

    def known(self, positions: Sequence[Position], rotations: Sequence[int]) -> tuple[int, tuple[int, ...]] | None:
        """Which part some cubes are, and which of its cubes each of them is; None: no part of the target."""
        form, order = self.form(positions, rotations)
        if form not in self.forms:
            return None
        part, cubes = self.forms[form]
        place = dict(zip(order, cubes, strict=True))
        return part, tuple(place[cube] for cube in range(len(order)))

    def dock(
        self,
        a: int,
        b: int,
        joins: dict[Channel, dict[Docking, dict[Wave, Meeting]]],
        foreign: dict[Docking, Meeting],
    ) -> None:
        """Every way in which two parts can meet, sorted by whether it makes a part of the target."""
        first, second = self.read[a], self.read[b]
        fits = len(first) + len(second) <= len(self.target)
        known: dict[Placement, tuple[Structure, tuple[int, tuple[int, ...]] | None] | None] = {}
        for s, t in product(self.sites[a], self.sites[b]):
            self.tick()
            ends = _reading(s.view, t.view), _reading(t.view, s.view)
            if not fits and (
                not self.kinds.issuperset(map(_before_docking, ends))
                or (not self.reads_twist and _sorted(*ends) in foreign)
            ):
                continue
            for placement in placements(first, s.cube, s.face, second, t.cube, t.face):
                if placement not in known:
                    known[placement] = self.placed(first, second, placement, fits)
                if (found := known[placement]) is None:
                    continue
                placed, made = found
                own, other = self.docked(ends, first, s, placed, t) if self.reads_twist else ends
                meeting = Meeting(a, s.cube, b, t.cube, placement)
                if made is None:
                    foreign.setdefault(_sorted(own, other), meeting)
                    if not fits and not self.reads_twist:
                        break
                    continue
                part, cubes = made
                writers = (cubes[s.cube], own), (cubes[len(first) + t.cube], other)
                wave = self.wave(part, cubes, (*self.parts[a].unknowns, *self.parts[b].unknowns), writers)
                ways = joins.setdefault(Channel(a, b, part), {})
                ways.setdefault(_sorted(own, other), {}).setdefault(wave, meeting)

    def placed(
        self, first: Structure, second: Structure, placement: Placement, fits: bool
    ) -> tuple[Structure, tuple[int, tuple[int, ...]] | None] | None:
        """The second of two structures beside the first, and what they make (see `known`); None: they overlap."""
        places = tuple([placement.of(position) for position in second.positions])
        if not first.places.keys().isdisjoint(places):
            return None
        placed = second.moved(placement)
        both = first.positions + places
        extent = sorted(max(c) - min(c) for c in zip(*both, strict=True))
        fits = fits and all(own <= most for own, most in zip(extent, self.extent, strict=True))
        return placed, self.known(both, first.rotations + placed.rotations) if fits else None

    def docked(self, ends: Docking, a: Structure, s: Site, b: Structure, t: Site) -> Docking:
        """The readings of two cubes that dock, b lying in a's lattice, with what only docking shows (see
        `RuleBook.view`).
        """
        twist: str | None = None
        touched: tuple[tuple[int, ...] | None, tuple[int, ...] | None] = (None, None)
        if self.senses.roll:
            twist = roll(self.senses.faces, a.rotations[s.cube], s.face, b.rotations[t.cube])
        if self.senses.touched:
            touched = _letters(b, a.positions[s.cube]), _letters(a, b.positions[t.cube])
        own, other = (Reading(*end[:6], roll=twist, touched=around) for end, around in zip(ends, touched, strict=True))
        return own, other

    def breaks(self) -> dict[Channel, tuple[Wave, ...]]:
        """Every break of every part."""
        found: dict[Channel, dict[Wave, None]] = {}
        for number, part in enumerate(self.parts):
            structure = part.structure
            for i, j in structure.bonds:
                self.tick()
                sides = structure.sides(i, j)
                if sides is None:
                    continue
                waves = []
                for own, gone, members in ((i, j, sides[0]), (j, i, sides[1])):
                    around = tuple(sorted(part.unknowns[n] for n in structure.neighbours(own) if n != gone))
                    loss = Loss(part.unknowns[own], part.unknowns[gone], around)
                    piece = structure.part(members)
                    known = self.known(piece.positions, piece.rotations)
                    assert known is not None  # noqa: S101  a piece of a part is one
                    writers = ((known[1][members.index(own)], loss),)
                    waves.append(self.wave(*known, tuple(part.unknowns[cube] for cube in members), writers))
                small, large = sorted(wave.part for wave in waves)
                found.setdefault(Channel(large, small, number), {}).update(dict.fromkeys(waves))
        return {channel: tuple(waves) for channel, waves in sorted(found.items())}

    def wave(
        self,
        part: int,
        cubes: tuple[int, ...],
        before: tuple[int, ...],
        writers: tuple[tuple[int, Reading | Loss], ...],
    ) -> Wave:
        """The wave in a part whose cubes were given in another order; waves that symmetry makes alike come as one."""
        was = dict(zip(cubes, before, strict=True))
        alike = []
        for symmetry in self.parts[part].symmetries:
            moved = {symmetry[cube]: was[cube] for cube in was}
            ends = tuple(sorted(((symmetry[cube], reading) for cube, reading in writers), key=repr))
            alike.append(Wave(part, tuple(moved[cube] for cube in range(len(moved))), ends))
        return min(alike, key=repr)


def _sorted(a: Reading, b: Reading) -> Docking:
    return (a, b) if a <= b else (b, a)


def _before_docking(reading: Reading) -> tuple[object, ...]:
    return reading.face, reading.partner_face, len(reading.around), reading.across < 0


def _reading(own: View, partner: View) -> Reading:
    """A view before docking, whose letters are unknowns, with what it shows of the partner."""
    return Reading(
        int(own.letter),
        own.face,
        tuple(sorted(map(int, own.neighbours))),
        int(own.across or -1),
        int(partner.letter),
        partner.face,
        None,
        None,
    )


def _letters(structure: Structure, place: Position) -> tuple[int, ...]:
    """The letters of the cubes around a place."""
    return tuple(sorted([int(structure.letters[cube]) for cube in structure.touching(place)]))


def _names(sizes: Sequence[int]) -> list[str]:
    """`3`, or `3.b` where several parts have that size."""
    names = []
    for n, size in enumerate(sizes):
        number, suffix = sizes[:n].count(size), ""
        while number >= 0:
            number, letter = divmod(number, 26)
            suffix = chr(ord("a") + letter) + suffix
            number -= 1
        names.append(f"{size}.{suffix}" if sizes.count(size) > 1 else str(size))
    return names
