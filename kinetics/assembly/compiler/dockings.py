"""Every way in which two parts of a target can meet, as arrays: whatever cubes sense, the geometry is the same.

What cubes with all senses would read is found once for each pair of parts; a plan takes from it what its cubes sense.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache, cached_property
from typing import NamedTuple

import numpy as np

from kinetics.assembly.compiler.parts import Part, Parts
from kinetics.assembly.compiler.target import PLACEHOLDER, Target
from kinetics.assembly.faces import FACE_NORMALS, ROTATIONS, IntArray, compose, roll, scheme_of, turned
from kinetics.assembly.rules.conditions import Senses
from kinetics.assembly.structure import Placement, Structure

SPAN = 64  # of the code of a translation, along each axis


class Meeting(NamedTuple):
    """Cube i of part a and cube j of part b side by side, b put into a's lattice."""

    a: int
    i: int
    b: int
    j: int
    placement: Placement


class Seen(NamedTuple):
    """What a cube shows at an open face, letters as unknowns: its own, its face's type, its neighbours', that across
    (-1 for no cube).
    """

    own: int
    face: str
    around: tuple[int, ...]
    across: int


class Reading(NamedTuple):
    """What a cube reads as it docks; letters as unknowns, multisets sorted, -1 for no cube. None: not sensed."""

    own: int
    face: str
    around: tuple[int, ...]
    across: int
    partner: int
    partner_face: str
    roll: str | None
    touched: tuple[int, ...] | None

    @classmethod
    def of(cls, own: Seen, other: Seen, roll: str | None, touched: tuple[int, ...]) -> Reading:
        """With all senses."""
        return cls(*own, other.own, other.face, roll, touched)

    @property
    def kind(self) -> tuple[object, ...]:
        """All but the letters."""
        n_touched = len(self.touched or ())
        return self.face, self.partner_face, self.roll, len(self.around), self.across < 0, n_touched

    def sensed(self, senses: Senses) -> Reading:
        """What of it cubes with these senses read."""
        return self._replace(
            across=self.across if senses.across else -1,
            roll=self.roll if senses.roll else None,
            touched=self.touched if senses.touched else None,
        )


Met = tuple[Reading, Reading, Meeting]  # what two cubes read that meet, and an example


@dataclass(frozen=True, eq=False)
class _Sites:
    """The open faces of a part in every turn that looks different, a row each: turn, cube, direction, what it shows.

    turns : rotations (n_turns,); places : of the cubes in each turn (n_turns, n, 3); rotations : of these (n_turns, n)
    seen : all that faces show, each once
    """

    turns: IntArray
    places: IntArray
    rotations: IntArray
    rows: IntArray
    seen: tuple[Seen, ...]

    @classmethod
    def of(cls, part: Part, scheme: str, turns: IntArray) -> _Sites:
        structure, types = part.structure, scheme_of(scheme).types
        seen: dict[Seen, int] = {}
        faces = []
        for cube, face in structure.open_faces():
            across = structure.cube_at(structure.faced(cube, face ^ 1))
            shown = Seen(
                part.unknowns[cube], types[face], part.around(cube), -1 if across is None else part.unknowns[across]
            )
            direction = int(turned[structure.rotations[cube], face])
            faces.append((cube, direction, seen.setdefault(shown, len(seen))))
        rows = [(n, cube, int(turned[r, d]), shown) for n, r in enumerate(turns) for cube, d, shown in faces]
        places = np.array(structure.positions) @ ROTATIONS[turns].transpose(0, 2, 1)
        return cls(turns, places, compose[turns][:, list(structure.rotations)], np.array(rows), tuple(seen))


class Dockings:
    """The parts of a target whose cubes have these faces, and how they meet.

    tick : called again and again; it may raise to end the work
    """

    def __init__(self, target: Target, faces: str, tick: Callable[[], None] = lambda: None):
        self.target, self.faces, self.tick = target, faces, tick
        self.parts = Parts(target.structure(faces), faces, tick)
        self._sites: dict[tuple[int, bool], _Sites] = {}
        self._foreign: dict[tuple[int, int], list[Met]] = {}

    @property
    def made(self) -> dict[tuple[int, int, int], list[tuple[Met, tuple[int, ...]]]]:
        """How parts a >= b meet that make a part c of the target, with which of its cubes each of theirs becomes."""
        return self._made[0]

    @property
    def ways(self) -> dict[tuple[int, int, int], float]:
        """The pairs of faces at which parts a >= b make a part c, each of the four twists a quarter."""
        return self._made[1]

    @cached_property
    def _made(
        self,
    ) -> tuple[dict[tuple[int, int, int], list[tuple[Met, tuple[int, ...]]]], dict[tuple[int, int, int], float]]:
        found: dict[tuple[int, int, int], list[tuple[Met, tuple[int, ...]]]] = {}
        counts: dict[tuple[int, int, int], float] = {}
        sizes = [len(part) for part in self.parts.parts]
        for a in range(len(sizes)):
            for b in range(a + 1):
                if sizes[a] + sizes[b] <= sizes[-1]:
                    contacts = _Contacts(self, a, b)
                    alike = len(self.parts.parts[b].symmetries)  # turns of b that are one row
                    for number, (part, cubes) in contacts.known.items():
                        rows = contacts.placement == number
                        for met in contacts.rows(rows):
                            found.setdefault((a, b, part), []).append((met, cubes))
                        counts[a, b, part] = counts.get((a, b, part), 0.0) + alike * int(rows.sum()) / 4
        return dict(sorted(found.items())), counts

    @cached_property
    def kinds(self) -> frozenset[tuple[str, str, int]]:
        """A face's type, its partner's, and how many neighbours there are, of all cubes that meet in `made`."""
        both = (reading for ways in self.made.values() for met, _ in ways for reading in met[:2])
        return frozenset((reading.face, reading.partner_face, len(reading.around)) for reading in both)

    def foreign(self, a: int, b: int) -> list[Met]:
        """How parts a >= b meet that make no part of the target, each pair of cubes that read the same once; left out
        where they look unlike all cubes that meet to make one (see `kinds`).
        """
        if (a, b) not in self._foreign:
            contacts = _Contacts(self, a, b)
            self._foreign[a, b] = contacts.rows(contacts.is_foreign & contacts.are_of(self.kinds))
        return self._foreign[a, b]

    def sites(self, part: int, is_turned: bool) -> _Sites:
        """The open faces of a part, as it is or in every turn."""
        if (part, is_turned) not in self._sites:
            own = self.parts.parts[part]
            turns = self.parts.turns(own) if is_turned else np.zeros(1, np.int64)
            self._sites[part, is_turned] = _Sites.of(own, self.faces, turns)
        return self._sites[part, is_turned]


class _Contacts:
    """Faces of part b, in every turn and at every place, on faces of part a: a row for each two that touch.

    first, second : rows of their sites; placement : which of `moves` (turn and translation); no cubes overlap
    """

    def __init__(self, dockings: Dockings, a: int, b: int):
        dockings.tick()
        self.dockings, self.a, self.b = dockings, a, b
        self.own, self.other = dockings.sites(a, False), dockings.sites(b, True)
        pairs = [
            np.meshgrid(*(np.flatnonzero(s.rows[:, 2] == d) for s, d in ((self.own, d), (self.other, d ^ 1))))
            for d in range(6)
        ]
        first, second = (np.concatenate([pair[n].ravel() for pair in pairs]) for n in (0, 1))
        (_, i, direction, _), (turn, j, _, _) = self.own.rows[first].T, self.other.rows[second].T
        codes = _code(turn, self.own.places[0, i] + FACE_NORMALS[direction] - self.other.places[turn, j])
        on_it = self.own.places[0][None, :, None] - self.other.places[:, None]
        overlapping = _code(np.arange(len(self.other.turns))[:, None, None], on_it)
        free = ~np.isin(codes, overlapping)
        self.first, self.second = first[free], second[free]
        self.moves, start, self.placement = np.unique(codes[free], return_index=True, return_inverse=True)
        self.turn = self.other.rows[self.second[start], 0]
        self.translation = np.stack([self.moves // SPAN**n % SPAN - SPAN // 2 for n in (2, 1, 0)], axis=1)

    @cached_property
    def known(self) -> dict[int, tuple[int, tuple[int, ...]]]:
        """The placements that make a part; which, and which of its cubes each becomes, a's first."""
        parts, n = self.dockings.parts, len(self.moves)
        if self.own.places.shape[1] + self.other.places.shape[1] > len(self.dockings.target):
            return {}
        own = np.broadcast_to(self.own.places, (n, *self.own.places.shape[1:]))
        places = np.concatenate([own, self.other.places[self.turn] + self.translation[:, None]], axis=1)
        own = np.broadcast_to(self.own.rotations, (n, own.shape[1]))
        rotations = np.concatenate([own, self.other.rotations[self.turn]], axis=1)
        found = {}
        for number in np.flatnonzero(parts.may_be_known(places, rotations)).tolist():
            cubes = tuple(map(tuple, places[number].tolist()))
            made = parts.known(
                Structure.unchecked(cubes, tuple(rotations[number].tolist()), (PLACEHOLDER,) * len(cubes))
            )
            if made is not None:
                found[number] = made
        return found

    @property
    def is_foreign(self) -> np.ndarray:
        """Rows whose placement makes no part."""
        return ~np.isin(self.placement, list(self.known))

    def are_of(self, kinds: frozenset[tuple[str, str, int]]) -> np.ndarray:
        """Rows of which either side is of some kind, as in `Dockings.kinds`."""
        good = [
            [
                (s.face, t.face, len(s.around)) in kinds and (t.face, s.face, len(t.around)) in kinds
                for t in self.other.seen
            ]
            for s in self.own.seen
        ]
        return np.asarray(np.array(good)[self.own.rows[self.first, 3], self.other.rows[self.second, 3]])

    def rows(self, chosen: np.ndarray) -> list[Met]:
        """Some of the rows, those once in which both sides read the same."""
        s, t = self.own.rows[self.first, 3], self.other.rows[self.second, 3]
        touched, touching = self._touched
        columns = [s, t, self._rolls, touched[1], touching[1]]
        code = np.ravel_multi_index([column[chosen] for column in columns], [int(c.max()) + 1 for c in columns])
        some = np.flatnonzero(chosen)[np.unique(code, return_index=True)[1]]
        found = []
        rolls = _rolls(self.dockings.faces)[1]
        for row in some.tolist():
            number = self.placement[row]
            r, move = int(self.other.turns[self.turn[number]]), self.translation[number].tolist()
            i, j = int(self.own.rows[self.first[row], 1]), int(self.other.rows[self.second[row], 1])
            own, other, twist = self.own.seen[s[row]], self.other.seen[t[row]], rolls[self._rolls[row]]
            found.append(
                (
                    Reading.of(own, other, twist, touched[0][touched[1][row]]),
                    Reading.of(other, own, twist, touching[0][touching[1][row]]),
                    Meeting(self.a, i, self.b, j, Placement(r, (move[0], move[1], move[2]))),
                )
            )
        return found

    @cached_property
    def _rolls(self) -> IntArray:
        (_, i, direction, _), (turn, j, _, _) = self.own.rows[self.first].T, self.other.rows[self.second].T
        table, _ = _rolls(self.dockings.faces)
        return np.asarray(table[self.own.rotations[0, i], direction, self.other.rotations[turn, j]])

    @cached_property
    def _touched(self) -> list[tuple[list[tuple[int, ...]], IntArray]]:
        """For either side, sets of unknowns that a cube touches of the other part, and which of these in each row."""
        i, j = self.own.rows[self.first, 1], self.other.rows[self.second, 1]
        return [
            _together(self.placement * 8 + i, j, self.dockings.parts.parts[self.b]),
            _together(self.placement * 8 + j, i, self.dockings.parts.parts[self.a]),
        ]


def _together(cube: IntArray, other: IntArray, part: Part) -> tuple[list[tuple[int, ...]], IntArray]:
    """The sets of unknowns that the cubes `other` of a part make in all rows of one cube; which set, in each row."""
    base, low = 7, min(part.unknowns)  # a cube touches six at most
    same = np.unique(cube, return_inverse=True)[1]
    weights = base ** (np.array(part.unknowns) - low)
    sums, which = np.unique(np.bincount(same, weights[other]).astype(np.int64), return_inverse=True)
    sets = [
        tuple(low + n for n in range(max(part.unknowns) - low + 1) for _ in range(code // base**n % base))
        for code in sums.tolist()
    ]
    return sets, which[same]


def _code(turn: IntArray, move: IntArray) -> IntArray:
    """A number for a turn and a translation (..., 3)."""
    x, y, z = np.moveaxis(move + SPAN // 2, -1, 0)
    return np.asarray(((turn * SPAN + x) * SPAN + y) * SPAN + z)


@cache
def _rolls(faces: str) -> tuple[IntArray, tuple[str | None, ...]]:
    """[rotation, direction, partner's rotation]: which twist, of those that there are (see `roll`)."""
    rolls = scheme_of(faces).rolls
    table = np.zeros((24, 6, 24), np.int64)
    if not rolls:
        return table, (None,)
    for own, face, other in np.ndindex(24, 6, 24):
        table[own, turned[own, face], other] = rolls.index(roll(faces, own, face, other))
    return table, rolls
