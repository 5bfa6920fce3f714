"""The rules of a plan, held against what came: each is kept, broken, or cannot be judged."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from calibration.estimating.joins_and_breaks import BREAKS, WHOLES
from calibration.pipeline.plan import VerdictRules
from calibration.validating.events import EventRow
from calibration.validating.over_sizes import ComparedSizes
from kinetics.support.tables import figure

WORDS = {True: "kept", False: "broken", None: "cannot be judged"}


@dataclass(frozen=True)
class Bar:
    """One rule, stated before the runs, and what came of it.

    rule : as text
    came : the value found, as text
    is_kept : whether the rule is kept; None if the runs cannot say, for want of events
    """

    rule: str
    came: str
    is_kept: bool | None

    def to_dict(self) -> dict[str, Any]:
        """The bar as a row for tables and JSON."""
        return vars(self)

    @property
    def sentence(self) -> str:
        """A sentence with the rule, the verdict and the value found."""
        return f"{self.rule}: {WORDS[self.is_kept]} ({self.came})"


def in_one_sentence(found: Sequence[Bar]) -> str:
    """How many rules are kept, broken and cannot be judged, and which of them are not kept.

    >>> from calibration.pipeline.bars import Bar, in_one_sentence
    >>> in_one_sentence([Bar("p at least 0.01", "p = 0.3", True), Bar("breaks from 0.9 to 1.1", "1.2", False)])
    'Rules of the plan: 1 kept; 1 broken (breaks from 0.9 to 1.1: 1.2).'
    """
    parts = []
    for kept, word in WORDS.items():
        those = [bar for bar in found if bar.is_kept is kept]
        named = "" if kept else f" ({'; '.join(f'{bar.rule}: {bar.came}' for bar in those)})"
        parts += [f"{len(those)} {word}{named}"] if those else []
    return f"Rules of the plan: {'; '.join(parts)}."


def bars(
    rules: VerdictRules, compared: ComparedSizes, controls: Mapping[str, ComparedSizes] | None = None
) -> list[Bar]:
    """All rules of a plan. Rows are those of all joins together and of all breaks together.

    controls : name -> the same runs, compared with rates that must fail. Only their rows of breaks are judged, because
        all have the same rates of joins

    A range of seen / expected is asked only of rows whose predicted 95 % interval lies within it: wider ones would
    leave it though the model holds. A wider one breaks the rule all the same if its p is below `p_row`. Even a correct
    model breaks the rule on the smallest p in up to 1 - (1 - p_row)^rows of studies.
    """
    found = _on_events(rules, compared)
    found.append(_on_single_runs(rules, compared))
    for name, control in (controls or {}).items():
        missed = [bar for bar in _on_events(rules, control, (BREAKS,)) if bar.is_kept is False]
        came = "; ".join(f"{bar.rule}: {bar.came}" for bar in missed) or "it keeps all of them"
        found.append(Bar(f"the control, {name}, breaks one of these", came, bool(missed)))
    return found


def _on_events(rules: VerdictRules, compared: ComparedSizes, groups: tuple[str, ...] = WHOLES) -> list[Bar]:
    """The rules on seen and expected events of these groups of channels."""
    rows = [row for row in compared.events if row.group in groups]
    by_size = [row for row in rows if row.cubes is not None]
    pooled = [row for row in rows if row.cubes is None] or by_size
    least = min(rows, key=lambda row: row.p)
    on_rows = Bar(
        f"p of every row at least {rules.p_row:g}",
        f"least of {len(rows)}: {_shown(least)}, p = {least.p:.2g}",
        least.p >= rules.p_row,
    )
    low, high = rules.ratio
    found = [on_rows, _on_ratios(f"wherever {rules.from_events:g} events are expected", by_size, (low, high), rules)]
    if rules.pooled_breaks is None:
        return [*found, _on_ratios("over all sizes", pooled, rules.pooled_ratio, rules)]
    ranges = dict(zip(WHOLES, (rules.pooled_ratio, rules.pooled_breaks), strict=True))
    return found + [
        _on_ratios(f"of {group} over all sizes", [row for row in pooled if row.group == group], ranges[group], rules)
        for group in groups
    ]


def _on_ratios(where: str, rows: Sequence[EventRow], allowed: tuple[float, float], rules: VerdictRules) -> Bar:
    """The rule that seen / expected of these rows lies in a range, asked of rows that can keep it."""
    low, high = allowed
    large = [row for row in rows if row.expected >= rules.from_events]
    clear = [row for row in large if low * row.expected <= row.low and row.high <= high * row.expected]
    odd = [row for row in large if not low <= _ratio(row) <= high and (row in clear or row.p < rules.p_row)]
    came = ", ".join(map(_shown, odd or clear))
    if not clear and not odd:
        came = f"no row expects {rules.from_events:g} events"
        if large:
            came = f"predicted intervals are wider: {', '.join(map(_shown_range, large))}"
    return Bar(f"seen / expected {where} from {low:g} to {high:g}", came, not odd if clear or odd else None)


def _on_single_runs(rules: VerdictRules, compared: ComparedSizes) -> Bar:
    """All single runs together."""
    by_size = ", ".join(f"{comparison.single_runs.p_value:.2g}" for comparison in compared.comparisons)
    came = f"p = {compared.p_single_runs:.2g}; by size {by_size}"
    return Bar(f"p of the PIT of all single runs above {rules.p_pit:g}", came, compared.p_single_runs > rules.p_pit)


def _ratio(row: EventRow) -> float:
    return row.seen / row.expected if row.expected > 0 else math.inf if row.seen else 1.0


def _shown(row: EventRow) -> str:
    return f"{row.group} {row.size} {row.seen} / {row.expected:.4g} = {figure(_ratio(row), '.2f')}"


def _shown_range(row: EventRow) -> str:
    return f"{_shown(row)} ({row.low / row.expected:.2f} to {row.high / row.expected:.2f})"
