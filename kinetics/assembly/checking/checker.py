"""The checker: faults of a rule book, found by exploring all it can do, each with the shortest sequence of events."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

from kinetics.assembly.checking.compositions import MAX_COMPOSITIONS, compositions, events_to, leading_to
from kinetics.assembly.deriving.derive import named
from kinetics.assembly.deriving.explore import MAX_SPECIES, Exploration, Indices, StructureEvent, explore
from kinetics.assembly.deriving.history import Change, fits_into, laid_out, shortest, way_to
from kinetics.assembly.drawing.counterexamples import Counterexample, counterexample_drawing, report_drawing
from kinetics.assembly.drawing.drawing import Drawing
from kinetics.assembly.drawing.pictures import posed
from kinetics.assembly.rules.rule_book import RuleBook
from kinetics.assembly.structure import Structure

MORE_IN_WAVES = 10  # times as many structures may be found in the middle of waves as at rest
SLOW = "slow internal waves: "


@dataclass(frozen=True)
class Finding:
    """One fault of a rule book.

    kind : `not closed`, `not proven`, `livelock`, `target not reached`, `target not final`, `off-target`, `dead end`,
        `trap`, `starvation`, `squeezed`, `unreachable rule`, `unused letter`; preceded by `slow internal waves: ` if
        it occurs only where internal rules are slower than collisions
    is_error : whether the book is wrong; otherwise it is a warning
    steps : the shortest sequence of events that leads to the fault, in words
    structure : the structure at its end
    changes : the same events with their structures
    """

    kind: str
    is_error: bool
    text: str
    steps: tuple[str, ...] = ()
    structure: Structure | None = None
    changes: tuple[Change, ...] = ()

    def __str__(self) -> str:
        """For people, the structure drawn in layers."""
        lines = [f"{'error' if self.is_error else 'warning'}: {self.kind}: {self.text}"]
        lines += [f"    {number}. {step}" for number, step in enumerate(self.steps, 1)]
        if self.structure is not None:
            lines += ["      " + row for row in self.structure.drawn().splitlines()]
        return "\n".join(lines)

    def counterexample(self, scheme: str) -> Counterexample:
        """The finding as it is drawn: the larger side of each change faces the viewer, its parts as they lie in it."""
        changes = tuple(laid_out(change, scheme, posed) for change in self.changes)
        return Counterexample(f"{self.kind}: {self.text}", self.is_error, self.steps, changes, self.structure)

    def plot(self, ax: Any, scheme: str = "two") -> Any:
        """Draw the fault and how it comes about, step by step; returns `ax`."""
        return counterexample_drawing(self.counterexample(scheme), scheme).onto(ax)


@dataclass(frozen=True, eq=False)
class Report:
    """The findings about a book, errors first, and how much was explored."""

    book: RuleBook
    n_structures: int
    n_events: int
    findings: tuple[Finding, ...]

    @property
    def is_correct(self) -> bool:
        """Whether there are no errors; there may be warnings."""
        return not any(finding.is_error for finding in self.findings)

    @property
    def summary(self) -> str:
        """The book, how much was explored, and the numbers of errors and warnings, on one line."""
        errors = sum(finding.is_error for finding in self.findings)
        return (
            f"book {self.book.name!r}: {self.n_structures} structures, {self.n_events} joins and breaks; "
            f"{errors} errors, {len(self.findings) - errors} warnings"
        )

    def __str__(self) -> str:
        """For people: the summary, then each finding."""
        return "\n".join([self.summary, *map(str, self.findings)])

    def plot(self, ax: Any) -> Any:
        """Draw each finding with its counterexample, step by step; returns `ax`."""
        return self.drawing().onto(ax)

    def drawing(self) -> Drawing:
        """A drawing of each finding with its counterexample, step by step."""
        scheme = self.book.scheme
        return report_drawing(self.summary, [finding.counterexample(scheme) for finding in self.findings], scheme)


def check(
    book: RuleBook,
    max_cubes: int | None = None,
    max_species: int = MAX_SPECIES,
    slow_waves: bool = True,
    progress: Callable[[int, int], None] | None = None,
) -> Report:
    """Explore a book and report all that is wrong with it.

    max_cubes, max_species : caps of the exploration, as in `derive`
    slow_waves : also let cubes collide while internal rules are still at work, each cube changing by itself; faults
        that occur only then are warnings
    """
    fresh = replace(book)  # it has fired no rule yet
    found = explore(fresh, max_cubes, max_species, progress=progress)
    examined = _Examined(found)
    findings = [*examined.closure(), *examined.shapes(), *examined.squeezes()]
    if found.is_closed:
        findings += [*_starvation(examined), *_idle(fresh, found.structures)]
    if slow_waves and book.internal and found.is_closed:
        most = MORE_IN_WAVES * max_species
        apart = _Examined(explore(book, max_cubes, most, progress=progress, slow_waves=True))
        known = {finding.kind for finding in findings}
        slow = (finding for finding in (*apart.closure(), *apart.shapes()) if finding.kind not in known)
        findings += [replace(finding, kind=SLOW + finding.kind, is_error=False) for finding in slow]
    findings.sort(key=lambda finding: not finding.is_error)
    return Report(book, len(found.structures), len(found.events), tuple(findings))


class _Examined:
    """An exploration with what the checks look up in it."""

    def __init__(self, found: Exploration):
        self.found, self.book = found, found.book
        names = {structure: name for name, structure in named(found).structures.items()}
        self.names = [names[structure] for structure in found.structures]

    @cached_property
    def target(self) -> int | None:
        """Index of the target; None where the book names none or never makes it."""
        if self.book.target is None:
            return None
        canonical = self.book.target.canonical(self.book.scheme)
        return self.found.structures.index(canonical) if canonical in self.found.structures else None

    def closure(self) -> Iterable[Finding]:
        """Structures without end, explorations without end, rules without rest."""
        found = self.found
        if found.beyond is not None:
            a, b, made = found.beyond
            known = {structure: index for index, structure in enumerate(found.structures)}
            steps, changes = self.as_steps(self.way(known[a], known[b]))
            last = f"{self.names[known[a]]} + {self.names[known[b]]} -> {len(made)} cubes: {made}"
            text = f"structures grow beyond {found.max_cubes} cubes; the smallest join that does makes {len(made)}"
            yield Finding("not closed", True, text, (*steps, last), made, (*changes, Change((a, b), (made,))))
        if found.stopped:
            yield Finding("not proven", True, found.stopped)
        for text in found.livelocks[:1]:
            yield Finding("livelock", True, f"{text} ({len(found.livelocks)} such events)")

    def shapes(self) -> Iterable[Finding]:
        """What is no part of the target, and what never becomes it."""
        target, structures = self.book.target, self.found.structures
        if target is None:
            return
        off = [n for n, structure in enumerate(structures) if not fits_into(structure, target, self.book.scheme)]
        if off:
            worst = min(off, key=lambda n: (self.costs[n], len(structures[n])))
            text = f"{len(off)} of {len(structures)} structures are no part of the target; the nearest"
            yield self.finding("off-target", True, text, worst)
        if self.target is None:
            yield from self._missing(target)
            return
        growing = [e for e in self.found.events if self.target in e.before and len(e.before) == 2]
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
        elif not self.found.stopped:
            yield Finding("target not reached", True, "no structure has the target's shape", (), canonical)

    def _lost(self) -> Iterable[Finding]:
        """Structures from which no chain of events leads into the target."""
        structures, events = self.found.structures, self.found.events
        sources: dict[int, set[int]] = {n: set() for n in range(len(structures))}
        for event in events:
            for after in event.after:
                sources[after].update(event.before)
        good = leading_to([self.target] if self.target is not None else [], sources)
        lost = [n for n in range(len(structures)) if n not in good]
        active = {n for event in events for n in event.before}
        for kind, which, text in (
            ("dead end", [n for n in lost if n not in active], "structures can neither grow nor break"),
            ("trap", [n for n in lost if n in active], "structures change on but never become part of the target"),
        ):
            if which:
                nearest = min(which, key=lambda n: (self.costs[n], len(structures[n])))
                yield self.finding(kind, True, f"{len(which)} {text}; the nearest", nearest)

    def squeezes(self) -> Iterable[Finding]:
        """Joins that put a cube between two others."""
        tight = self.found.squeezed
        if tight:
            event = min(tight, key=lambda e: sum(self.costs[n] for n in e.before))
            text = f"{len(tight)} joins put a cube between two opposite ones, where it hardly gets in; the nearest"
            yield self.at_event("squeezed", False, text, event)

    @cached_property
    def costs(self) -> list[float]:
        """The fewest events that make each structure."""
        return self._shortest[0]

    @cached_property
    def _shortest(self) -> tuple[list[float], dict[int, StructureEvent]]:
        starts = range(1 if self.book.seed_letter is None else 2)
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
        """Events in words and as structures."""
        steps = [
            (self.words(e), Change(*(tuple(self.found.structures[n] for n in side) for side in e))) for e in events
        ]
        return tuple(words for words, _ in steps), tuple(change for _, change in steps)

    def words(self, event: StructureEvent) -> str:
        """`monomer + dimer -> trimer`, with the structure that a join makes."""
        before, after = (" + ".join(self.names[n] for n in side) for side in event)
        shown = f": {self.found.structures[event.after[0]]}" if len(event.after) == 1 else ""
        return f"{before} -> {after}{shown}"


def _starvation(examined: _Examined) -> Iterable[Finding]:
    """A tank that can no longer assemble as many targets as its cubes would make; the smallest such tank."""
    book, structures, target = examined.book, examined.found.structures, examined.target
    if target is None:
        return
    size = len(structures[target])
    for cubes in [size] if book.seed_letter is not None else range(size, 2 * size + 1):
        start = (0,) * cubes if book.seed_letter is None else (*(0,) * (cubes - 1), 1)
        tank = compositions(start, examined.found.events)
        if tank is None:
            text = f"starvation: {cubes} cubes come in more than {MAX_COMPOSITIONS} compositions"
            yield Finding("not proven", False, text)
            return
        full = 1 if book.seed_letter is not None else cubes // size
        sources: dict[Indices, set[Indices]] = {state: set() for state in tank}
        for state, following in tank.items():
            for _, after in following:
                sources[after].add(state)
        good = leading_to([state for state in tank if state.count(target) >= full], sources)
        bad = [state for state in tank if state not in good]  # in the order of distance
        if not bad:
            continue
        stuck = next((state for state in bad if not tank[state]), bad[0])
        contents = " + ".join(examined.names[n] for n in stuck)
        what = "where nothing happens any more" if not tank[stuck] else "from which it does not get there"
        text = f"{cubes} cubes can end as {contents}, {what}: {stuck.count(target)} targets instead of {full}"
        steps, changes = examined.as_steps(events_to(stuck, start, tank))
        yield Finding("starvation", False, text, steps, changes=changes)
        return


def _idle(book: RuleBook, structures: Iterable[Structure]) -> Iterable[Finding]:
    """Rules that never act, letters that never occur."""
    for rule in book.all_rules:
        if rule.rule not in book.fired:
            text = f"rule {rule.rule} never acts; leave it out, or check what it asks"
            yield Finding("unreachable rule", False, text)
    seen = {letter for structure in structures for letter in structure.letters}
    for letter in book.letters:
        if letter not in seen:
            yield Finding("unused letter", False, f"no cube of a settled structure is ever in state {letter!r}")
