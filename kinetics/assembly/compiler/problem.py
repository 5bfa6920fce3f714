"""What a search for letters has to meet: the parts of a plan, and the joins that there may and must be."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property

from kinetics.assembly.compiler.choices import sensible
from kinetics.assembly.compiler.plan import Channel, Docking, Plan, Reading


@dataclass(frozen=True, eq=False)
class Problem:
    """A plan, with the joins that there may be and those that there must be.

    allowed : joins that a book may have; required : those of them that it must have
    """

    plan: Plan
    breaks: bool
    allowed: frozenset[Channel]
    required: frozenset[Channel]

    @classmethod
    def of(cls, plan: Plan, joins: Iterable[Channel], breaks: bool) -> Problem:
        """With these joins and no others."""
        joins = frozenset(joins)
        return cls(plan, breaks, joins, joins)

    @cached_property
    def parts(self) -> tuple[int, ...]:
        """The parts that free cubes may become, in the order of the search."""
        return tuple(sorted(self.plan.reached(self.allowed, self.breaks)))

    @cached_property
    def stable(self) -> dict[int, tuple[tuple[int, tuple[int, ...]], ...]]:
        """Of each part the cubes at rest with their neighbours, as unknowns."""
        found = {}
        for part in self.parts:
            structure, unknowns = self.plan.parts[part].structure, self.plan.parts[part].unknowns
            cubes = {
                (unknowns[cube], tuple(sorted(unknowns[n] for n in structure.neighbours(cube)))): None
                for cube in range(len(structure))
            }
            found[part] = tuple(cubes)
        return found

    @cached_property
    def shown(self) -> dict[tuple[object, ...], int]:
        """The kinds of readings in joins, numbered; nothing else is ever open."""
        readings = (r for channel in sorted(self.allowed) for docking in self.plan.joins[channel] for r in docking)
        return {kind: number for number, kind in enumerate(dict.fromkeys(map(shown_of, readings)))}

    @cached_property
    def meetings(self) -> dict[tuple[int, int], dict[Channel | None, list[Docking]]]:
        """What two cubes may read where two parts meet, by what the parts would make; None: no part of the target."""
        found: dict[tuple[int, int], dict[Channel | None, list[Docking]]] = {}
        for channel, ways in self.plan.joins.items():
            found.setdefault(channel[:2], {})[channel] = list(ways)
        for docking, meeting in self.plan.foreign.items():
            found.setdefault((meeting.a, meeting.b), {}).setdefault(None, []).append(docking)
        return found

    def foreign(self, a: int, b: int) -> list[Docking]:
        """What two cubes read where the parts a >= b meet and would make no part of the target."""
        together = len(self.plan.parts[a]) + len(self.plan.parts[b])
        if together > len(self.plan.parts[-1]):
            return list(self.plan.excess(a, b))
        return self.meetings.get((a, b), {}).get(None, [])

    def joins_of(self, a: int, b: int) -> list[Channel]:
        """The joins of two parts, allowed or not."""
        return [channel for channel in self.meetings.get((a, b), {}) if channel is not None]

    def is_hopeful(self, chosen: frozenset[Channel], refused: frozenset[Channel]) -> bool:
        """Whether the joins that are not decided yet may still make a book of those that are chosen."""
        left = self._left.get(refused)
        if left is None:
            left = self._left[refused] = sensible(self.plan, self.allowed - refused, self.breaks)
        return bool(left) and chosen | self.required <= left

    @cached_property
    def _left(self) -> dict[frozenset[Channel], frozenset[Channel]]:
        """What was found sensible once: the same joins are refused under many letters."""
        return {}


def shown_of(reading: Reading) -> tuple[object, ...]:
    """All of a reading but the letters."""
    return (
        reading.face,
        reading.partner_face,
        reading.roll,
        len(reading.around),
        reading.across < 0,
        len(reading.touched or ()),
    )
