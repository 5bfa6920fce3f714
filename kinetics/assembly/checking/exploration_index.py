"""An indexed exploration: lookups for the checks, and the faults of single structures."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from functools import cached_property

from kinetics.assembly.checking.cubes import Cube
from kinetics.assembly.checking.findings import Finding
from kinetics.assembly.checking.recoverability import lost_cubes
from kinetics.assembly.deriving.derive import named
from kinetics.assembly.deriving.explore import Exploration, StructureEvent
from kinetics.assembly.deriving.history import Change, fits_into, shortest, way_to
from kinetics.assembly.deriving.mirror import same_to_rules
from kinetics.assembly.structure import Structure


class ExplorationIndex:
    """An exploration with indexes for the checks.

    progress : called with how much is explored and found, of cubes and compositions; it may raise to end the work
    """

    def __init__(self, found: Exploration, progress: Callable[[int, int], None] | None = None):
        self.found, self.book, self.progress = found, found.book, progress or (lambda *_: None)
        names = {structure: name for name, structure in named(found).structures.items()}
        self.names = [names[structure] for structure in found.structures]

    @cached_property
    def seed(self) -> int | None:
        """The seed; None if there is none, or if its letter at once becomes that of a free cube."""
        seed, free = (cube and cube.canonical(self.book.scheme) for cube in (self.book.seed(), self.book.monomer()))
        return None if seed in (None, free) else 1  # explored right after the free cube

    @cached_property
    def targets(self) -> frozenset[int]:
        """The target, and its mirror image in letters; empty if the book names none or never makes it."""
        target, scheme = self.book.target, self.book.scheme
        if target is None:
            return frozenset()
        made = enumerate(self.found.structures)
        return frozenset(number for number, structure in made if same_to_rules(structure, target, scheme))

    def closure(self) -> Iterable[Finding]:
        """Structures infinite, explorations infinite, rules without rest."""
        found = self.found
        if found.beyond is not None:
            a, b, made = found.beyond
            known = {structure: index for index, structure in enumerate(found.structures)}
            steps, changes = self.as_steps(self.way(known[a], known[b]))
            last = f"{self.names[known[a]]} + {self.names[known[b]]} -> {len(made)} cubes: {made}"
            text = (
                f"structures grow beyond {found.max_cubes} cubes; the smallest join found that does makes {len(made)}"
            )
            yield Finding("not closed", True, text, (*steps, last), made, (*changes, Change((a, b), (made,))))
        if found.stopped:
            yield Finding("not proven", True, found.stopped)
        for text in found.livelocks[:1]:
            yield Finding("livelock", True, f"{text} ({len(found.livelocks)} such events)")

    def shapes(self) -> Iterable[Finding]:
        """Findings: structures that are no part of the target, or never become it."""
        target, structures = self.book.target, self.found.structures
        if target is None:
            return
        off = [n for n, structure in enumerate(structures) if not fits_into(structure, target, self.book.scheme)]
        if off:
            worst = min(off, key=lambda n: (self.costs[n], len(structures[n])))
            text = f"{len(off)} of {len(structures)} structures are no part of the target; the nearest"
            yield self.finding("off-target", True, text, worst)
        if not self.targets:
            if self.found.is_closed:  # else what was left out may still make it
                yield from self._missing(target)
            return
        growing = [e for e in self.found.events if not self.targets.isdisjoint(e.before) and len(e.before) == 2]
        if growing:
            text = f"the finished structure still bonds: {self.words(growing[0])}"
            yield self.at_event("target not final", True, text, growing[0])
        if self.found.is_closed:
            yield from self._lost()

    def _missing(self, target: Structure) -> Iterable[Finding]:
        """The target is not among the structures."""
        canonical, scheme = target.canonical(self.book.scheme), self.book.scheme
        structures = self.found.structures
        same = [n for n, s in enumerate(structures) if len(s) == len(target) and fits_into(s, target, scheme)]
        if same:
            text = f"its shape is made with other letters; the book's target is {canonical}"
            yield self.finding("target not reached", True, text, same[0])
        else:
            yield Finding("target not reached", True, "no structure has the target's shape", (), canonical)

    def _lost(self) -> Iterable[Finding]:
        """Structures with a cube that no chain of events leads into the target."""
        if not self.lost:
            return
        active = {n for event in self.found.events for n in event.before}
        lost = {cube.structure for cube in self.lost}
        for kind, which, text in (
            ("dead end", lost - active, "structures can neither grow nor break"),
            ("trap", lost & active, "structures hold a cube that keeps changing but never becomes part of the target"),
        ):
            if which:
                nearest = min(which, key=lambda n: (self.costs[n], len(self.found.structures[n])))
                yield self.finding(kind, True, f"{len(which)} {text}; the nearest", nearest)

    @cached_property
    def lost(self) -> list[Cube]:
        """The cubes that can never end in a target; none if the book names no target or never makes it."""
        return lost_cubes(self.found, self.targets, self.progress) if self.targets else []

    def squeezes(self) -> Iterable[Finding]:
        """Joins that put a cube between two others."""
        tight = self.found.squeezed
        if tight:
            event = min(tight, key=lambda e: sum(self.costs[n] for n in e.before))
            text = f"{len(tight)} joins squeeze a cube in between two others; the nearest"
            yield self.at_event("squeezed", False, text, event)

    @cached_property
    def costs(self) -> list[float]:
        """The fewest events that make each structure."""
        return self._shortest[0]

    @cached_property
    def _shortest(self) -> tuple[list[float], dict[int, StructureEvent]]:
        starts = {0} if self.seed is None else {0, self.seed}
        return shortest(len(self.found.structures), starts, self.found.events)

    def way(self, *indices: int) -> tuple[StructureEvent, ...]:
        """The shortest way to make some structures."""
        return way_to(indices, self._shortest[1])

    def finding(self, kind: str, is_error: bool, text: str, index: int) -> Finding:
        """A finding about one structure, with the shortest way to it."""
        steps, changes = self.as_steps(self.way(index))
        return Finding(kind, is_error, text, steps, self.found.structures[index], changes)

    def at_event(self, kind: str, is_error: bool, text: str, event: StructureEvent) -> Finding:
        """A finding about a join, with the shortest way to it."""
        steps, changes = self.as_steps((*self.way(*event.before), event))
        return Finding(kind, is_error, text, steps, self.found.structures[event.after[0]], changes)

    def as_steps(self, events: Iterable[StructureEvent]) -> tuple[tuple[str, ...], tuple[Change, ...]]:
        """Events as text and as structures."""
        steps = [
            (self.words(e), Change(*(tuple(self.found.structures[n] for n in side) for side in e))) for e in events
        ]
        return tuple(words for words, _ in steps), tuple(change for _, change in steps)

    def words(self, event: StructureEvent) -> str:
        """`monomer + dimer -> trimer`, with the structure that a join makes."""
        before, after = (" + ".join(self.names[n] for n in side) for side in event)
        shown = f": {self.found.structures[event.after[0]]}" if len(event.after) == 1 else ""
        return f"{before} -> {after}{shown}"
