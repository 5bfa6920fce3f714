"""Histories of assembly: the shortest sequence of events to a structure, and random growth cube by cube."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from typing import NamedTuple

import numpy as np

from kinetics.assembly.deriving.derive import Derivation
from kinetics.assembly.deriving.explore import MAX_CUBES, StructureEvent
from kinetics.assembly.faces import scheme_of
from kinetics.assembly.rules.rule_book import RuleBook
from kinetics.assembly.structure import Placement, Structure, placements


class Change(NamedTuple):
    """A join, a break or an internal rule at work: the structures before and after, as they lie in the larger side."""

    before: tuple[Structure, ...]
    after: tuple[Structure, ...]


def shortest(
    n_structures: int, starts: Collection[int], events: Mapping[StructureEvent, object]
) -> tuple[list[float], dict[int, StructureEvent]]:
    """The fewest events that make each structure, and the last of them; infinite and none if there is no way.

    starts : the structures that are there at the beginning
    """
    costs = [0.0 if n in starts else float("inf") for n in range(n_structures)]
    made_by: dict[int, StructureEvent] = {}
    better = True
    while better:
        better = False
        for event in events:
            cost = 1 + sum(costs[n] for n in event.before)
            for after in event.after:
                if cost < costs[after]:
                    costs[after], made_by[after], better = cost, event, True
    return costs, made_by


def way_to(goals: Sequence[int], made_by: Mapping[int, StructureEvent]) -> tuple[StructureEvent, ...]:
    """The events that make some structures, in order, each once."""
    steps = dict[StructureEvent, None]()

    def make(index: int) -> None:
        event = made_by.get(index)
        if event is not None and event not in steps:
            for before in event.before:
                make(before)
            steps[event] = None

    for goal in goals:
        make(goal)
    return tuple(steps)


def chain(derivation: Derivation) -> tuple[Structure, ...]:
    """From a free cube, or the seed, to the book's target by the fewest events, each as it lies in the next.

    At each step the largest part is followed. Where structures grow only by single cubes, this is one cube a step.
    """
    book, structures = derivation.book, tuple(derivation.structures.values())
    if book.target is None:
        raise ValueError(f"book {book.name!r} has no target to grow to; give it a [target]")
    starts = [derivation.species_of(start) for start in (book.monomer(), book.seed()) if start is not None]
    costs, made_by = shortest(len(structures), starts, derivation.events)
    canonical = book.target.canonical(book.scheme)
    at = structures.index(canonical) if canonical in structures else -1
    if at < 0 or not np.isfinite(costs[at]):
        raise ValueError(f"the rules of book {book.name!r} never make its target; `wellmixed rules check` says why")
    frames = [book.target]
    while at in made_by:
        at = max(made_by[at].before, key=lambda n: len(structures[n]))
        frames.append(next(alike_first(structures[at], frames[-1], book.scheme), structures[at]))
    return tuple(reversed(frames))


def random_growth(book: RuleBook, seed: int, max_cubes: int | None = None) -> tuple[Structure, ...]:
    """A seeded book's structure as free cubes dock one by one, every way that is open equally likely.

    max_cubes : where to stop at the latest; by default 12, or the target's size if that is larger
    Returns all structures from the seed on, each in the seed's lattice.
    """
    start = book.seed()
    if start is None:
        raise ValueError(f"book {book.name!r} has no seed to grow from; name its letter as seed = ..., or use chain()")
    if max_cubes is None:
        max_cubes = max(MAX_CUBES, 0 if book.target is None else len(book.target))
    rng, cube = np.random.default_rng(seed), book.monomer()
    frames = [start]
    while len(frames[-1]) < max_cubes:
        grown = _docked(book, frames[-1], cube, rng)
        if grown is None:
            break
        frames.append(grown)
    return tuple(frames)


def _docked(book: RuleBook, structure: Structure, cube: Structure, rng: np.random.Generator) -> Structure | None:
    """The structure with one more cube, drawn among all ways; None if there is none."""
    free = [(face, view) for face in range(6) if (view := book.view(cube, 0, face)) is not None]
    ways = [
        (host, face, other, twist)
        for host, face in structure.open_faces()
        for other, view in free
        if book.allows(book.view(structure, host, face), view)
        for twist in range(4)
    ]
    for way in rng.permutation(len(ways)).tolist():  # the first of them that the rules let through is as likely as any
        host, face, other, twist = ways[way]
        made = book.join(structure, host, cube, 0, placements(structure, host, face, cube, 0, other)[twist])
        if made is not None:
            return made
    return None


def placed_within(
    part: Structure, whole: Structure, scheme: str, taken: Collection[tuple[int, int, int]] = ()
) -> Iterator[Structure]:
    """The copies of a structure that lie within another one, letters aside, clear of the places taken."""
    if len(part) > len(whole):
        return
    reduced = scheme_of(scheme).reduced.tolist()
    cubes_there = zip(whole.positions, whole.rotations, strict=True)
    seen = {place: reduced[r] for place, r in cubes_there if place not in taken}
    for rotation in range(24):
        turned = part.turned(rotation)
        cubes = [(*place, reduced[r]) for place, r in zip(turned.positions, turned.rotations, strict=True)]
        x0, y0, z0, first = cubes[0]
        for (x, y, z), looks in seen.items():
            u, v, w = x - x0, y - y0, z - z0
            if looks == first and all(seen.get((a + u, b + v, c + w)) == r for a, b, c, r in cubes):
                yield part.moved(Placement(rotation, (u, v, w)))


def fits_into(part: Structure, whole: Structure, scheme: str) -> bool:
    """Whether a structure, turned and moved, lies within another one, letters aside."""
    return next(placed_within(part, whole, scheme), None) is not None


def alike_first(part: Structure, whole: Structure, scheme: str) -> Iterator[Structure]:
    """Placements of `part` within `whole`, those first that share most letters with the cubes they cover."""

    def alike(copy: Structure) -> int:
        return sum(
            whole.letters[whole.places[place]] == letter
            for place, letter in zip(copy.positions, copy.letters, strict=True)
        )

    return iter(sorted(placed_within(part, whole, scheme), key=alike, reverse=True))


def laid_out(change: Change, scheme: str, turn: Callable[[Structure], Structure]) -> Change:
    """A copy with its larger side turned by `turn` and the parts of the other side placed within it.

    What fits nowhere (letters aside) stays as it is.
    """
    if len(change.after) == 1:
        whole = turn(change.after[0])
        return Change(_parts(change.before, whole, scheme), (whole,))
    whole = turn(change.before[0])
    return Change((whole,), _parts(change.after, whole, scheme))


def _parts(parts: tuple[Structure, ...], whole: Structure, scheme: str) -> tuple[Structure, ...]:
    for first in alike_first(parts[0], whole, scheme):
        if len(parts) == 1:
            return (first,)
        for second in placed_within(parts[1], whole, scheme, first.positions):
            return (first, second)
    return parts
