"""The rules of a plan, held against what came: each a bar that the prediction clears or misses."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

from calibration.estimating.joins_and_breaks import BREAKS, WHOLES
from calibration.pipeline.plan import VerdictRules
from calibration.validating.events import EventRow
from calibration.validating.over_sizes import ComparedSizes
from kinetics.support.tables import figure


@dataclass(frozen=True)
class Bar:
    """One rule, stated before the runs, and what came of it.

    rule : as text
    came : the value found, as text
    is_cleared : whether the rule holds; None if the runs cannot say, for want of events
    """

    rule: str
    came: str
    is_cleared: bool | None

    def to_dict(self) -> dict[str, Any]:
        """The bar as a row for tables and JSON."""
        return vars(self)

    @property
    def sentence(self) -> str:
        """A sentence with the rule, the verdict and the value found."""
        word = {True: "holds", False: "fails", None: "cannot be judged"}[self.is_cleared]
        return f"{self.rule}: {word} ({self.came})"


def bars(rules: VerdictRules, compared: ComparedSizes, control: ComparedSizes | None = None) -> list[Bar]:
    """All rules of a plan. Rows are those of all joins together and of all breaks together.

    control : the same runs, compared with the rates of the model that must fail. Only its rows of breaks are judged,
        because both models have the same rates of joins

    Even a correct model fails the rule on the smallest p in up to 1 - (1 - p_row)^rows of studies.
    """
    found = _on_events(rules, compared)
    found.append(_on_single_runs(rules, compared))
    if control is not None:
        missed = [bar for bar in _on_events(rules, control, (BREAKS,)) if bar.is_cleared is False]
        came = "; ".join(f"{bar.rule}: {bar.came}" for bar in missed) or "they clear all of them"
        found.append(Bar(f"{rules.control} breaks, the control, fail one of these", came, bool(missed)))
    return found


def _on_events(rules: VerdictRules, compared: ComparedSizes, groups: tuple[str, ...] = WHOLES) -> list[Bar]:
    """The rules on seen and expected events of these groups of channels."""
    rows = [row for row in compared.events if row.group in groups]
    by_size = [row for row in rows if row.cubes is not None]
    pooled = [row for row in [r for r in rows if r.cubes is None] or by_size if row.expected >= rules.from_events]
    least = min(rows, key=lambda row: row.p)
    low, high = rules.ratio
    large = [row for row in by_size if row.expected >= rules.from_events]
    odd = [row for row in large if not low <= _ratio(row) <= high]
    outside = [row for row in pooled if not rules.pooled_ratio[0] <= _ratio(row) <= rules.pooled_ratio[1]]
    return [
        Bar(
            f"p of every row at least {rules.p_row:g}",
            f"least of {len(rows)}: {_shown(least)}, p = {least.p:.2g}",
            least.p >= rules.p_row,
        ),
        Bar(
            f"seen / expected from {low:g} to {high:g} wherever {rules.from_events:g} events are expected",
            ", ".join(map(_shown, odd or large)) or f"no row expects {rules.from_events:g} events",
            not odd if large else None,
        ),
        Bar(
            f"seen / expected over all sizes from {rules.pooled_ratio[0]:g} to {rules.pooled_ratio[1]:g}",
            ", ".join(map(_shown, pooled)) or f"neither expects {rules.from_events:g} events",
            not outside if pooled else None,
        ),
    ]


def _on_single_runs(rules: VerdictRules, compared: ComparedSizes) -> Bar:
    """All single runs together."""
    by_size = ", ".join(f"{comparison.single_runs.p_value:.2g}" for comparison in compared.comparisons)
    came = f"p = {compared.p_single_runs:.2g}; by size {by_size}"
    return Bar(f"p of the PIT of all single runs above {rules.p_pit:g}", came, compared.p_single_runs > rules.p_pit)


def _ratio(row: EventRow) -> float:
    return row.seen / row.expected if row.expected > 0 else math.inf if row.seen else 1.0


def _shown(row: EventRow) -> str:
    return f"{row.group} {row.size} {row.seen} / {row.expected:.4g} = {figure(_ratio(row), '.2f')}"
