"""Sets of joins that a book may have, whatever its letters, by clauses.

Every part that there is can be made of others and becomes the target; no meeting that must not bond reads the same as
joins do, letter for letter.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from kinetics.assembly.compiler.clauses import Clauses
from kinetics.assembly.compiler.dockings import Reading
from kinetics.assembly.compiler.plan import Channel, Plan
from kinetics.assembly.compiler.target import check_join


class JoinSearch:
    """Sets of joins of a plan.

    allowed : those that a book may have
    parts : all that can be there; `present` has a literal for each of them, `open` for each join, `readings` for all
        that cubes read in joins, true where one of these is open
    """

    def __init__(self, plan: Plan, allowed: Iterable[Channel], clauses: Clauses):
        self.plan, self.clauses = plan, clauses
        self.allowed = sensible(plan, allowed)
        self.parts = sorted(plan.reached(self.allowed))
        self.present = {part: clauses.literal() for part in self.parts}
        self.open = {join: clauses.literal() for join in sorted(self.allowed)}
        self.readings: dict[Reading, int] = {}
        target = len(plan.parts) - 1
        clauses.add(*([self.present[target]] if target in self.present else []))
        for part in self.parts:
            makers = [literal for join, literal in self.open.items() if join.c == part]
            makers += [self.present[q] for q in self.parts if part in plan.pieces[q]]
            for piece in plan.pieces[part]:
                clauses.add(self.present[part] ^ 1, self.present[piece])
            clauses.add(*makers, self.present[part] ^ (part != 0))
        for join, is_open in self.open.items():
            for part in join:
                clauses.add(is_open ^ 1, self.present[part])
            for reading in (reading for docking in plan.joins[join] for reading in docking):
                if reading not in self.readings:
                    self.readings[reading] = clauses.literal()
                clauses.add(is_open ^ 1, self.readings[reading])
        for a, b in sorted({join[:2] for join in self.allowed}):
            for (first, second), _, made in plan.doubtful[a, b]:
                if first in self.readings and second in self.readings:
                    is_made = [self.open[made]] if made in self.open else []
                    clauses.add(self.readings[first] ^ 1, self.readings[second] ^ 1, *is_made)

    @property
    def chosen(self) -> frozenset[Channel]:
        """The joins that are open."""
        return frozenset(join for join, literal in self.open.items() if self.clauses.true[literal])

    def only(self, joins: Iterable[Channel]) -> list[int]:
        """Literals that are true if no other joins are open."""
        wanted = frozenset(joins)
        return [literal ^ 1 for join, literal in self.open.items() if join not in wanted]

    def holds(self, given: Iterable[int] = ()) -> bool:
        """Whether there is such a set with these literals true, written down as `chosen`."""
        given = list(given)
        while self.clauses.solve(given):
            if not self.is_broken():
                return True
        return False

    def is_broken(self) -> bool:
        """Whether what was found breaks a clause that was not written down yet; it is now.

        That is of parts that nothing makes but they themselves, or that never become the target.
        """
        there = {part for part, literal in self.present.items() if self.clauses.true[literal]}
        chosen, add = self.chosen, self.clauses.add
        reached = self.plan.reached(chosen)
        if lost := there - reached:
            ways = [lit for join, lit in self.open.items() if join.c in lost and lost.isdisjoint(join[:2])]
            ways += [self.present[p] for p in self.parts if p not in lost and lost & self.plan.pieces[p]]
        elif lost := reached - self.plan.leading_home(chosen, reached):
            ways = [lit for join, lit in self.open.items() if join.c not in lost and not lost.isdisjoint(join[:2])]
        for part in lost:
            add(self.present[part] ^ 1, *ways)
        return bool(lost)

    def within(self, joins: Iterable[Channel]) -> list[int]:
        """Literals that are true if some of these joins are open, and no others."""
        is_new, joins = self.clauses.literal(), frozenset(joins)
        self.clauses.add(is_new ^ 1, *(self.open[join] ^ 1 for join in joins))
        return [is_new, *self.only(joins)]

    def smallest(self) -> Iterator[frozenset[Channel]]:
        """Sets from which no join can be left out; each once."""
        while self.holds():
            found = self.chosen
            while self.holds(self.within(found)):
                found = self.chosen
            yield found
            self.clauses.add(*(self.open[join] ^ 1 for join in found))

    def every(self) -> Iterator[frozenset[Channel]]:
        """All sets, each once."""
        while self.holds():
            found = self.chosen
            yield found
            self.clauses.add(*(literal ^ (join in found) for join, literal in self.open.items()))


def sensible(plan: Plan, joins: Iterable[Channel]) -> frozenset[Channel]:
    """The joins left when those are dropped that cannot happen, or make what never becomes the target; none are
    left where they do not lead to the target.
    """
    kept = frozenset(joins)
    while True:
        reached = plan.reached(kept)
        bad = reached - plan.leading_home(kept, reached)
        for part in sorted(reached):  # what falls into lost parts must not be made either
            if not bad.isdisjoint(plan.pieces[part]):
                bad.add(part)
        good = frozenset(c for c in kept if c.a in reached and c.b in reached and c.c not in bad)
        if good == kept:
            return kept if len(plan.parts) - 1 in reached and not bad else frozenset()
        kept = good


def asked_joins(plan: Plan, joins: Iterable[str]) -> tuple[Channel, ...]:
    """The joins of a plan by sizes (`1+2`), or by name (`2.a+1->3.b`)."""
    found: set[Channel] = set()
    for join in joins:
        wanted = join.replace(" ", "")
        check_join(wanted)
        named = {channel for channel in plan.joins if wanted in _names(plan, channel)}
        if not named:
            raise ValueError(
                f"joins: {join!r} makes no part of target {plan.target.name!r}; there are "
                f"{', '.join(map(plan.name, plan.joins))}"
            )
        found |= named
    return tuple(sorted(found))


def _names(plan: Plan, channel: Channel) -> set[str]:
    """All that names a join: its parts in either order, with or without what they make; their sizes."""
    a, b, c = (plan.parts[n].name for n in channel)
    n, m = (len(plan.parts[part]) for part in channel[:2])
    return {f"{x}+{y}{z}" for x, y in ((a, b), (b, a)) for z in ("", f"->{c}")} | {f"{n}+{m}", f"{m}+{n}"}
