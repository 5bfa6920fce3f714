"""The checker: faults of a rule book, found by exploring all it can do, each with the shortest sequence of events."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import replace

from kinetics.assembly.checking.examined import Examined
from kinetics.assembly.checking.findings import Finding, Report
from kinetics.assembly.checking.tanks import in_tanks
from kinetics.assembly.deriving.explore import MAX_SPECIES, explore
from kinetics.assembly.rules.rule_book import RuleBook
from kinetics.assembly.structure import Structure

MORE_IN_WAVES = 10  # times as many structures may be found in the middle of waves as at rest
SLOW = "slow internal waves: "


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
    examined = Examined(found)
    findings = [*examined.closure(), *examined.shapes(), *examined.squeezes()]
    home, starving = in_tanks(examined)
    findings += starving
    if found.is_closed:
        findings += _idle(fresh, found.structures)
    if slow_waves and book.internal and found.is_closed:
        most = MORE_IN_WAVES * max_species
        apart = Examined(explore(book, max_cubes, most, progress=progress, slow_waves=True))
        known = {finding.kind for finding in findings}
        slow = (finding for finding in (*apart.closure(), *apart.shapes()) if finding.kind not in known)
        findings += [replace(finding, kind=SLOW + finding.kind, is_error=False) for finding in slow]
    findings.sort(key=lambda finding: not finding.is_error)
    return Report(book, len(found.structures), len(found.events), tuple(findings), home)


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
