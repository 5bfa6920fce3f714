"""Encounters that cubes cannot distinguish from a join, whatever their letters."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import NamedTuple

from kinetics.assembly.compiler.dockings import Meeting
from kinetics.assembly.compiler.joins import sensible
from kinetics.assembly.compiler.plan import Channel, Plan


class Clash(NamedTuple):
    """A meeting that must not bond although its two cubes read what they read in joins.

    meeting : the one that must not; made : the part it would make, None: no part of the target
    joins : for each of the two cubes, a join in which a cube reads the same, and how it goes
    """

    meeting: Meeting
    made: Channel | None
    joins: tuple[tuple[Channel, Meeting], tuple[Channel, Meeting]]

    @property
    def blamed(self) -> frozenset[Channel]:
        """The joins without which there would be no clash."""
        return frozenset(channel for channel, _ in self.joins)

    @property
    def is_direct(self) -> bool:
        """Both cubes read what the two read in one and the same join."""
        return self.joins[0] == self.joins[1]


def clashes(plan: Plan, joins: Iterable[Channel]) -> Iterator[Clash]:
    """Meetings that a set of joins cannot keep apart from its joins."""
    chosen = frozenset(joins)
    for parts in sorted({channel[:2] for channel in chosen}):
        for docking, meeting, made in plan.doubtful[parts]:
            if made in chosen:
                continue
            first, second = ([one for one in plan.readings[r].items() if one[0] in chosen] for r in docking)
            if first and second:
                same = next(((one, one) for one in first if one in second), (first[0], second[0]))
                yield Clash(meeting, made, same)


def obstacles(plan: Plan, asked: Iterable[Channel]) -> list[Clash]:
    """Clashes that stand in the way: one that cannot be avoided by leaving out joins, if there is such; else one after
    another, each with the joins of those before left out, until too few are left.
    """
    left = frozenset(asked)
    found: list[Clash] = []
    for clash in {clash.blamed: clash for clash in clashes(plan, left)}.values():
        if not sensible(plan, left - clash.blamed):
            return [clash]
    while sensible(plan, left) and (following := next(clashes(plan, left), None)):
        found.append(following)
        left -= following.blamed
    return found
