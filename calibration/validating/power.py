"""What the held-out runs would have shown had the rates been off: power, by simulation under scaled rates."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from calibration.validating.events import EventTotals, WatchedEvents
from calibration.validating.groups import POOLED
from calibration.validating.predictive import DOUBTFUL

LEVEL = 0.01  # of a false "not consistent" under the model
OFF_BY = 0.2  # relative
GROUPS = 300  # simulated for each sign; the standard error of a power is 0.03 at most


@dataclass(frozen=True)
class Power:
    """How surely an error of the rates shows in the row of events of one group of channels.

    group : of channels; off_by : relative error of their rates
    doubtful, failed : probability of p < 0.05, and of a p-value by which the verdict fails; the smaller of those for
        rates that are too low and too high
    """

    group: str
    off_by: float
    doubtful: float
    failed: float

    @property
    def sentence(self) -> str:
        """In words."""
        return (
            f"{self.group} off by {100 * self.off_by:g} % with probability {100 * self.doubtful:.0f} % "
            f"(p < {DOUBTFUL:g}; {100 * self.failed:.0f} % by the verdict)"
        )


def powers(watched: Sequence[WatchedEvents], checks: int) -> tuple[Power, ...]:
    """Of the pooled groups of channels that there are, where the verdict rests on so many checks."""
    return tuple(power(watched, name, checks) for name in watched[0].names if name in POOLED)


def power(
    watched: Sequence[WatchedEvents], group: str, checks: int, off_by: float = OFF_BY, groups: int = GROUPS
) -> Power:
    """Power of the row of `group` over one experiment or several pooled, approximately.

    The held-out runs are simulated with rates 1 + off_by and 1 - off_by times those drawn. The p-values are those of
    the square root of seen / expected under a normal distribution with the mean and spread that it has among the groups
    simulated at first: they reach further than these groups' ranks.
    """
    from scipy.stats import norm

    column = watched[0].names.index(group)
    null = np.sqrt(EventTotals.pooled([each.first_totals for each in watched]).ratio[:, column])
    levels = np.array([DOUBTFUL, LEVEL / checks])
    critical = norm.isf(levels / 2) * null.std(ddof=1)
    shares = []
    for part, factor in enumerate((1 - off_by, 1 + off_by)):
        place = 2 * column + part
        off = EventTotals.pooled([each.totals_off(group, factor, groups, place) for each in watched])
        distances = np.abs(np.sqrt(off.ratio[:, column]) - null.mean())
        shares.append((distances[:, None] >= critical).mean(axis=0))
    doubtful, failed = np.min(shares, axis=0)
    return Power(group, off_by, float(doubtful), float(failed))
