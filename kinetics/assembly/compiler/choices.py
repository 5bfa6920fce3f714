"""Choices of joins, and the encounters that cubes cannot distinguish from a join, whatever their letters."""

from __future__ import annotations

import heapq
from collections import defaultdict
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from itertools import combinations, product
from math import prod
from typing import NamedTuple

from kinetics.assembly.compiler.dockings import Meeting
from kinetics.assembly.compiler.plan import Channel, Docking, Plan
from kinetics.assembly.compiler.target import check_join

MOST_CHOICES = 1 << 16  # gone through one by one
MOST_IN_GROUP = 10  # joins of the same two parts of which all subsets are tried


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


@dataclass(frozen=True, eq=False)
class _Group:
    """The joins of the same two parts; only among these can there be clashes, for unknowns tell parts apart.

    options : choices without a clash, the largest first and the empty one last
    """

    joins: tuple[Channel, ...]
    options: tuple[frozenset[Channel], ...]

    @property
    def largest(self) -> tuple[frozenset[Channel], ...]:
        """Those that lie in no other one."""
        return tuple(option for option in self.options if not any(option < other for other in self.options))


class Choices:
    """All choices of joins of a plan that cubes can tell from all else, as far as unlike letters tell.

    tick : called again and again; it may raise to end the work
    """

    def __init__(self, plan: Plan, breaks: bool, tick: Callable[[], None] = lambda: None):
        self.plan, self.breaks, self.tick = plan, breaks, tick
        by_parts: dict[tuple[int, int], list[Channel]] = defaultdict(list)
        # Meetings whose two cubes read what cubes read in joins; they must not bond, unless they are a join chosen.
        self.doubtful: dict[tuple[int, int], list[tuple[Docking, Meeting, Channel | None]]] = defaultdict(list)
        for channel, ways in plan.joins.items():
            by_parts[channel.a, channel.b].append(channel)
            self.doubtful[channel[:2]] += [(docking, way.meeting, channel) for docking, way in ways.items()]
        for parts, doubtful in self.doubtful.items():
            for docking, meeting in plan.foreign(*parts).items():
                if all(reading in plan.readings for reading in docking):
                    doubtful.append((docking, meeting, None))
        self.groups = [self._group(tuple(joins)) for joins in by_parts.values()]
        self.group_of = {channel: group for group in self.groups for channel in group.joins}

    def _group(self, joins: tuple[Channel, ...]) -> _Group:
        self.tick()
        sizes = range(len(joins), -1, -1) if len(joins) <= MOST_IN_GROUP else (len(joins), 1, 0)
        subsets = [frozenset(subset) for size in sizes for subset in combinations(joins, size)]
        return _Group(joins, tuple(subset for subset in subsets if next(self.clashes(subset), None) is None))

    @property
    def is_complete(self) -> bool:
        """Whether every choice is among the products of the groups' options."""
        return all(len(group.joins) <= MOST_IN_GROUP for group in self.groups)

    @property
    def is_small(self) -> bool:
        """Whether all choices can be gone through."""
        return self.is_complete and prod(len(group.options) for group in self.groups) <= MOST_CHOICES

    @property
    def possible(self) -> frozenset[Channel]:
        """The joins that are in any choice."""
        if not self.is_complete:
            return frozenset(self.plan.joins)
        return frozenset[Channel]().union(*(option for group in self.groups for option in group.options))

    def clashes(self, joins: Iterable[Channel]) -> Iterator[Clash]:
        """Meetings that a choice of joins cannot keep apart from its joins."""
        chosen = frozenset(joins)
        for parts in sorted({channel[:2] for channel in chosen}):
            for docking, meeting, made in self.doubtful[parts]:
                if made in chosen:
                    continue
                first, second = (
                    [(channel, example) for channel, example in self.plan.readings[r].items() if channel in chosen]
                    for r in docking
                )
                if first and second:
                    same = next(((one, one) for one in first if one in second), (first[0], second[0]))
                    yield Clash(meeting, made, same)

    def sensible(self, joins: Iterable[Channel]) -> frozenset[Channel]:
        """See `sensible`."""
        return sensible(self.plan, joins, self.breaks)

    def largest(self) -> Iterator[frozenset[Channel]]:
        """The choices to which no join can be added; without any, the target cannot be reached."""
        seen: set[frozenset[Channel]] = {frozenset()}
        if not self.sensible(self.possible):  # nor is any choice among them
            return
        for options in product(*(group.largest for group in self.groups)):
            self.tick()
            joins = self.sensible(frozenset().union(*options))
            if joins not in seen:
                seen.add(joins)
                yield joins

    def paths(self) -> Iterator[frozenset[Channel]]:
        """Choices that make every part in one way only, fewest joins first."""
        making: dict[int, list[Channel]] = defaultdict(list)
        for channel in self.plan.joins:
            making[channel.c].append(channel)
        start: tuple[int, list[int], list[Channel]] = (1, [len(self.plan.parts) - 1], [])
        waiting, seen = [start], {frozenset[Channel]()}
        while waiting:
            self.tick()
            _, pending, joins = heapq.heappop(waiting)
            if not pending:
                found = self.sensible(joins)
                if found not in seen and self.is_told_apart(found):
                    seen.add(found)
                    yield found
                continue
            part = max(pending)
            for channel in making[part]:
                made = {join.c for join in joins} | {part, 0}
                rest = sorted({*pending, channel.a, channel.b} - made)
                following = sorted([*joins, channel])
                group = self.group_of[channel]
                if any(option.issuperset(c for c in following if c in group.joins) for option in group.options):
                    heapq.heappush(waiting, (len(following) + len(rest), rest, following))

    def every(self) -> Iterator[frozenset[Channel]]:
        """All choices that make sense, fewest joins first; of more than MOST_CHOICES, only `paths`."""
        if not self.is_small:
            yield from self.paths()
            return
        choices = (frozenset().union(*options) for options in product(*(group.options for group in self.groups)))
        for joins in sorted(choices, key=lambda joins: (len(joins), sorted(joins))):
            self.tick()
            if joins and self.sensible(joins) == joins:
                yield joins

    def is_told_apart(self, joins: Iterable[Channel]) -> bool:
        """Whether no other meeting looks like one of these joins."""
        return next(self.clashes(joins), None) is None

    def obstacles(self, asked: Iterable[Channel]) -> list[Clash]:
        """Clashes that stand in the way: one that cannot be avoided by leaving out joins, if there is such; else one
        after another, each with the joins of those before left out.
        """
        left = frozenset(asked)
        found: list[Clash] = []
        while clashes := list(self.clashes(left)):
            by_blamed: dict[frozenset[Channel], Clash] = {}
            for clash in clashes:
                by_blamed.setdefault(clash.blamed, clash)
            for clash in by_blamed.values():
                if not self.sensible(left - clash.blamed):
                    return [*found, clash]
            found.append(clashes[0])
            left -= clashes[0].blamed
        return found


def sensible(plan: Plan, joins: Iterable[Channel], breaks: bool) -> frozenset[Channel]:
    """The joins left when those are dropped that cannot happen, or make what never becomes the target; none are
    left where they do not lead to the target.
    """
    kept = frozenset(joins)
    while True:
        reached = plan.reached(kept, breaks)
        bad = reached - plan.leading_home(kept, breaks, reached)
        for part in sorted(reached) if breaks else ():  # what falls into lost parts must not be made either
            if not bad.isdisjoint(plan.pieces[part]):
                bad.add(part)
        good = frozenset(c for c in kept if c.a in reached and c.b in reached and c.c not in bad)
        if good == kept:
            return kept if len(plan.parts) - 1 in reached and not bad else frozenset()
        kept = good


def asked_joins(plan: Plan, joins: Iterable[str]) -> tuple[Channel, ...]:
    """The joins of a plan by sizes (`1+2`), or by name (`2.a+1->3.b`)."""
    found: dict[Channel, None] = {}
    known = {name: channel for channel in plan.joins for name in _names(plan, channel)}
    for join in joins:
        wanted = join.replace(" ", "")
        check_join(wanted)
        sizes = [c for c in plan.joins if wanted in _sizes(plan, c)]
        if wanted in known:
            sizes = [known[wanted]]
        if not sizes:
            raise ValueError(
                f"joins: {join!r} makes no part of target {plan.target.name!r}; there are "
                f"{', '.join(map(plan.name, plan.joins))}"
            )
        found |= dict.fromkeys(sizes)
    return tuple(sorted(found))


def _names(plan: Plan, channel: Channel) -> tuple[str, str]:
    a, b, c = (plan.parts[n].name for n in channel)
    return f"{a}+{b}->{c}", f"{b}+{a}->{c}"


def _sizes(plan: Plan, channel: Channel) -> tuple[str, ...]:
    """All that names the parts without what they make."""
    a, b, _ = (plan.parts[n].name for n in channel)
    n, m = (len(plan.parts[part]) for part in channel[:2])
    return f"{n}+{m}", f"{m}+{n}", f"{a}+{b}", f"{b}+{a}"
