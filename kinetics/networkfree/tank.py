"""The state of a network-free run: structures, the faces that may bond, and the bonds that may break.

Structures that look alike are counted together, and faces are grouped by what they show and by the size of their
structure, so that the rate constants of all pairs of faces from two groups differ by the number touched alone, which
is known once a pair is drawn: pairs are drawn at the largest, and those of a smaller one are kept so much less often. A
bond breaks at its constant times the weights of all that can break it: every other body by its size, the wall, and the
structure itself.
"""

from __future__ import annotations

from bisect import bisect_right
from collections import defaultdict
from collections.abc import Callable, Mapping
from contextlib import suppress
from itertools import accumulate
from math import isfinite
from typing import NamedTuple

import numpy as np

from kinetics.assembly.deriving.ways import RateClass, touched
from kinetics.assembly.faces import scheme_of
from kinetics.assembly.rules.rule_book import RuleBook, View
from kinetics.assembly.structure import Structure, placements
from kinetics.support.arrays import Floats

Rate = Callable[[RateClass], float]  # rate constant of a class, 1/tu
FaceGroup = int  # number of: cubes of the structure, what its face shows
SIDES = 6  # of a cube
MAX_REMEMBERED = 200_000  # outcomes, and structures, kept for when they come again


class Breakers(NamedTuple):
    """Weights of the causes of a break.

    of_size : of a body of so many cubes; fixed : of the wall and of the structure alone
    """

    of_size: Callable[[int], float]
    fixed: float


ALONE = Breakers(lambda _: 0.0, 1.0)  # breaks of first order


class StructureKind:
    """Structures that look alike: the faces they show, group by group, and the bonds that may break, with classes."""

    __slots__ = ("bond_classes", "bonds", "faces", "structure")

    def __init__(self, known: Known, structure: Structure):
        self.structure = structure
        self.faces: dict[FaceGroup, list[tuple[int, int]]] = {}  # (cube, face) that show it
        self.bonds: list[tuple[int, int]] = []
        self.bond_classes: list[RateClass] = []
        book, size = known.book, len(structure)
        for cube, face in structure.open_faces():
            view = book.view(structure, cube, face)
            if view is not None:
                self.faces.setdefault(known.group(size, view), []).append((cube, face))
        if book.semantics.bonds == "break":
            for bond, (near, far) in bridges(structure):
                faces = [structure.face_towards(c, structure.positions[d]) for c, d in (bond, bond[::-1])]
                self.bonds.append(bond)
                self.bond_classes.append(
                    class_between("break", (near, known.types[faces[0]]), (far, known.types[faces[1]]))
                )


class BondRates(NamedTuple):
    """Constants of a kind's bonds, 1/tu. sums : added up one by one; total : of all; weight : its own as a partner"""

    sums: list[float]
    total: float
    weight: float


class Joined(NamedTuple):
    """The product of a pair of faces, and the class of their join."""

    kind: StructureKind
    rate_class: RateClass


TankEvent = tuple[tuple[StructureKind, ...], tuple[StructureKind, ...]]  # taken, made


def class_between(event: str, first: tuple[int, str], second: tuple[int, str]) -> RateClass:
    """The class of an event of two sides, each its number of cubes and its face type."""
    (n, face), (m, other) = sorted((first, second))
    return RateClass(event, (n, m), (face, other))


class Known:
    """A cache of kinds, rate constants and outcomes of joins, shared by all runs; it changes no run."""

    def __init__(self, book: RuleBook, rate: Rate, breakers: Breakers = ALONE):
        self.book, self.rate, self.breakers = book, rate, breakers
        self.types = scheme_of(book.scheme).types
        self.kinds: dict[Structure, StructureKind] = {}
        self.joins: dict[object, Joined | None] = {}
        self.breaks: dict[object, tuple[StructureKind, StructureKind]] = {}
        self.constants: dict[RateClass, float] = {}
        self.groups: dict[tuple[int, View], FaceGroup] = {}
        self.shown: list[tuple[int, View]] = []
        self.classes: dict[FaceGroup, dict[FaceGroup, RateClass | None]] = defaultdict(dict)  # None: they never bond
        self.highest: dict[RateClass, float] = {}
        self.bonds: dict[StructureKind, BondRates] = {}

    def under(self, rate: Rate, breakers: Breakers) -> Known:
        """A copy that shares kinds and outcomes, under other rates."""
        other = Known(self.book, rate, breakers)
        other.kinds, other.joins, other.breaks = self.kinds, self.joins, self.breaks
        other.groups, other.shown, other.classes = self.groups, self.shown, self.classes
        return other

    def bond_rates(self, kind: StructureKind) -> BondRates:
        """The constants of a kind's bonds, added up one by one, and the weight by which it breaks others."""
        found = self.bonds.get(kind)
        if found is None:
            sums = list(accumulate(map(self.constant, kind.bond_classes)))
            weight = float(self.breakers.of_size(len(kind.structure)))
            found = self.bonds[kind] = BondRates(sums, sums[-1] if sums else 0.0, weight)
        return found

    def kind(self, structure: Structure) -> StructureKind:
        """The kind of a structure, found once for each canonical form."""
        canonical = structure.canonical(self.book.scheme)
        found = self.kinds.get(canonical)
        if found is None:
            found = self.kinds[canonical] = StructureKind(self, canonical)
        return found

    def constant(self, rate_class: RateClass) -> float:
        """Rate constant of a class, 1/tu."""
        if rate_class not in self.constants:
            value = self.rate(rate_class)
            if not (isinstance(value, int | float | np.number) and isfinite(value) and value >= 0):
                raise ValueError(f"the rate of class `{rate_class}` is {value!r}; expected a number >= 0, in 1/tu")
            self.constants[rate_class] = float(value)
        return self.constants[rate_class]

    def group(self, size: int, view: View) -> FaceGroup:
        """The number of a group of faces."""
        number = self.groups.setdefault((size, view), len(self.shown))
        if number == len(self.shown):
            self.shown.append((size, view))
        return number

    def pair(self, a: FaceGroup, b: FaceGroup) -> RateClass | None:
        """The class of joins at a pair of faces if one is touched; None if the book lets them bond nowhere."""
        if b not in self.classes[a]:
            (n, view), (m, other) = self.shown[a], self.shown[b]
            allowed = self.book.allows(view, other)
            found = class_between("join", (n, view.face), (m, other.face)) if allowed else None
            self.classes[a][b] = self.classes[b][a] = found
        return self.classes[a][b]

    def strength(self, rate_class: RateClass) -> float:
        """The rate at which a pair of faces is drawn, 1/tu: the largest constant, whatever number is touched.

        Not all of these joins can happen; one without a rate is refused when it does.
        """
        if rate_class not in self.highest:
            n, m = rate_class.sizes
            known = []
            for number in range(1, min(SIDES * min(n, m), n * m) + 1):
                with suppress(ValueError):
                    known.append(self.constant(rate_class._replace(touched=number)))
            self.highest[rate_class] = max(known) if known else self.constant(rate_class)
        return self.highest[rate_class]

    def joined(
        self, a: StructureKind, i: int, face_i: int, b: StructureKind, j: int, face_j: int, twist: int
    ) -> Joined | None:
        """The product of a face of a and one of b at one of the four twists; None if they do not bond."""
        key = (a, i, face_i, b, j, face_j, twist)
        if key not in self.joins:
            placement = placements(a.structure, i, face_i, b.structure, j, face_j)[twist]
            made = self.book.join(a.structure, i, b.structure, j, placement)
            if made is None:
                self.joins[key] = None
            else:
                n = len(a.structure)
                rate_class = class_between("join", (n, self.types[face_i]), (len(b.structure), self.types[face_j]))
                self.joins[key] = Joined(self.kind(made), rate_class._replace(touched=touched(made, n)))
        return self.joins[key]

    def parted(self, kind: StructureKind, i: int, j: int) -> tuple[StructureKind, StructureKind]:
        """The two parts left when the bond of cubes i and j breaks; i writes first if the book sets an order."""
        key = (kind, i, j)
        if key not in self.breaks:
            (_, first), (_, second) = self.book.break_bond(kind.structure, i, j)
            self.breaks[key] = self.kind(first), self.kind(second)
        return self.breaks[key]

    def forget(self, all_but: Mapping[StructureKind, int]) -> None:
        """Keep memory bounded when few structures recur."""
        if max(len(self.joins), len(self.breaks), len(self.kinds)) > MAX_REMEMBERED:
            self.joins.clear()
            self.breaks.clear()
            self.classes.clear()
            self.bonds.clear()
            self.kinds.clear()  # in place, because others may share it
            self.kinds.update((kind.structure, kind) for kind in all_but)


class GrowingTank:
    """The structures of one run, and how fast their faces and bonds act.

    Each group of faces has a slot: n faces, the kinds that show it, and its strength towards every other slot. Slots
    of groups that are gone are used again.
    """

    def __init__(self, known: Known, initial: Mapping[Structure, int]):
        self.known = known
        self.counts: dict[StructureKind, int] = {}
        self.slots: dict[FaceGroup, int] = {}
        self.free: list[int] = []
        self.members: list[dict[StructureKind, list[tuple[int, int]]]] = []
        self.n = np.zeros(0)
        self.strengths = np.zeros((0, 0))
        for structure, copies in initial.items():
            self.add(known.kind(structure), copies)

    def add(self, kind: StructureKind, copies: int) -> None:
        """Put copies in, or take them out where negative."""
        count = self.counts.get(kind, 0) + copies
        if count:
            self.counts[kind] = count
        else:
            self.counts.pop(kind, None)
        for group, faces in kind.faces.items():
            slot = self.slots.get(group)
            if slot is None:
                slot = self.opened(group)
            self.n[slot] += copies * len(faces)
            if count:
                self.members[slot][kind] = faces
            else:
                self.members[slot].pop(kind, None)
                if not self.members[slot]:
                    self.close(group)

    def opened(self, group: FaceGroup) -> int:
        """A slot for a group that was not there."""
        if not self.free:
            old, new = len(self.n), 2 * len(self.n) + 8
            self.n = np.append(self.n, np.zeros(new - old))
            larger = np.zeros((new, new))
            larger[:old, :old] = self.strengths
            self.strengths = larger
            self.members.extend({} for _ in range(old, new))
            self.free.extend(range(new - 1, old - 1, -1))
        slot = self.slots[group] = self.free.pop()
        known = self.known.classes[group]
        for other, place in self.slots.items():
            rate_class = known[other] if other in known else self.known.pair(group, other)
            if rate_class is not None:  # most pairs never bond
                self.strengths[slot, place] = self.strengths[place, slot] = self.known.strength(rate_class)
        return slot

    def close(self, group: FaceGroup) -> None:
        """Free the slot of a group that is gone."""
        slot = self.slots.pop(group)
        self.strengths[slot] = self.strengths[:, slot] = 0.0
        self.free.append(slot)

    def happens(self, event: TankEvent) -> None:
        """Take out what an event takes, put in what it makes."""
        for kinds, copies in zip(event, (-1, 1), strict=True):
            for kind in kinds:
                self.add(kind, copies)
        self.known.forget(self.counts)

    def rates(self) -> tuple[Floats, float]:
        """Rates at which pairs of faces are drawn, summed up slot by slot, each pair in both orders; and of breaks."""
        drawn = np.cumsum(self.n * (self.strengths @ self.n))
        return drawn, sum(self.breaking().values())

    def breaking(self) -> dict[StructureKind, float]:
        """Rate at which a bond of each kind of structure breaks, 1/tu; no structure is its own partner."""
        rated = [(kind, copies, self.known.bond_rates(kind)) for kind, copies in self.counts.items()]
        around = self.known.breakers.fixed + sum(copies * rates.weight for _, copies, rates in rated)
        return {
            kind: copies * rates.total * max(around - rates.weight, 0.0) for kind, copies, rates in rated if rates.total
        }

    def face(self, slot: int, uniform: float) -> tuple[StructureKind, int, int, int]:
        """One of a slot's faces, all as likely: kind, number of the copy, cube, face."""
        left = int(uniform * self.n[slot])
        for kind, faces in self.members[slot].items():
            held = self.counts[kind] * len(faces)
            if left < held:
                copy, place = divmod(left, len(faces))
                return kind, copy, *faces[place]
            left -= held
        raise AssertionError("a slot holds fewer faces than it counts")

    def join(self, drawn: Floats, draw: Callable[[], float]) -> TankEvent | None:
        """Draw a pair of faces and a twist: kinds before and after, or None if nothing comes of it."""
        slot = int(np.searchsorted(drawn, draw() * drawn[-1], side="right"))
        towards = np.cumsum(self.strengths[slot] * self.n)
        other = int(np.searchsorted(towards, draw() * towards[-1], side="right"))
        a, copy_a, i, face_i = self.face(slot, draw())
        b, copy_b, j, face_j = self.face(other, draw())
        twist = int(4 * draw())
        if a is b and copy_a == copy_b:
            return None
        # Both orders are as likely, and the first writes first; otherwise the smaller is put into the larger's lattice.
        if self.known.book.semantics.update == "synchronous" and len(a.structure) < len(b.structure):
            a, i, face_i, b, j, face_j = b, j, face_j, a, i, face_i
        found = self.known.joined(a, i, face_i, b, j, face_j, twist)
        if found is None:
            return None
        own, drawn_at = self.known.constant(found.rate_class), float(self.strengths[slot, other])
        if own < drawn_at and draw() * drawn_at >= own:
            return None
        return (a, b), (found.kind,)

    def part(self, draw: Callable[[], float], total: float) -> TankEvent:
        """Draw a bond that breaks: kinds before and after."""
        left = draw() * total
        breaking = {kind: rate for kind, rate in self.breaking().items() if rate}
        kind = next(reversed(breaking))  # where rounding leaves none
        for candidate, rate in breaking.items():
            left -= rate
            if left < 0:
                kind = candidate
                break
        sums = self.known.bond_rates(kind).sums
        bond = kind.bonds[bisect_right(sums, draw() * sums[-1])]
        if self.known.book.semantics.update == "sequential" and draw() < 0.5:  # either cube may write first
            bond = bond[::-1]
        return (kind,), self.known.parted(kind, *bond)


def bridges(structure: Structure) -> list[tuple[tuple[int, int], tuple[int, int]]]:
    """The bonds (i, j) that hold two parts together, with the numbers of cubes on i's and on j's side.

    One walk through all bonds (Tarjan 1974): a bond is in a loop where a later cube reaches back past it.
    """
    n = len(structure)
    entered, reaches, beyond = [-1] * n, [0] * n, [1] * n
    found = []
    entered[0], clock = 0, 1
    way = [(0, -1, iter(structure.neighbours(0)))]
    while way:
        cube, before, neighbours = way[-1]
        for other in neighbours:
            if other == before:
                continue
            if entered[other] < 0:
                entered[other] = reaches[other] = clock
                clock += 1
                way.append((other, cube, iter(structure.neighbours(other))))
                break
            reaches[cube] = min(reaches[cube], entered[other])
        else:
            way.pop()
            if way:
                reaches[before] = min(reaches[before], reaches[cube])
                beyond[before] += beyond[cube]
                if reaches[cube] > entered[before]:
                    found.append(((before, cube), (n - beyond[cube], beyond[cube])))
    return found
