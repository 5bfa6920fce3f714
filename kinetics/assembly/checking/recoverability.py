"""Recoverability: whether every cube can still end in a target, for all tanks at once, from events alone.

The arguments are about what can happen, not about how soon. A tank has finitely many states, so what can happen from
each of them happens sooner or later (Norris 1997, Markov Chains, section 3.5, doi:10.1017/CBO9780511810633).
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Set
from typing import Literal

from kinetics.assembly.checking.compositions import leading_to
from kinetics.assembly.checking.cubes import Cube, sources_of_cubes
from kinetics.assembly.deriving.explore import Exploration, StructureEvent

Scope = Literal["any tank", "enough free cubes", "nothing"]


def lost_cubes(
    found: Exploration, targets: Set[int], progress: Callable[[int, int], None] = lambda *_: None
) -> list[Cube]:
    """The cubes that no sequence of events brings into a target, whatever else the tank holds.

    Each cube is followed by itself, and partners are taken to be there: one that is lost here is lost in every tank.

    progress : called with the numbers of events followed and of all
    """
    sources = sources_of_cubes(found, progress)
    recoverable = leading_to([cube for cube in sources if cube.structure in targets], sources)
    return sorted(set(sources) - recoverable)


def falling_apart(events: Iterable[StructureEvent], into: Mapping[int, int]) -> dict[int, int]:
    """The structures that can fall apart into given ones, all by themselves, each with how many seeds that leaves.

    into : structure -> how many seeds it counts for
    """
    seeds = dict(into)
    alone = [event for event in events if len(event.before) == 1]
    while True:
        more = {
            event.before[0]: sum(seeds[n] for n in event.after)
            for event in alone
            if event.before[0] not in seeds and seeds.keys() >= set(event.after)
        }
        if not more:
            return seeds
        seeds |= more


def finished(events: Iterable[StructureEvent], free: int, targets: Set[int]) -> set[int]:
    """The structures that can become targets and free cubes with nothing but free cubes around, as many as it takes.

    Partners are made of free cubes, and whatever is left on the way must be finished too.
    """
    every = list(events)
    made, recoverable = {free}, {free, *targets}
    while True:
        more_made = {
            after
            for event in every
            if made.issuperset(event.before)
            for n, after in enumerate(event.after)
            if recoverable.issuperset(event.after[:n] + event.after[n + 1 :])
        } - made
        more_recoverable = {
            before
            for event in every
            if recoverable.issuperset(event.after)
            for n, before in enumerate(event.before)
            if made.issuperset(event.before[:n] + event.before[n + 1 :])
        } - recoverable
        if not more_made and not more_recoverable:
            return recoverable
        made |= more_made
        recoverable |= more_recoverable


def scope(found: Exploration, seed: int | None, targets: Set[int], is_makeable: Callable[[], bool]) -> Scope:
    """The tanks in which every cube can provably still end in a target.

    seed : the structure that the tank holds once beside the free cubes, structure 0; None if there is none
    is_makeable : whether a target can be made of exactly its own number of free cubes, the seed among them; asked last
    """
    n_structures, is_seeded = len(found.structures), int(seed is not None)
    into = {0: 0} | dict.fromkeys(targets, is_seeded) | ({} if seed is None else {seed: 1})
    seeds = falling_apart(found.events, into)
    if len(seeds) == n_structures and all(_keeps(event, seeds) for event in found.events) and is_makeable():
        return "any tank"
    if len(finished(found.events, 0, targets)) == n_structures:
        return "enough free cubes"
    return "nothing"


def _keeps(event: StructureEvent, seeds: Mapping[int, int]) -> bool:
    """Whether an event leaves as many seeds as there were: free cubes could become seeds, which wait for free cubes."""
    before, after = (sum(seeds[n] for n in side) for side in event)
    return before == after
