"""Peaks over a level: how often a load exceeds a threshold that few or none have reached.

The excesses over a high level v follow a generalised Pareto law (Pickands 1975, doi:10.1214/aos/1176343003):
P(X > v + y | X > v) = (1 + xi y / sigma)^(-1 / xi), an exponential for xi = 0, with an upper end for xi < 0. It is a
limit law: above a level that is reached often it is an approximation, so answers from several levels are compared.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from kinetics.support.arrays import Floats
from kinetics.support.packages import optimize

SHAPES = (-0.9, 1.5)  # xi; below -1 there is no maximum of the likelihood
FEWEST = 20  # excesses that a tail is fitted to
WIDTH = 1.959964  # standard errors of a 95 % interval


@dataclass(frozen=True)
class Tail:
    """Probability that a load above `level` is above `threshold`, by maximum likelihood.

    number : loads above the level
    low, high : 95 % limits by profile likelihood (Davison & Smith 1990, doi:10.1111/j.2517-6161.1990.tb01796.x)
    shape : xi
    """

    level: float
    threshold: float
    number: int
    probability: float
    low: float
    high: float
    shape: float

    def beyond(self, loads: Floats) -> Floats:
        """Probability of being above each of these loads, all above the level."""
        xi = self.shape if abs(self.shape) > 1e-7 else 1e-7
        rise = np.expm1(-xi * np.log(self.probability)) / (self.threshold - self.level)
        beyond: Floats = np.maximum(1 + rise * (loads - self.level), 0.0) ** (-1 / xi)
        return beyond


def fit_tail(loads: Floats, level: float, threshold: float) -> Tail:
    """Fit the tail of loads (H,) above a level. ValueError: too few are above it, or the threshold is not.

    The law is written in the wanted probability p and xi, sigma = xi d / (p^-xi - 1) with d = threshold - level: the
    profile of log p is then one maximisation over xi.
    """
    excess = loads[loads > level] - level
    distance = threshold - level
    if len(excess) < FEWEST:
        raise ValueError(f"{len(excess)} loads above {level:g}; a tail needs {FEWEST}: use more runs, or a lower level")
    if not distance > 0:
        raise ValueError(f"threshold {threshold:g} is not above the level {level:g}: name a higher threshold")

    def best_shape(log_p: float) -> tuple[float, float]:
        found = optimize.minimize_scalar(
            lambda xi: -_log_likelihood(excess, distance, log_p, xi), bounds=SHAPES, method="bounded"
        )
        return -float(found.fun), float(found.x)

    # The maximum lies near what an exponential says, in either direction.
    guess = -distance / float(excess.mean())
    top = optimize.minimize_scalar(lambda z: -best_shape(guess * math.exp(z))[0], bounds=(-3.0, 3.0), method="bounded")
    log_p = guess * math.exp(top.x)
    most, shape = best_shape(log_p)

    def drop(value: float) -> float:
        return 2 * (most - best_shape(value)[0]) - WIDTH**2

    limits = []
    for factor, end in ((2.0, -700.0), (0.5, -1e-6)):
        outer = log_p * factor
        while drop(outer) < 0 and abs(outer) < 700 and abs(outer) > 1e-6:
            outer *= factor
        limits.append(end if drop(outer) < 0 else float(optimize.brentq(drop, log_p, outer, rtol=1e-6)))
    low, high = (math.exp(limit) if limit > -700 else 0.0 for limit in limits)
    return Tail(level, threshold, len(excess), math.exp(log_p), low, high, shape)


def _log_likelihood(excess: Floats, distance: float, log_p: float, xi: float) -> float:
    xi = xi if abs(xi) > 1e-7 else 1e-7
    rise = math.expm1(-xi * log_p) / distance if -xi * log_p < 700 else math.inf  # xi / sigma
    inner = 1 + rise * excess
    if not math.isfinite(rise) or inner.min() <= 0:
        return -1e300
    return -len(excess) * math.log(xi / rise) - (1 + 1 / xi) * float(np.log(inner).sum())
