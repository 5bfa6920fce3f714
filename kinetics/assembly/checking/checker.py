"""The checker: faults of a rule book, found by exploring all it can do, each with the shortest sequence of events."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import replace

from kinetics.assembly.checking.exploration_index import ExplorationIndex
from kinetics.assembly.checking.findings import Finding, Report
from kinetics.assembly.checking.tanks import in_tanks
from kinetics.assembly.deriving.explore import MAX_SPECIES, Exploration, explore
from kinetics.assembly.rules.rule_book import RuleBook
from kinetics.assembly.structure import Structure

MORE_IN_WAVES = 10  # times as many structures may be found in the middle of waves as at rest
SLOW = "delayed state updates: "
LEFT_OUT = "left out"


def check(
    book: RuleBook,
    max_cubes: int | None = None,
    max_species: int = MAX_SPECIES,
    slow_waves: bool = True,
    progress: Callable[[int, int], None] | None = None,
) -> Report:
    """Explore a book and report all that is wrong with it.

    max_cubes, max_species : caps of the exploration, as in `derive`
    progress : called with how much is explored and found, of structures, cubes and compositions in turn, at least once
        for each; it may raise to end the work
    slow_waves : also let cubes collide while internal rules are still at work, each cube changing by itself; faults
        that occur only then are warnings

    What forms is explored for any number of seeds, so that seeds may meet; the tanks that are searched hold one.
    """
    found = explore(replace(book), max_cubes, max_species, progress=progress)  # of a book that has fired no rule yet
    return report_of(ExplorationIndex(found, progress), slow_waves)


def report_of(index: ExplorationIndex, slow_waves: bool = True) -> Report:
    """The report on an exploration made before.

    Slow waves are explored up to ten times as many structures, and to twice the cubes of the largest one at rest.
    """
    found, book = index.found, index.book
    findings = [*index.closure(), *index.shapes(), *index.squeezes()]
    recoverability, starving = in_tanks(index)
    findings += starving
    waves = _why_no_waves(found, slow_waves)
    if not waves:
        most, size = MORE_IN_WAVES * found.max_species, 2 * max(map(len, found.structures))
        apart = explore(book, min(found.max_cubes, size), most, progress=index.progress, slow_waves=True)
        known = {finding.kind for finding in findings}
        in_waves = ExplorationIndex(apart, index.progress)
        seen = (*in_waves.closure(), *in_waves.shapes(), *in_waves.squeezes(), *in_tanks(in_waves)[1])
        slow = (finding for finding in seen if finding.kind not in known)
        findings += [replace(finding, kind=SLOW + finding.kind, is_error=False) for finding in slow]
        part = "" if apart.is_closed else " in part"
        waves = f"explored{part}: {len(apart.structures)} structures, including those between two updates"
    if found.is_closed:
        findings += _idle(book, found.structures, " if state updates finish at once" if waves == LEFT_OUT else "")
    findings.sort(key=lambda finding: not finding.is_error)
    return Report(book, len(found.structures), len(found.events), tuple(findings), recoverability, waves)


def _why_no_waves(found: Exploration, slow_waves: bool) -> str:
    """Why slow waves are not explored; "" if they are."""
    if not found.book.internal:
        return "none, as there are no internal rules"
    if not slow_waves:
        return LEFT_OUT
    return "" if found.is_closed else "left out, as even the settled structures are not all known"


def _idle(book: RuleBook, structures: Iterable[Structure], when: str) -> Iterable[Finding]:
    """Rules that never act, or not while nothing else was explored; letters that never occur."""
    for rule in book.all_rules:
        if rule.rule not in book.fired:
            text = f"rule {rule.rule} never acts{when}; leave it out, or check its conditions"
            yield Finding("unreachable rule", False, text)
    seen = {letter for structure in structures for letter in structure.letters}
    for letter in book.letters:
        if letter not in seen:
            yield Finding("unused letter", False, f"no cube of a settled structure is ever in state {letter!r}")
