"""The verdict on held-out runs, in one sentence, and the details beside it."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from calibration.estimating.joins_and_breaks import WHOLES
from calibration.validating.events import EventRow
from calibration.validating.power import LEVEL, Power
from calibration.validating.predictive import shown_p
from kinetics.support.shown import ResultTable, Shown


@dataclass(frozen=True)
class ConsistencyCheck:
    """One test of the held-out runs.

    what : the check, with seen and expected values
    p, least : p-value, and the smallest that the test can give
    """

    what: str
    p: float
    least: float

    @property
    def sentence(self) -> str:
        """The check and its p-value, on one line."""
        return f"{self.what}, {shown_p(self.p, self.least)}"


@dataclass(frozen=True, repr=False)
class Verdict(Shown):
    """The verdict on whether held-out runs are consistent with the prediction.

    checks : what it rests on, the smallest p-value first
    failed : those that fail at 1 % by Holm's (1979) correction for their number
    details : checks that are shown but not judged, because they are parts of those or depend on them, in the same order
    """

    checks: tuple[ConsistencyCheck, ...]
    failed: tuple[ConsistencyCheck, ...]
    powers: tuple[Power, ...] = ()
    details: tuple[ConsistencyCheck, ...] = ()

    @property
    def headline(self) -> str:
        """One line: the verdict and the number of checks."""
        word = "consistent with the prediction" if self.is_consistent else f"not consistent: {len(self.failed)} fail"
        return f"{word}, {len(self.checks)} check{'s' * (len(self.checks) != 1)} at {100 * LEVEL:g} %"

    def summary(self) -> ResultTable:
        """One row a check, the smallest p-value first."""
        failed = set(self.failed)
        rows = [(check.what, shown_p(check.p, check.least), "fails" * (check in failed)) for check in self.checks]
        rows += [(check.what, shown_p(check.p, check.least), "not judged") for check in self.details]
        notes = [f"so many runs would have shown {power.sentence}" for power in self.powers]
        return ResultTable(self.headline, ("check", "p", ""), rows, notes)

    @property
    def is_consistent(self) -> bool:
        """True if no check failed."""
        return not self.failed

    @property
    def sentence(self) -> str:
        """The verdict, and what failed or what would have shown."""
        if self.failed:
            words = "not consistent: " + "; ".join(check.sentence for check in self.failed)
            return words + (f" (furthest by itself: {self.details[0].sentence})" if self.details else "")
        level = f"at {100 * LEVEL:g} %"
        if len(self.checks) == 1:
            words = f"consistent with the prediction {level}: {self.checks[0].sentence}"
        else:
            words = f"consistent with the prediction in all {len(self.checks)} checks {level}"
            words += f" (closest: {self.checks[0].sentence})" if self.checks else ""
        if self.powers:
            words += "; this many runs would have shown " + ", ".join(power.sentence for power in self.powers)
        return words


def judged(
    checks: Sequence[ConsistencyCheck], powers: Sequence[Power] = (), details: Sequence[ConsistencyCheck] = ()
) -> Verdict:
    """The verdict by Holm's step-down procedure; checks without a p-value are left out."""
    ordered = _by_p(checks)
    failed = []
    for i, check in enumerate(ordered):
        if check.p > LEVEL / (len(ordered) - i):
            break
        failed.append(check)
    return Verdict(tuple(ordered), tuple(failed), tuple(powers), tuple(_by_p(details)))


def _by_p(checks: Sequence[ConsistencyCheck]) -> list[ConsistencyCheck]:
    return sorted((check for check in checks if not math.isnan(check.p)), key=lambda check: check.p)


def event_checks(rows: Sequence[EventRow], where: str) -> list[ConsistencyCheck]:
    """The checks of events of every group of channels, and of the scatter of joins and breaks between runs."""
    checks = []
    for row in rows:
        band = f"{row.expected:.3g} ({row.low:.3g}-{row.high:.3g}) expected"
        checks.append(ConsistencyCheck(f"{row.group} {where} {row.seen} seen, {band}", row.p, row.least))
        if row.group in WHOLES:
            band = f"{row.scatter:.2g} times Poisson's ({row.scatter_low:.2g}-{row.scatter_high:.2g} expected)"
            checks.append(ConsistencyCheck(f"scatter of {row.group} {where} {band}", row.p_scatter, row.least_scatter))
    return checks
