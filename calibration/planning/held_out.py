"""How many held-out runs show that rates are off, the uncertainty of the calibration included."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from calibration.planning.forecast import Forecast
from kinetics.support.arrays import Floats

LEVEL = 0.01
MOST_RUNS = 1000


@dataclass(frozen=True)
class GroupPower:
    """What held-out runs can tell of a group of channels, such as all joins.

    The test is that of seen / expected events, where rate times exposure of the held-out runs themselves is expected:
    the mere number of events would hardly depend on the rates once most cubes are used up. Events about the exposure
    have the variance of a Poisson count (they differ by a martingale), the rates that of a count of as many events as
    the calibration saw; the logarithm of the ratio is taken as normal, which is good from some twenty events on.

    expected : events of a run
    rates_sd : relative standard deviation that the calibration leaves to what is expected
    shifted : of each shift (factor of the rates, events of a run)
    """

    group: str
    expected: float
    rates_sd: float
    shifted: tuple[tuple[float, float], ...]

    def power(self, runs: float) -> float:
        """Probability that so many runs differ at level 1 %, for the shift that is hardest to see.

        runs : math.inf gives the limit that the calibration sets
        """
        from scipy.special import ndtr, ndtri

        found = []
        for factor, events in self.shifted:
            if not self._sd(runs * events) < math.inf:
                return 0.0
            # judged by what the rates promise in the states that the shifted assembly is in
            limit = -float(ndtri(LEVEL / 2)) * self._sd(runs * events / factor)
            spread, away = self._sd(runs * events), abs(math.log(factor))
            found.append(float(ndtr((away - limit) / spread)) if spread else float(away > limit))
        return min(found)

    def _sd(self, events: float) -> float:
        """Of the logarithm of seen / expected."""
        return math.hypot(1 / math.sqrt(events), self.rates_sd) if events > 0 else math.inf

    def runs_for(self, power: float) -> int | None:
        """Fewest runs, at least 2, with this power; None where `MOST_RUNS` do not reach it."""
        if self.power(MOST_RUNS) < power:
            return None
        return next(runs for runs in range(2, MOST_RUNS + 1) if self.power(runs) >= power)


def group_powers(
    forecast: Forecast,
    events: ArrayLike,
    groups: Mapping[str, NDArray[np.bool_]],
    initial: ArrayLike,
    duration: float,
    shift: float,
) -> list[GroupPower]:
    """What held-out runs can tell of each group of channels.

    events : (R,) events of each channel that the calibration is to count; the shape of the break model counts as known
    groups : name -> channels (R,) bool of the rule book
    initial, duration : of a held-out run; shift : relative change of the rates of a group, down and up
    """
    seen = np.asarray(events, dtype=float)
    plain = forecast.events(initial, duration)
    found = []
    for name, members in groups.items():
        shifted = [
            (factor, float(forecast.scaled(np.where(members, factor, 1.0)).events(initial, duration)[members].sum()))
            for factor in (1 - shift, 1 + shift)
        ]
        found.append(
            GroupPower(name, float(plain[members].sum()), _rates_sd(plain[members], seen[members]), (*shifted,))
        )
    return found


def _rates_sd(expected: Floats, seen: Floats) -> float:
    """Relative, of a sum of expected events, each from a rate of so many events seen, Jeffreys' half included."""
    total = float(expected.sum())
    return math.sqrt(float((expected**2 / (seen + 0.5)).sum())) / total if total > 0 else math.inf
