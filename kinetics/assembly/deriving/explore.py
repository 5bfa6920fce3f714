"""Exploration: every structure that the cubes of a rule book can form, by trying every join and every break.

Structures are explored from the smallest up. Each is joined with those explored before it, at one face of every orbit
of its symmetry and at every twist that gives something new, and broken at every bond that holds two parts together.
"""

from __future__ import annotations

import heapq
from collections import defaultdict
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import NamedTuple

from kinetics.assembly.deriving.ways import RateClass, Site, breaks, joins_at, sites_of, squeezes
from kinetics.assembly.rules.rule_book import LivelockError, RuleBook, View
from kinetics.assembly.structure import Structure

MAX_CUBES = 12  # or the target's size
MAX_SPECIES = 2000
Indices = tuple[int, ...]


class StructureEvent(NamedTuple):
    """A join or a break: indices of the structures before and after, ascending."""

    before: Indices
    after: Indices


class Join(NamedTuple):
    """Two structures and what they make."""

    first: Structure
    second: Structure
    made: Structure


@dataclass(frozen=True, eq=False)
class Exploration:
    """The result of an exploration: structures, and the events between them.

    structures : canonical, in the order of discovery
    events : join or break -> its ways N by rate class
    beyond : the smallest join that goes beyond max_cubes, left out of the events; None if there is none
    squeezed : ways of a join in which a cube has to slip in between two opposite ones
    livelocks : events after which the internal rules never come to rest, in words; left out of the events
    stopped : why the exploration ended early; "" if it is complete
    slow_waves : whether internal rules act on one cube at a time
    """

    book: RuleBook
    max_cubes: int
    max_species: int
    structures: tuple[Structure, ...]
    events: Mapping[StructureEvent, Mapping[RateClass, float]]
    beyond: Join | None
    squeezed: Mapping[StructureEvent, float]
    livelocks: tuple[str, ...]
    stopped: str
    slow_waves: bool

    @property
    def is_closed(self) -> bool:
        """Whether these are proven to be all structures that can form."""
        return self.beyond is None and not self.stopped and not self.livelocks


def explore(
    book: RuleBook,
    max_cubes: int | None = None,
    max_species: int = MAX_SPECIES,
    first_beyond: bool = False,
    progress: Callable[[int, int], None] | None = None,
    slow_waves: bool = False,
) -> Exploration:
    """Explore what free cubes, and the seed if the book has one, can become.

    max_cubes, max_species : caps; larger products are left out, and more structures end the exploration. max_cubes is
        by default 12, or the size of the book's target if that is larger
    first_beyond : end as soon as the book is known not to be closed
    progress : called with the numbers of structures explored and found
    slow_waves : internal rules act on one cube at a time, in any order, with joins and breaks in between; such a step
        is an event with one structure before and one after

    After Ctrl-C, what was found so far is returned.
    """
    if max_cubes is None:
        max_cubes = max(MAX_CUBES, 0 if book.target is None else len(book.target))
    if max_cubes < 1 or max_species < 1:
        raise ValueError(f"max_cubes = {max_cubes}, max_species = {max_species}; both must be at least 1")
    explorer = _Explorer(book, max_cubes, max_species, slow_waves)
    stopped = ""
    try:
        explorer.run(first_beyond, progress)
    except _TooManyError as error:
        stopped = str(error)
    except KeyboardInterrupt:
        stopped = f"interrupted with {len(explorer.explored)} of {len(explorer.order)} structures explored"
    return Exploration(
        book,
        max_cubes,
        max_species,
        tuple(explorer.order),
        explorer.events,
        explorer.beyond,
        explorer.squeezed,
        tuple(explorer.livelocks),
        stopped,
        slow_waves,
    )


class _TooManyError(Exception):
    """More structures than the cap."""


class _Explorer:
    def __init__(self, book: RuleBook, max_cubes: int, max_species: int, slow_waves: bool):
        self.book, self.max_cubes, self.max_species, self.slow_waves = book, max_cubes, max_species, slow_waves
        self.order: list[Structure] = []
        self.index: dict[Structure, int] = {}
        self.waiting: list[tuple[int, int]] = []  # (size, index), smallest first
        self.explored: list[int] = []
        self.sites: dict[int, list[Site]] = {}
        self.holders: defaultdict[View, list[int]] = defaultdict(list)  # explored structures that show a view
        self.partners: dict[View, list[View]] = {}
        self.events: defaultdict[StructureEvent, defaultdict[RateClass, float]] = defaultdict(
            lambda: defaultdict(float)
        )
        self.squeezed: defaultdict[StructureEvent, float] = defaultdict(float)
        self.livelocks: list[str] = []
        self.beyond: Join | None = None

    def run(self, first_beyond: bool, progress: Callable[[int, int], None] | None) -> None:
        try:
            starts = (self.book.monomer(), self.book.seed())
        except LivelockError as error:
            self.livelocks.append(f"a cube by itself: {error}")
            return
        for start in starts:
            if start is not None:
                self.entered(start, "the start")
        while self.waiting:
            _, new = heapq.heappop(self.waiting)
            structure = self.order[new]
            self.sites[new] = sites_of(self.book, structure)
            self.explored.append(new)
            for view in {site.view for site in self.sites[new]}:
                self.show(view)
                self.holders[view].append(new)
            for old in self.candidates(new):
                self.join(old, new)
            if self.book.semantics.bonds == "break":
                self.part(new)
            if self.slow_waves:
                self.follow(new)
            if progress is not None:
                progress(len(self.explored), len(self.order))
            if first_beyond and self.beyond is not None and len(self.beyond.made) == self.max_cubes + 1:
                return

    def show(self, view: View) -> None:
        """Find out once which of the known views a new one may bond with."""
        if view in self.partners:
            return
        self.partners[view] = []
        for other in self.partners:
            if self.book.allows(view, other):
                self.partners[view].append(other)
                if other != view:
                    self.partners[other].append(view)

    def candidates(self, new: int) -> list[int]:
        """Explored structures that some face of `new` may bond with."""
        views = {site.view for site in self.sites[new]}
        return sorted({old for view in views for other in self.partners[view] for old in self.holders[other]})

    def join(self, old: int, new: int) -> None:
        before = (min(old, new), max(old, new))
        if len(self.order[old]) < len(self.order[new]):
            old, new = new, old  # the smaller one is put into the lattice of the other
        first, second = self.order[old], self.order[new]
        size = len(first) + len(second)
        if size > self.max_cubes and self.beyond is not None and size >= len(self.beyond.made):
            return
        what = f"the join of {first} and {second}"
        try:
            for made, share, rate_class in joins_at(
                self.book, first, self.sites[old], second, self.sites[new], not self.slow_waves
            ):
                if size > self.max_cubes:
                    self.beyond = Join(first, second, made)
                    return
                event = StructureEvent(before, (self.entered(made, what),))
                self.events[event][rate_class] += share
                if squeezes(made, len(first)):
                    self.squeezed[event] += share
        except LivelockError as error:
            self.livelocks.append(f"{what}: {error}")

    def part(self, new: int) -> None:
        what = f"a break of {self.order[new]}"
        try:
            for fragments, share, rate_class in breaks(self.book, self.order[new], not self.slow_waves):
                ends = sorted(self.entered(part.structure, what) for part in fragments)
                self.events[StructureEvent((new,), tuple(ends))][rate_class] += share
        except LivelockError as error:
            self.livelocks.append(f"{what}: {error}")

    def follow(self, new: int) -> None:
        structure = self.order[new]
        for changed in self.book.steps(structure):
            event = StructureEvent((new,), (self.entered(changed, f"an internal rule in {structure}"),))
            self.events[event][RateClass("internal", (len(structure), 0), ("", ""))] += 1

    def entered(self, structure: Structure, what: str) -> int:
        """Index of a structure; a new one waits to be explored."""
        canonical = structure.canonical(self.book.scheme)
        if canonical not in self.index:
            if len(self.order) == self.max_species:
                raise _TooManyError(
                    f"book {self.book.name!r} makes more than max_species = {self.max_species} structures, the last "
                    f"by {what}; guard its rules, or raise the cap"
                )
            self.index[canonical] = len(self.order)
            heapq.heappush(self.waiting, (len(canonical), len(self.order)))
            self.order.append(canonical)
        return self.index[canonical]
