"""Findings about a rule book, and the report that holds them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple

from kinetics.assembly.checking.recoverability import Scope
from kinetics.assembly.deriving.history import Change, laid_out
from kinetics.assembly.drawing.counterexamples import Counterexample, counterexample_drawing, report_drawing
from kinetics.assembly.drawing.drawing import Drawing
from kinetics.assembly.drawing.pictures import posed
from kinetics.assembly.rules.rule_book import RuleBook
from kinetics.assembly.structure import Structure
from kinetics.support.shown import on_axes


@dataclass(frozen=True)
class Finding:
    """One fault of a rule book.

    kind : `not closed`, `not proven`, `livelock`, `target not reached`, `target not final`, `off-target`, `dead end`,
        `trap`, `starvation`, `squeezed`, `unreachable rule`, `unused letter`; preceded by `delayed state updates: ` if
        it occurs only where internal rules are slower than collisions
    is_error : whether the book is wrong; otherwise the finding is a warning
    steps : descriptions of the shortest sequence of events that leads to the fault
    structure : the structure at the end of that sequence
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

    @on_axes
    def plot(self, ax: Any, scheme: str = "two") -> Any:
        """Draw the fault and how it comes about, step by step; returns `ax`."""
        return counterexample_drawing(self.counterexample(scheme), scheme).onto(ax)


class Recoverability(NamedTuple):
    """The tanks proven recoverable: they can always still make every target that their cubes allow.

    proven : for all tanks (`any tank`), for where free cubes do not run out (`enough free cubes`), or `nothing`
    searched : numbers of cubes of the tanks of which every composition was searched
    text : the same in words
    """

    proven: Scope
    searched: tuple[int, ...]
    text: str


@dataclass(frozen=True, eq=False)
class Report:
    """The findings about a book, errors first, how much was explored, and for which tanks.

    waves : whether collisions between delayed state updates were explored, or why not, as text
    """

    book: RuleBook
    n_structures: int
    n_events: int
    findings: tuple[Finding, ...]
    recoverability: Recoverability
    waves: str

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
        """For people: the summary, for which tanks it holds, whether delayed state updates were explored, then each
        finding."""
        said = [self.summary, f"recoverability: {self.recoverability.text}", f"delayed state updates: {self.waves}"]
        return "\n".join([*said, *map(str, self.findings)])

    @on_axes
    def plot(self, ax: Any) -> Any:
        """Draw each finding with its counterexample, step by step; returns `ax`."""
        return self.drawing().onto(ax)

    def drawing(self) -> Drawing:
        """A drawing of each finding with its counterexample, step by step."""
        scheme = self.book.scheme
        return report_drawing(self.summary, [finding.counterexample(scheme) for finding in self.findings], scheme)
