"""Why there is no rule book: meetings that cubes cannot distinguish from a join, whatever their letters."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import Any, NamedTuple

from kinetics.assembly.compiler.dockings import Meeting
from kinetics.assembly.compiler.joins import sensible
from kinetics.assembly.compiler.plan import Channel, Plan
from kinetics.assembly.faces import roll, scheme_of
from kinetics.assembly.structure import Structure

TOPS = {4, 5}  # top and bottom
SHOWN = 3


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


def _situations(plan: Plan, clash: Clash) -> str:
    """The two situations that cubes cannot tell apart."""
    (first, example), (second, other) = clash.joins
    lines = [f"the join {plan.name(first)} must form{_twist(plan, example)}:", *_drawn(plan, example)]
    if not clash.is_direct:
        lines += [f"and so must {plan.name(second)}{_twist(plan, other)}:", *_drawn(plan, other)]
    makes = "no part of the target" if clash.made is None else f"{plan.name(clash.made)}, which is left out"
    lines += [f"but this must not{_twist(plan, clash.meeting)}, for it makes {makes}:", *_drawn(plan, clash.meeting)]
    alike = "these two read the same" if clash.is_direct else "each of these two reads what a cube reads that must bond"
    return "\n".join([*lines, f"and {alike}, whatever the letters are"])


def _twist(plan: Plan, meeting: Meeting) -> str:
    """How the two cubes are twisted against each other, if it is not the same at any twist."""
    a, b = plan.parts[meeting.a].structure, plan.parts[meeting.b].structure.moved(meeting.placement)
    scheme, face = plan.senses.faces, a.face_towards(meeting.i, b.positions[meeting.j])
    other = b.face_towards(meeting.j, a.positions[meeting.i])
    if scheme == "two" and not {face, other} & TOPS:
        return f", axes {roll(scheme, a.rotations[meeting.i], face, b.rotations[meeting.j])}"
    if scheme == "six":
        twist = roll(scheme, a.rotations[meeting.i], face, b.rotations[meeting.j])
        types = scheme_of(scheme).types
        return f", {types[face]} on {types[other]} at a twist of {twist} degrees"
    return ""


def in_words(plan: Plan, clashes: list[Clash]) -> str:
    """One clash after another, the first few."""
    text = "\nand without this join:\n".join(_situations(plan, clash) for clash in clashes[:SHOWN])
    return text + (f"\nand so on: {len(clashes) - SHOWN} more" if len(clashes) > SHOWN else "")


def situations(plan: Plan, clashing: Iterable[Clash]) -> dict[str, Any]:
    """The target as it is turned, and one clash for every set of joins that clash, as plain numbers for a certificate:
    cubes (x, y, z, rotation) of two parts, and which two of them dock, where they must and where they must not.
    """

    def cubes(structure: Structure) -> list[list[int]]:
        return [[*place, r] for place, r in zip(structure.positions, structure.rotations, strict=True)]

    def plain(meeting: Meeting) -> dict[str, Any]:
        a, b = plan.parts[meeting.a].structure, plan.parts[meeting.b].structure.moved(meeting.placement)
        return {"parts": [cubes(a), cubes(b)], "docking": [meeting.i, meeting.j]}

    found = {clash.blamed: clash for clash in clashing if clash.made is None}
    return {
        "whole": cubes(plan.target.structure(plan.senses.faces)),
        "pairs": [
            {"must": [plain(example) for _, example in clash.joins], "must_not": plain(clash.meeting)}
            for clash in found.values()
        ],
    }


def choice(plan: Plan, joins: Iterable[Channel]) -> str:
    """`1+1->2, 2+1->3`."""
    return ", ".join(map(plan.name, sorted(joins)))


def _drawn(plan: Plan, meeting: Meeting) -> list[str]:
    """The two parts side by side, cubes of one as o and of the other as x, capital where they dock; layers from the
    lowest up.
    """
    a, b = plan.parts[meeting.a].structure, plan.parts[meeting.b].structure
    first = ["O" if cube == meeting.i else "o" for cube in range(len(a))]
    second = ["X" if cube == meeting.j else "x" for cube in range(len(b))]
    made = a.with_letters(first).joined(b.with_letters(second).moved(meeting.placement))
    return ["    " + row for row in made.drawn().splitlines()]
