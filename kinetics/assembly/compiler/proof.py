"""The step from a solution of the search to a rule book, and the proof that the book meets the request."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from string import ascii_lowercase
from typing import Any

from kinetics.assembly.checking.checker import check
from kinetics.assembly.compiler.plan import Channel, Plan
from kinetics.assembly.compiler.search import Solution
from kinetics.assembly.compiler.target import PLACEHOLDER
from kinetics.assembly.deriving.derive import derive
from kinetics.assembly.rules.conditions import Combination, Dissociation, Internal, Semantics
from kinetics.assembly.rules.rule_book import RuleBook

FEW = 100  # structures that the check may find; ten times as many in the middle of waves
MERGED = ("partner", "partner_face", "face", "lost", "letter", "roll", "across")  # one-of conditions, in this order


def book_of(plan: Plan, tables: Solution) -> RuleBook:
    """The rule book of a solution: rules that differ in one condition only become one."""
    of = {unknown: ascii_lowercase[number] for unknown, number in tables.letters.items()}
    joined: dict[tuple[Any, ...], str] = {}
    for r, new in tables.joined.items():
        across = None if not plan.senses.across else (of[r.across] if r.across >= 0 else "")
        touched = None if r.touched is None else tuple(sorted(of[n] for n in r.touched))
        around = tuple(sorted(of[n] for n in r.around))
        conditions = (of[r.own], r.face, around, of[r.partner], r.partner_face, r.roll, across, touched)
        joined[conditions] = ascii_lowercase[new]
    lost = {
        (of[r.own], of[r.lost], tuple(sorted(of[n] for n in r.around))): ascii_lowercase[new]
        for r, new in tables.lost.items()
        if tables.letters[r.own] != new
    }
    followed = {
        (ascii_lowercase[own], tuple(ascii_lowercase[n] for n in around)): ascii_lowercase[new]
        for (own, around), new in tables.followed.items()
    }
    names = ("letter", "face", "neighbours", "partner", "partner_face", "roll", "across", "touched")
    combine = [Combination(rule=f"join {n}", **rule) for n, rule in _rules(names, joined)]
    dissociate = [Dissociation(rule=f"break {n}", **rule) for n, rule in _rules(("letter", "lost", "neighbours"), lost)]
    internal = [Internal(rule=f"follow {n}", **rule) for n, rule in _rules(("letter", "neighbours"), followed)]
    used = [tables.letters.values(), tables.joined.values(), tables.lost.values(), tables.followed.values()]
    whole = plan.target.structure(plan.senses.faces)
    last = plan.parts[-1].unknowns
    return RuleBook(
        name=plan.target.name,
        letters=tuple(ascii_lowercase[: max(n for values in used for n in values) + 1]),
        initial="a",
        senses=plan.senses,
        target=whole.with_letters([of[last[cube]] for cube in plan.places]),
        semantics=Semantics(bonds="break" if plan.breaks else "hold"),
        combine=tuple(combine),
        dissociate=tuple(dissociate),
        internal=tuple(internal),
    )


def _rules(names: tuple[str, ...], table: dict[tuple[Any, ...], str]) -> Iterable[tuple[int, dict[str, Any]]]:
    """Rules with their numbers. Those that differ in a single one-of condition are merged."""
    rules = [
        {
            name: ((value,) if name in MERGED and value is not None else value)
            for name, value in zip(names, key, strict=True)
        }
        | {"becomes": becomes}
        for key, becomes in sorted(table.items(), key=repr)
    ]
    for field in (name for name in MERGED if name in names):
        groups: dict[str, dict[str, Any]] = {}
        for rule in rules:
            rest = repr({name: value for name, value in rule.items() if name != field})
            known = groups.setdefault(rest, rule)
            if known is not rule and rule[field] is not None:
                known[field] = tuple(sorted({*known[field], *rule[field]}))
        rules = list(groups.values())
    return enumerate(rules, 1)


class NotProvenError(Exception):
    """The book of a solution is not proven to do what was asked."""


def proven(plan: Plan, tables: Solution, tick: Callable[[], None] = lambda: None) -> tuple[RuleBook, tuple[str, ...]]:
    """The book of a solution, with how it was proven; NotProvenError if it does not do what was asked.

    tick : called again and again; it may raise to end the work
    Neither derivation nor checker know anything of the search: they read the rules alone.
    """
    book = book_of(plan, tables)

    def progress(*_: int) -> None:
        tick()

    derived = derive(book, progress=progress)
    bare = {
        structure: structure.with_letters((PLACEHOLDER,) * len(structure)).canonical(book.scheme)
        for structure in derived.structures.values()
    }
    part_of = {plan.parts[n].structure: n for n in tables.parts}
    found = [part_of.get(shape) for shape in bare.values()]
    if sorted(n for n in found if n is not None) != list(tables.parts) or None in found:
        raise NotProvenError(f"{plan.target.name}: the book makes {[str(s) for s in bare]}, not the parts asked for")
    numbers: list[int] = [n for n in found if n is not None]
    joins, falls = set(), set()
    for before, after in derived.events:
        if len(before) == 2:
            b, a = sorted(numbers[n] for n in before)
            joins.add(Channel(a, b, numbers[after[0]]))
        else:
            b, a = sorted(numbers[n] for n in after)
            falls.add(Channel(a, b, numbers[before[0]]))
    wanted = {broken for broken in plan.breaks if broken.c in tables.parts}
    if joins != set(tables.joins) or falls != wanted:
        odd = ", ".join(sorted(map(plan.name, (joins ^ set(tables.joins)) | (falls ^ wanted))))
        raise NotProvenError(f"{plan.target.name}: the book does not join and break as asked: {odd}")
    report = check(book, max_species=max(len(derived.structures), FEW), progress=progress)
    if not report.is_correct:
        raise NotProvenError(f"{plan.target.name}: the book is not correct: {report}")
    closure = (
        f"derivation: closed; {len(derived.structures)} structures, the target and parts of it, nothing else; "
        f"{len(joins)} joins, exactly those asked for; {len(falls)} breaks"
    )
    warnings = ", ".join(finding.kind for finding in report.findings) or "no warnings"
    waves = f"delayed state updates: {report.waves}"
    return book, (closure, f"check: no errors; {warnings}", waves, f"recoverability: {report.recoverability.text}")
