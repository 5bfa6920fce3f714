"""Poisson probabilities over a window of counts, with a bound on their error."""

from __future__ import annotations

import numpy as np

from kinetics.support.arrays import Floats

ROUNDOFF = 2.0**-53  # largest relative error of one operation


def poisson_bounds(mean: float, tolerance: float) -> tuple[int, int]:
    """First and last of the numbers outside which a Poisson number lies with probability `tolerance` at most.

    By Chernoff's bound on both sides.
    """
    depth = float(np.log(2.0) - np.log(tolerance))
    below = (2.0 * mean * depth) ** 0.5
    above = depth / 3.0 + (depth**2 / 9.0 + 2.0 * mean * depth) ** 0.5
    return max(0, int(np.floor(mean - below))), int(np.ceil(mean + above))


def poisson_window(mean: float, tolerance: float) -> tuple[int, Floats]:
    """The numbers first, first + 1, ... and their Poisson probabilities, scaled to sum to 1.

    Grown from the mode by ratios, as Fox & Glynn (1988, doi:10.1145/42404.42409) do: no factorial, no logarithm, no
    underflow. Cost: the width of the window, about 12 standard deviations.
    """
    if mean == 0.0:
        return 0, np.ones(1)
    first, last = poisson_bounds(mean, tolerance)
    mode = min(max(int(mean), first), last)
    rising = np.cumprod(mean / np.arange(mode + 1, last + 1))
    falling = np.cumprod(np.arange(mode, first, -1) / mean)[::-1]
    weights = np.concatenate([falling, [1.0], rising])
    return first, weights / weights.sum()


def poisson_tails(first: int, weights: Floats, tolerance: float) -> Floats:
    """P(N > n) or more, for n = 0, 1, ... up to the end of a window that leaves out a tolerance."""
    at_least = np.append(np.ones(first), np.minimum(np.cumsum(weights[::-1])[::-1] + tolerance, 1.0))
    return np.append(at_least[1:], tolerance)


def window_error(mean: float, first: int, weights: Floats, tolerance: float) -> float:
    """Bound on the summed absolute error of a window's weights, numbers outside included.

    What is left out counts twice, because the rest is scaled up for it. Each ratio away from the mode rounds twice; the
    mean itself may be wrong by one rounding, which moves the distribution by the square root of the mean at most.
    """
    away = np.abs(np.arange(first, first + weights.size) - int(mean))
    rounding = 2.0 * float(away @ weights) + 2.0 * float(mean**0.5) + 2.0 * float(np.log2(weights.size)) + 40.0
    return 2.0 * tolerance + ROUNDOFF * rounding
