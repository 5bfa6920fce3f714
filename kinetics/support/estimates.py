"""What a sample of independent runs says of a probability, mean, variance or quantile, with an interval."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from kinetics.support.arrays import Floats
from kinetics.support.intervals import binomial_limits, student_quantile
from kinetics.support.packages import special


class SampleEstimate(NamedTuple):
    """An estimate from runs, the ends of its interval, and its standard error; nan where there is none.

    >>> mean_estimate(np.array([1.0, 2.0, 3.0]), 0.95).value
    2.0
    """

    value: float
    low: float
    high: float
    standard_error: float


def probability_estimate(values: Floats, level: float) -> SampleEstimate:
    """Of a probability, from values (runs,) that are 0 or 1; the interval of Clopper & Pearson is exact.

    >>> found = probability_estimate(np.array([0.0, 1.0]), 0.95)
    >>> found.value, round(found.low, 4), round(found.high, 4)
    (0.5, 0.0126, 0.9874)
    """
    _, error = _mean_and_error(values)
    low, high = map(float, binomial_limits(values.sum(), len(values), level))
    return SampleEstimate(float(values.mean()), low, high, error)


def mean_estimate(values: Floats, level: float) -> SampleEstimate:
    """Of a mean, from values (runs,), with Student's interval; none if all are alike.

    >>> [round(each, 4) for each in mean_estimate(np.array([1.0, 2.0, 3.0]), 0.95)]
    [2.0, -0.4841, 4.4841, 0.5774]
    """
    mean, error = _mean_and_error(values)
    half = student_quantile(len(values) - 1, level) * error if error > 0 else np.nan
    return SampleEstimate(mean, mean - half, mean + half, error)


def variance_estimate(values: Floats, level: float) -> SampleEstimate:
    """Of a variance, in the square of the unit of the values (runs,); no interval if all are alike.

    The standard error is s^2 sqrt((m4 / m2^2 - (n - 3) / (n - 1)) / n), from the moments about the mean, and the
    interval is symmetric in the logarithm of the variance: both hold for many runs, without assuming a normal
    distribution (Bonett 2006, doi:10.1016/j.csda.2004.10.003).

    >>> [round(each, 4) for each in variance_estimate(np.arange(100.0), 0.95)]
    [841.6667, 703.2481, 1007.3298, 76.2144]
    """
    n = len(values)
    if n < 2:
        return SampleEstimate(np.nan, np.nan, np.nan, np.nan)
    away = values - values.mean()
    variance = float((away**2).sum() / (n - 1))
    if variance == 0.0:
        return SampleEstimate(0.0, np.nan, np.nan, 0.0)
    shape = float(((away**2 / (away**2).mean()) ** 2).mean())  # m4 over the square of m2: 1 for two values, half each
    relative = float(np.sqrt(max(shape - (n - 3) / (n - 1), 0.0) / n))
    factor = float(np.exp(student_quantile(n - 1, level) * relative))
    return SampleEstimate(variance, variance / factor, variance * factor, relative * variance)


def sd_estimate(values: Floats, level: float) -> SampleEstimate:
    """Of a standard deviation, in the unit of the values (runs,): the root of the variance and of its interval.

    >>> [round(each, 4) for each in sd_estimate(np.arange(100.0), 0.95)]
    [29.0115, 26.5188, 31.7385, 1.3135]
    """
    variance, low, high, error = variance_estimate(values, level)
    sd = float(np.sqrt(variance))
    return SampleEstimate(sd, float(np.sqrt(low)), float(np.sqrt(high)), error / (2.0 * sd) if sd > 0 else error)


def quantile_estimate(values: Floats, q: float, level: float) -> SampleEstimate:
    """Of the least number that a share q (0 < q < 1) of all values does not exceed, from values (runs,) of at least 0.

    The interval lies between two of the ordered values and holds for any distribution, discrete ones too; it ends at 0
    or inf where there are too few runs for an end. There is no standard error.

    >>> quantile_estimate(np.arange(100.0), 0.5, 0.95)[:3]
    (49.0, 39.0, 60.0)
    """
    n, tail = len(values), (1.0 - level) / 2.0
    ordered = np.concatenate([[0.0], np.sort(values), [np.inf]])
    # The number of values up to the quantile is binomial with a chance of q or more, of those below it q or less.
    most = special.bdtr(np.arange(n + 1), n, q)
    low, high = np.searchsorted(most, tail, side="right"), np.searchsorted(most, 1.0 - tail) + 1
    place = np.searchsorted(np.arange(1, n + 1) / n, q)
    return SampleEstimate(float(ordered[place + 1]), float(ordered[low]), float(ordered[high]), np.nan)


def _mean_and_error(values: Floats) -> tuple[float, float]:
    runs = len(values)
    error = float(values.std(ddof=1) / np.sqrt(runs)) if runs > 1 else float("nan")
    return float(values.mean()), error
