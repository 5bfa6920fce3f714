"""The plan of a target: its parts, how they join and break, and what the cubes read as they do.

Letters are unknowns here: one for each part and each set of its cubes that symmetry makes alike.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

from kinetics.assembly.compiler.dockings import Dockings, Meeting, Reading
from kinetics.assembly.compiler.parts import Part
from kinetics.assembly.compiler.target import Target
from kinetics.assembly.rules.conditions import Senses


class Loss(NamedTuple):
    """What a cube reads as it loses a bond."""

    own: int
    lost: int
    around: tuple[int, ...]


class Channel(NamedTuple):
    """Parts a and b make c (a join), or c falls into them (a break); a >= b."""

    a: int
    b: int
    c: int


class Wave(NamedTuple):
    """A sequence of internal rules through a part after an event.

    part : the part that comes of it
    before : for each of its cubes, the unknown that was its letter
    writers : the cubes that took part in the event, and what they read
    """

    part: int
    before: tuple[int, ...]
    writers: tuple[tuple[int, Reading | Loss], ...]


Docking = tuple[Reading, Reading]


class Way(NamedTuple):
    """One of the ways of a join: an example of the meeting, and the waves that such meetings start."""

    meeting: Meeting
    waves: tuple[Wave, ...]


@dataclass(frozen=True, eq=False)
class Plan:
    """All that can happen to the parts of a target, as cubes with some senses see it.

    dockings : its parts, and how they meet
    joins : the ways of each join of two parts into a part, by what the two cubes read
    breaks : for each break, the waves that follow in the pieces; empty if bonds hold
    """

    dockings: Dockings
    senses: Senses
    joins: dict[Channel, dict[Docking, Way]]
    breaks: dict[Channel, tuple[Wave, ...]]

    @property
    def target(self) -> Target:
        """What is built."""
        return self.dockings.target

    @property
    def parts(self) -> list[Part]:
        """Smallest first; the first is a free cube, the last the target."""
        return self.dockings.parts.parts

    @property
    def places(self) -> tuple[int, ...]:
        """Of the target's cubes as the user gave them, which of the last part they are."""
        whole = self.target.structure(self.senses.faces)
        known = self.dockings.parts.known(whole)
        assert known is not None  # noqa: S101  the target is a part of itself
        return known[1]

    @cached_property
    def pieces(self) -> dict[int, frozenset[int]]:
        """The parts that breaks leave of each part."""
        found: dict[int, set[int]] = {part: set() for part in range(len(self.parts))}
        for broken in self.breaks:
            found[broken.c].update(broken[:2])
        return {part: frozenset(left) for part, left in found.items()}

    @cached_property
    def bonds(self) -> dict[Channel, int]:
        """How many bonds of a part can break so; empty if bonds hold."""
        return Counter(channel for channel, _ in _broken(self.dockings)) if self.breaks else {}

    @cached_property
    def readings(self) -> dict[Reading, dict[Channel, Meeting]]:
        """What cubes read that join: in which joins, with an example of each."""
        found: dict[Reading, dict[Channel, Meeting]] = {}
        for channel, ways in self.joins.items():
            for docking, way in ways.items():
                for reading in docking:
                    found.setdefault(reading, {}).setdefault(channel, way.meeting)
        return found

    @cached_property
    def doubtful(self) -> dict[tuple[int, int], list[tuple[Docking, Meeting, Channel | None]]]:
        """By parts, meetings whose two cubes read what cubes read in joins; they must not bond, unless a meeting is a
        join itself and that is chosen.
        """
        found: dict[tuple[int, int], list[tuple[Docking, Meeting, Channel | None]]] = {}
        for join, ways in self.joins.items():
            found.setdefault(join[:2], []).extend((docking, way.meeting, join) for docking, way in ways.items())
        for parts, doubtful in found.items():
            for docking, meeting in self.foreign(*parts).items():
                if all(reading in self.readings for reading in docking):
                    doubtful.append((docking, meeting, None))
        return found

    @cached_property
    def kinds(self) -> dict[tuple[object, ...], int]:
        """The kinds of readings in joins (see `Reading.kind`), numbered; cubes that read anything else never bond."""
        return {kind: number for number, kind in enumerate(dict.fromkeys(reading.kind for reading in self.readings))}

    def foreign(self, a: int, b: int) -> dict[Docking, Meeting]:
        """What two cubes read where the parts a >= b meet and would make no part of the target, with an example;
        without those of which one reads nothing of the kind that cubes read that join.
        """
        if (a, b) not in self._foreign:
            found = self._foreign[a, b] = dict[Docking, Meeting]()
            for *readings, meeting in self.dockings.foreign(a, b):
                own, other = (reading.sensed(self.senses) for reading in readings)
                if own.kind in self.kinds and other.kind in self.kinds:
                    found.setdefault(_sorted(own, other), meeting)
        return self._foreign[a, b]

    @cached_property
    def _foreign(self) -> dict[tuple[int, int], dict[Docking, Meeting]]:
        return {}

    def name(self, channel: Channel) -> str:
        """`2.a+1->3.b`."""
        a, b, c = (self.parts[n].name for n in channel)
        return f"{a}+{b}->{c}"

    def reached(self, joins: Iterable[Channel]) -> set[int]:
        """The parts that free cubes can become."""
        found, before = {0}, 0
        joins = list(joins)
        while len(found) > before:
            before = len(found)
            found |= {join.c for join in joins if join.a in found and join.b in found}
            found |= {part for broken in self.breaks if broken.c in found for part in broken[:2]}
        return found

    def leading_home(self, joins: Iterable[Channel], reached: set[int]) -> set[int]:
        """The parts, of those that are reached, which can become part of the target."""
        target = len(self.parts) - 1
        home, before = {target} & reached, 0
        joins = [join for join in joins if join.a in reached and join.b in reached]
        falls = [broken for broken in self.breaks if broken.c in reached]
        while len(home) > before:
            before = len(home)
            home |= {part for join in joins if join.c in home for part in join[:2]}
            home |= {broken.c for broken in falls if not home.isdisjoint(broken[:2])}
        return home


def planned(dockings: Dockings, senses: Senses, breaks: bool = True) -> Plan:
    """The plan of a target whose cubes sense that much; breaks : whether bonds break."""
    joins: dict[Channel, dict[Docking, dict[Wave, Meeting]]] = {}
    for (a, b, c), ways in dockings.made.items():
        found = joins[Channel(a, b, c)] = {}
        before = (*dockings.parts.parts[a].unknowns, *dockings.parts.parts[b].unknowns)
        for (first, second, meeting), cubes in ways:
            dockings.tick()
            own, other = first.sensed(senses), second.sensed(senses)
            partner = cubes[len(dockings.parts.parts[a]) + meeting.j]
            wave = _wave(dockings.parts.parts[c], c, cubes, before, ((cubes[meeting.i], own), (partner, other)))
            found.setdefault(_sorted(own, other), {}).setdefault(wave, meeting)
    ways_of = {
        join: {docking: Way(next(iter(waves.values())), tuple(waves)) for docking, waves in ways.items()}
        for join, ways in joins.items()
    }
    return Plan(dockings, senses, ways_of, _breaks(dockings) if breaks else {})


def _breaks(dockings: Dockings) -> dict[Channel, tuple[Wave, ...]]:
    """Every break of every part."""
    found: dict[Channel, dict[Wave, None]] = {}
    for channel, waves in _broken(dockings):
        found.setdefault(channel, {}).update(dict.fromkeys(waves))
    return {channel: tuple(waves) for channel, waves in sorted(found.items())}


def _broken(dockings: Dockings) -> Iterator[tuple[Channel, list[Wave]]]:
    """The break of each bond of each part, with the waves in the two pieces."""
    for number, part in enumerate(dockings.parts.parts):
        structure = part.structure
        for i, j in structure.bonds:
            dockings.tick()
            sides = structure.sides(i, j)
            if sides is None:
                continue
            waves = []
            for own, gone, members in ((i, j, sides[0]), (j, i, sides[1])):
                loss = Loss(part.unknowns[own], part.unknowns[gone], part.around(own, gone))
                piece = structure.part(members)
                known = dockings.parts.known(piece)
                assert known is not None  # noqa: S101  a piece of a part is one
                before = tuple(part.unknowns[cube] for cube in members)
                writers = ((known[1][members.index(own)], loss),)
                waves.append(_wave(dockings.parts.parts[known[0]], *known, before, writers))
            small, large = sorted(wave.part for wave in waves)
            yield Channel(large, small, number), waves


def _wave(
    part: Part,
    number: int,
    cubes: tuple[int, ...],
    before: tuple[int, ...],
    writers: tuple[tuple[int, Reading | Loss], ...],
) -> Wave:
    """The wave in a part whose cubes were given in another order; waves that symmetry makes alike come as one."""
    was = dict(zip(cubes, before, strict=True))
    alike = []
    for symmetry in part.symmetries:
        moved = {symmetry[cube]: was[cube] for cube in was}
        ends = tuple(sorted(((symmetry[cube], reading) for cube, reading in writers), key=repr))
        alike.append(Wave(number, tuple(moved[cube] for cube in range(len(moved))), ends))
    return min(alike, key=repr) if len(alike) > 1 else alike[0]


def _sorted(a: Reading, b: Reading) -> Docking:
    return (a, b) if a <= b else (b, a)
