"""Estimates from censored first-passage times: medians, means, exponents, and the ranking of factors.

A time of inf is one that was not seen by the cap: censored, never left out.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from kinetics.support.arrays import Floats
from kinetics.support.intervals import student_interval, student_quantile
from kinetics.support.packages import special, stats

STEPS = 100  # of Newton's method; the likelihood is concave, and some ten are enough


@dataclass(frozen=True)
class Estimate:
    """A number with its 95 % limits."""

    value: float
    low: float
    high: float


def mean(times: Floats, cap: float) -> Estimate:
    """Mean of min(time, cap) with its Student t interval: with censored times among them, a bound from below."""
    cut = np.minimum(times, cap)
    n = cut.size
    if n < 2:
        return Estimate(float(cut.mean()) if n else math.nan, math.nan, math.nan)
    low, high = student_interval(cut)
    return Estimate(float(cut.mean()), max(float(low), 0.0), min(float(high), cap))  # whatever t says of a few runs


def median(times: Floats) -> Estimate:
    """Median with the interval between two order statistics, at least 95 % whatever the distribution of the times.

    inf where the cap hides it; nan for limits that so few runs cannot give (it takes six).
    """
    n = times.size
    if n == 0:
        return Estimate(math.nan, math.nan, math.nan)
    ordered = np.sort(times)
    middle = ordered[n // 2] if n % 2 else 0.5 * (ordered[n // 2 - 1] + ordered[n // 2])
    rank = int(stats.binom.ppf(0.025, n, 0.5))  # as many below the lower limit: P(fewer below the median) <= 2.5 %
    if rank < 1:
        return Estimate(float(middle), math.nan, math.nan)
    return Estimate(float(middle), float(ordered[rank - 1]), float(ordered[n - rank]))


@dataclass(frozen=True, eq=False)
class LogFit:
    """log time = design . slopes + scatter x normal, by maximum likelihood; a censored time is later than the cap.

    Without censoring it is least squares on the logarithms, whose slopes need no normal distribution.

    slopes (P,), covariance (P, P) : of the coefficients, n / (n - P) for the scatter's own uncertainty included
    scatter : standard deviation of log time; log_likelihood; freedom : times seen minus coefficients
    """

    slopes: Floats
    covariance: Floats
    scatter: float
    log_likelihood: float
    freedom: int

    def slope(self, column: int) -> Estimate:
        """One coefficient with its 95 % Student t interval."""
        value = float(self.slopes[column])
        half = float(student_quantile(self.freedom) * math.sqrt(self.covariance[column, column]))
        return Estimate(value, value - half, value + half)


def fit_log(times: Floats, design: Floats, cap: float) -> LogFit:
    """Fit log times (n,) on a design (n, P).

    In Olsen's (1978) parameters, slopes / scatter and 1 / scatter, the log-likelihood is concave.
    ValueError: too few times were seen, or the columns of the design depend on each other.
    """
    seen = np.isfinite(times)
    n, width = design.shape
    if seen.sum() <= width or np.linalg.matrix_rank(design[seen]) < width:
        raise ValueError(
            f"{int(seen.sum())} of {n} first times were observed before the cap, at too few points to fit {width} "
            f"coefficients; make more runs, or use a longer cap"
        )
    y = np.log(np.minimum(times, cap))
    rows = np.column_stack([-design, y])
    start, *_ = np.linalg.lstsq(design, y, rcond=None)
    spread = max(float(np.std(y - design @ start)), 1e-6)
    at = np.append(start, 1.0) / spread
    for _ in range(STEPS):
        z = rows @ at
        # of a censored time, log(1 - Phi(z)) with slope -hazard
        hazard = np.exp(-0.5 * z**2 - 0.5 * math.log(2 * math.pi) - special.log_ndtr(-z))
        pull, bend = np.where(seen, z, hazard), np.where(seen, 1.0, hazard * (hazard - z))
        gradient = -rows.T @ pull
        gradient[-1] += seen.sum() / at[-1]
        hessian = -(rows.T * bend) @ rows
        hessian[-1, -1] -= seen.sum() / at[-1] ** 2
        step = np.linalg.solve(hessian, gradient)
        longest = 1.0 if step[-1] <= 0 else 0.9 * at[-1] / step[-1]  # 1 / scatter stays above 0
        at = at - min(1.0, longest) * step
        if abs(gradient @ step) < 1e-18 * n:
            break
    z, theta = rows @ at, at[-1]
    log_likelihood = float(
        np.sum(np.where(seen, math.log(theta) - 0.5 * math.log(2 * math.pi) - 0.5 * z**2, special.log_ndtr(-z)))
    )
    jacobian = np.column_stack([np.eye(width) / theta, -at[:-1] / theta**2])
    freedom = int(seen.sum()) - width
    covariance = jacobian @ np.linalg.solve(-hessian, jacobian.T) * (seen.sum() / freedom)
    return LogFit(at[:-1] / theta, covariance, 1.0 / theta, log_likelihood, freedom)


def exponents(times: Sequence[Floats], levels: Floats, cap: float) -> tuple[Estimate, ...]:
    """Exponents of the factors in time ~ product of level^exponent.

    times : one array a point; levels : (points, factors), above 0
    """
    design, all_times = _rows(times, np.column_stack([np.ones(len(levels)), np.log(levels)]))
    fit = fit_log(all_times, design, cap)
    return tuple(fit.slope(1 + i) for i in range(levels.shape[1]))


@dataclass(frozen=True)
class Share:
    """Loss of fit when the effect of some factors is left out.

    f, freedom, rest : variance ratio, its degrees of freedom and those of the scatter
    spread : standard deviation of a factor's effect over the points, in log time; nan for an interaction
    """

    factors: tuple[str, ...]
    f: float
    freedom: int
    rest: int
    p_value: float
    spread: float = math.nan


def ranking(names: Sequence[str], times: Sequence[Floats], levels: Floats, cap: float) -> tuple[Share, ...]:
    """Analysis of variance in log time: factors by what they explain, the largest first, then each pair's interaction.

    Levels are classes here, no power law is assumed: a factor is left out of the model of all main effects, a pair's
    interaction is added to it. Small p-value: it matters. An interaction in log time means that a factor's ratio of
    times is not the same at all levels of the other. The F test is exact for normal scatter without censoring.
    """
    main = [_classes(levels[:, i]) for i in range(len(names))]
    ones = np.ones((len(levels), 1))

    def fit(parts: Sequence[Floats]) -> LogFit:
        design, all_times = _rows(times, np.column_stack([ones, *parts]))
        return fit_log(all_times, design, cap)

    full = fit(main)
    shares, column = [], 1
    for i, name in enumerate(names):
        width = main[i].shape[1]
        tested = _test(fit([part for j, part in enumerate(main) if j != i]), full)
        effect = main[i] @ full.slopes[column : column + width]
        column += width
        shares.append(Share((name,), *tested, float(effect.std())))
    shares.sort(key=lambda share: -share.spread)
    for i in range(len(names)):
        for j in range(i):
            both = np.einsum("pi,pj->pij", main[j], main[i]).reshape(len(levels), -1)
            shares.append(Share((names[j], names[i]), *_test(full, fit([*main, both]))))
    return tuple(shares)


def power(x: Floats, y: Floats) -> Estimate:
    """Exponent of y ~ x^p through points that scatter alike in log y: least squares with the Student t interval."""
    fit = fit_log(y, np.column_stack([np.ones_like(x), np.log(x)]), math.inf)
    return fit.slope(1)


def _test(smaller: LogFit, larger: LogFit) -> tuple[float, int, int, float]:
    """F test of the coefficients that only the larger model has: ratio, degrees of freedom, p-value."""
    seen = larger.freedom + larger.slopes.size
    freedom = larger.slopes.size - smaller.slopes.size
    won = max(2 * (larger.log_likelihood - smaller.log_likelihood), 0.0)
    # Without censoring this is the ratio of the sums of squares.
    f = math.expm1(won / seen) * larger.freedom / freedom
    return f, freedom, larger.freedom, float(special.fdtrc(freedom, larger.freedom, f))


def _rows(times: Sequence[Floats], design: Floats) -> tuple[Floats, Floats]:
    """A row of the design for every run, and all times in that order."""
    return np.repeat(design, [each.size for each in times], axis=0), np.concatenate(list(times))


def _classes(levels: Floats) -> Floats:
    """Indicators (points, levels - 1) of all levels but the first."""
    indicators: Floats = (levels[:, None] == np.unique(levels)[None, 1:]).astype(float)
    return indicators
