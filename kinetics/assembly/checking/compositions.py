"""Compositions of a small tank: all that can be reached, and the events between them."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterable, Mapping, Sequence, Set
from typing import TypeVar

from kinetics.assembly.deriving.explore import Indices, StructureEvent

MAX_COMPOSITIONS = 20_000
Node = TypeVar("Node")


def compositions(
    start: Indices,
    events: Mapping[StructureEvent, object],
    progress: Callable[[int, int], None] = lambda *_: None,
    until: Set[int] = frozenset(),
) -> dict[Indices, list[tuple[StructureEvent, Indices]]] | None:
    """What can become of a tank: composition (structures, rising) -> events and compositions after them.

    progress : called with the numbers of compositions explored and found
    until : structures; the search ends with the first composition that holds one
    None if there are more than MAX_COMPOSITIONS.
    """
    by_first: dict[int, list[StructureEvent]] = {}
    for event in events:
        by_first.setdefault(event.before[0], []).append(event)
    tank: dict[Indices, list[tuple[StructureEvent, Indices]]] = {tuple(sorted(start)): []}
    waiting = deque(tank)
    while waiting:
        state = waiting.popleft()
        progress(len(tank) - len(waiting), len(tank))
        for event in (event for first in sorted(set(state)) for event in by_first.get(first, [])):
            rest = list(state)
            rest.remove(event.before[0])
            if len(event.before) == 2:
                if event.before[1] not in rest:
                    continue
                rest.remove(event.before[1])
            after = tuple(sorted([*rest, *event.after]))
            tank[state].append((event, after))
            if after not in tank:
                if len(tank) == MAX_COMPOSITIONS:
                    return None
                tank[after] = []
                waiting.append(after)
                if not until.isdisjoint(after):
                    return tank
    return tank


def events_to(
    goal: Indices, start: Indices, tank: Mapping[Indices, Sequence[tuple[StructureEvent, Indices]]]
) -> list[StructureEvent]:
    """A shortest way from the first composition to another one."""
    first = tuple(sorted(start))
    came: dict[Indices, tuple[Indices, StructureEvent] | None] = {first: None}
    waiting = deque([first])
    while goal not in came:
        state = waiting.popleft()
        for event, after in tank[state]:
            if after not in came:
                came[after] = state, event
                waiting.append(after)
    way: list[StructureEvent] = []
    step = came[goal]
    while step is not None:
        way.insert(0, step[1])
        step = came[step[0]]
    return way


def leading_to(start: Iterable[Node], sources: Mapping[Node, Iterable[Node]]) -> set[Node]:
    """All nodes from which a chain of sources leads to the start, itself included."""
    reached = set(start)
    waiting = list(reached)
    while waiting:
        for source in sources[waiting.pop()]:
            if source not in reached:
                reached.add(source)
                waiting.append(source)
    return reached
