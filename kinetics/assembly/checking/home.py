"""Whether every cube can come home, into a target: for all tanks at once, from the events between structures alone.

The arguments are about what can happen, not about how soon. A tank has finitely many states, so what can happen from
each of them happens sooner or later (Norris 1997, Markov Chains, section 3.5, doi:10.1017/CBO9780511810633).
"""

from __future__ import annotations

from collections.abc import Iterable, Set
from typing import Literal

from kinetics.assembly.checking.compositions import leading_to
from kinetics.assembly.checking.cubes import Cube, sources_of_cubes
from kinetics.assembly.deriving.explore import Exploration, StructureEvent

Scope = Literal["any tank", "enough free cubes", "nothing"]


def lost_cubes(found: Exploration, targets: Set[int]) -> list[Cube]:
    """The cubes that no chain of events leads into a target, whatever else the tank holds.

    Each cube is followed by itself, and partners are taken to be there: one that is lost here is lost in every tank.
    """
    sources = sources_of_cubes(found)
    home = leading_to([cube for cube in sources if cube.structure in targets], sources)
    return sorted(set(sources) - home)


def falling_apart(events: Iterable[StructureEvent], free: Iterable[int]) -> set[int]:
    """The structures that can fall apart into the free ones, all by themselves."""
    known = set(free)
    alone = [event for event in events if len(event.before) == 1]
    while True:
        more = {event.before[0] for event in alone if known.issuperset(event.after)} - known
        if not more:
            return known
        known |= more


def finished(events: Iterable[StructureEvent], free: int, targets: Set[int]) -> set[int]:
    """The structures that can become targets and free cubes with nothing but free cubes around, as many as it takes.

    Partners are made of free cubes, and whatever is left on the way must be finished too.
    """
    every = list(events)
    made, home = {free}, {free, *targets}
    while True:
        more_made = {
            after
            for event in every
            if made.issuperset(event.before)
            for n, after in enumerate(event.after)
            if home.issuperset(event.after[:n] + event.after[n + 1 :])
        } - made
        more_home = {
            before
            for event in every
            if home.issuperset(event.after)
            for n, before in enumerate(event.before)
            if made.issuperset(event.before[:n] + event.before[n + 1 :])
        } - home
        if not more_made and not more_home:
            return home
        made |= more_made
        home |= more_home


def scope(found: Exploration, free: Set[int], targets: Set[int], is_makeable: bool) -> Scope:
    """For which tanks it is proven that every cube can come home.

    free : the free cube, first, and the seed if there is one
    is_makeable : whether a target can be made of exactly its own number of free cubes
    """
    everything = set(range(len(found.structures)))
    if is_makeable and falling_apart(found.events, {*free, *targets}) == everything:
        return "any tank"
    if finished(found.events, min(free), targets) == everything:
        return "enough free cubes"
    return "nothing"
