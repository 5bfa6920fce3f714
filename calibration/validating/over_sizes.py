"""Several comparisons of one study together: pooled events, and one verdict."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

from calibration.validating.comparison import CrossValidation
from calibration.validating.events import EventRow, event_rows
from calibration.validating.overall import overall_verdict
from calibration.validating.single_runs import pooled_p
from calibration.validating.verdict import Verdict, event_checks


@dataclass(frozen=True, eq=False)
class ComparedSizes:
    """Held-out runs of several sizes beside one prediction; their comparisons have different numbers."""

    comparisons: tuple[CrossValidation, ...]

    @cached_property
    def pooled(self) -> tuple[EventRow, ...]:
        """Events over all sizes; none if there is only one.

        Simulated groups of one number share their draw of the rates over all sizes, as the held-out runs share the
        true rates.
        """
        return (
            event_rows([each.held_out for each in self.comparisons], "all sizes") if len(self.comparisons) > 1 else ()
        )

    @property
    def events(self) -> list[EventRow]:
        """Events of every size, then of all sizes pooled."""
        return [row for comparison in self.comparisons for row in comparison.events] + list(self.pooled)

    @cached_property
    def p_single_runs(self) -> float:
        """P-value of the PITs of all single runs together."""
        return pooled_p([comparison.single_runs for comparison in self.comparisons])

    @cached_property
    def verdict(self) -> Verdict:
        """Joins and breaks of all sizes together, and what these runs would have shown."""
        if len(self.comparisons) == 1:
            return self.comparisons[0].verdict
        details = [check for each in self.comparisons for check in each.details]
        details += event_checks(self.pooled, "at all sizes")
        held_out = [each.held_out for each in self.comparisons]
        return overall_verdict(held_out, f"of {len(held_out)} kinds of run", details)

    @property
    def is_consistent(self) -> bool:
        """True if joins and breaks of all sizes together pass their test at 1 %."""
        return self.verdict.is_consistent

    def summary(self) -> list[dict[str, Any]]:
        """One row a size."""
        return [comparison.figures() for comparison in self.comparisons]
