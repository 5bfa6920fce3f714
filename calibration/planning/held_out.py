"""How many held-out runs show that rates are off, the uncertainty of the calibration included."""

from __future__ import annotations

import math
from bisect import bisect_left
from collections.abc import Mapping
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from calibration.planning.forecast import Forecast
from calibration.validating.power import GroupPower
from kinetics.support.arrays import Floats
from kinetics.support.packages import optimize

MOST_RUNS = 1000


def runs_for(found: GroupPower, wanted: float) -> int | None:
    """Fewest runs, at least 2, with a power; None if `MOST_RUNS` do not reach it."""
    runs = range(2, MOST_RUNS + 1)
    fewest = bisect_left(runs, wanted, key=found.power)
    return runs[fewest] if fewest < len(runs) else None


def widest_sd(found: GroupPower, wanted: float, runs: float = math.inf) -> float | None:
    """Largest relative standard deviation from the calibration at which so many runs reach a power; None: none does."""

    def lacking(log_sd: float) -> float:
        return replace(found, rates_sd=math.exp(log_sd)).power(runs) - wanted

    low, high = math.log(1e-3), math.log(10.0)
    return math.exp(optimize.brentq(lacking, low, high)) if lacking(low) > 0 else None


def group_powers(
    forecast: Forecast,
    events: ArrayLike,
    groups: Mapping[str, NDArray[np.bool_]],
    initial: ArrayLike,
    duration: float,
    shift: float,
) -> list[GroupPower]:
    """The power of held-out runs for each group of channels.

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
