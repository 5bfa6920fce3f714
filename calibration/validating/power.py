"""How surely events of held-out runs show that rates are off: one rule, for plans and for verdicts.

The test is that of `event_rows`: the rank of seen / expected events, where rate times exposure of the held-out runs
themselves is expected. The number of events alone would hardly depend on the rates once most cubes are used up.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from calibration.validating.events import HeldOutEvents
from kinetics.support.packages import stats

LEVEL = 0.01  # of a false "not consistent" under the model
OFF_BY = 0.2  # relative
GROUPS = 50  # simulated for each sign, to learn how many events there are; a plan has 100 runs
DRAWS = 2000  # of the rates, for their spread


def power(events: float, factor: float, rates_sd: float, level: float = LEVEL) -> float:
    """Probability of a p-value of at most `level` where rates are `factor` times those drawn from their posterior.

    events : of all held-out runs together, at rates that are off; math.inf gives the limit that the calibration sets
    rates_sd : relative standard deviation that the posterior of the rates leaves to the events expected

    Events at given exposure are taken as Poisson and what is expected as Gamma about its mean, so that their number is
    negative binomial: of mean events / factor in the test, and of mean `events` in truth. Equal numbers are told apart
    by what was expected, as in the test, but for those of no events. Approximate, because exposures depend on events
    and rates: where the calibration leaves 12 % or less, within 0.1 of brute force, and too high rather than too low.
    """
    if not (events > 0 and math.isfinite(rates_sd)):
        return 0.0
    if events < math.inf:
        supposed, true = _counts(events / factor, rates_sd), _counts(events, rates_sd)
        low, high = supposed.ppf(level / 2), supposed.isf(level / 2)
        tie_low = (level / 2 - supposed.cdf(low - 1)) / supposed.pmf(low) if low > 0 else 0.0
        tie_high = (level / 2 - supposed.sf(high)) / supposed.pmf(high)
        below = true.cdf(low - 1) + tie_low * true.pmf(low)
        return float(below + true.sf(high) + tie_high * true.pmf(high))
    if rates_sd == 0:
        return level if factor == 1 else 1.0
    spread = stats.gamma(1 / rates_sd**2, scale=rates_sd**2)
    return float(spread.cdf(spread.ppf(level / 2) / factor) + spread.sf(spread.isf(level / 2) / factor))


def _counts(mean: float, rates_sd: float) -> Any:
    """The distribution of a Poisson number whose mean is Gamma."""
    shape = 1 / rates_sd**2 if rates_sd else math.inf
    return stats.nbinom(shape, shape / (shape + mean)) if shape < 1e9 else stats.poisson(mean)


@dataclass(frozen=True)
class GroupPower:
    """The power of held-out runs for a group of channels, such as all joins.

    expected : events of a run
    rates_sd : relative standard deviation that the calibration leaves to what is expected
    shifted : of each shift (factor of the rates, events of a run)
    """

    group: str
    expected: float
    rates_sd: float
    shifted: tuple[tuple[float, float], ...]

    def power(self, runs: float = 1, level: float = LEVEL) -> float:
        """The power of so many runs for the shift that is hardest to detect; see `power`."""
        # 0 events of infinitely many runs are nan, by which no power is 0
        return min(power(runs * events, factor, self.rates_sd, level) for factor, events in self.shifted)


@dataclass(frozen=True)
class Power:
    """How surely an error of the rates shows in the row of events of one group of channels.

    group : of channels; off_by : relative error of their rates
    in_row, in_verdict : probability of p <= 0.01 in the row by itself, and of a p-value by which the verdict fails; the
        smaller of those for rates that are too low and too high
    """

    group: str
    off_by: float
    in_row: float
    in_verdict: float

    @property
    def sentence(self) -> str:
        """A sentence on the power."""
        return (
            f"{self.group} off by {100 * self.off_by:g} % with probability {100 * self.in_row:.0f} % "
            f"(p ≤ {LEVEL:g} in their row; {100 * self.in_verdict:.0f} % by the verdict)"
        )


def power_of_runs(held_out: Sequence[HeldOutEvents], group: str, off_by: float = OFF_BY) -> GroupPower:
    """The power of all held-out runs of one experiment, or of several pooled, taken as one run."""
    column = held_out[0].names.index(group)
    totals = np.sum([each.expected_by_draw(group, DRAWS) for each in held_out], axis=0)
    mean = float(totals.mean())
    shifted = [
        (factor, sum(float(each.totals_off(group, factor, GROUPS, 2 * column + part).seen[:, column].mean())
                     for each in held_out))
        for part, factor in enumerate((1 - off_by, 1 + off_by))
    ]  # fmt: skip
    expected = sum(float(each.observed.expected[0, column]) for each in held_out)
    return GroupPower(group, expected, float(totals.std(ddof=1)) / mean if mean > 0 else math.inf, tuple(shifted))
