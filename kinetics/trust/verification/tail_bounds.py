"""P-values that are exact or proven upper bounds, for any number of runs: what the checks of `verify` are judged by."""

from __future__ import annotations

from math import exp, inf, log, log1p, log2, sqrt

import numpy as np

from kinetics.support.arrays import Floats, Ints
from kinetics.support.packages import special

PRIORS = (0.1, 1.0, 10.0, 100.0)  # weights of the Dirichlet priors that are mixed, in numbers of observations


def binomial(hits: Ints, trials: Ints | int, probabilities: Floats, error: float) -> Floats:
    """Exact two-sided p-values of numbers of hits (K,) among independent trials, by the incomplete beta function.

    error : of the probabilities (K,); the largest p-value within it is taken
    """
    k, n = np.asarray(hits, dtype=float), np.asarray(trials, dtype=float)
    low, high = np.clip(probabilities - error, 0.0, 1.0), np.clip(probabilities + error, 0.0, 1.0)
    most = np.where(k < n, special.betainc(np.maximum(n - k, 1.0), k + 1.0, 1.0 - low), 1.0)  # P(at most k hits)
    least = np.where(k > 0, special.betainc(np.maximum(k, 1.0), n - k + 1.0, high), 1.0)  # P(at least k hits)
    return np.asarray(np.minimum(2.0 * np.minimum(most, least), 1.0))


def at_least(hits: int, trials: int, probability: float) -> float:
    """Exact probability of at least so many hits among independent trials, each of at most this probability."""
    return float(special.betainc(hits, trials - hits + 1.0, min(probability, 1.0))) if hits > 0 else 1.0


def bennett(deviation: float, variance: float, width: float, runs: int, error: float = 0.0) -> float:
    """Two-sided bound on the chance that the mean of independent terms is as far from its expectation.

    variance : of a term, exact; width : most by which a term can differ from its expectation
    error : of the expectation; the variance may be wrong by three times error * width
    Bennett (1962), doi:10.1080/01621459.1962.10482149.
    """
    if width == 0.0:
        return 1.0 if abs(deviation) <= error else 0.0
    away = abs(deviation) - error - 1e-12 * width  # the mean itself is summed in doubles
    spread = max(variance, 0.0) + 3.0 * error * width
    if away <= 0.0:
        return 1.0
    if spread == 0.0:
        return 0.0
    u = width * away / spread
    depth = runs * spread / width**2 * ((1.0 + u) * log1p(u) - u)
    return min(2.0 * exp(-depth), 1.0)


def chance(variance: float, width: float, runs: float, p: float) -> float:
    """Deviation of a mean that chance exceeds with probability `p` at most, by Bernstein's inequality."""
    depth = log(2.0 / p)
    third = width * depth / (3.0 * runs)
    return third + sqrt(third**2 + 2.0 * variance * depth / runs)


def uniform_gap(gap: float, size: int) -> float:
    """Bound on the chance of so large a gap between the distribution functions of a sample and of its law.

    Massart (1990), doi:10.1214/aop/1176990746.
    """
    return min(2.0 * exp(-2.0 * size * max(gap, 0.0) ** 2), 1.0)


def rare_events(number: int, expected: float) -> float:
    """Bound on the chance of at least so many of independent events, whose probabilities add up to `expected`.

    The expected number of sets of m events that all happen is at most expected**m / m!.
    """
    if number == 0:
        return 1.0
    return 0.0 if expected == 0.0 else exp(min(number * log(expected) - float(special.gammaln(number + 1.0)), 0.0))


def disjoint_pairs(number: int, members: int, probability: float) -> float:
    """Bound on the chance of so many disjoint pairs of equal members, if two are equal with this probability.

    The expected number of sets of m disjoint equal pairs: n! / ((n - 2m)! m! 2**m) * probability**m.
    """
    if number == 0:
        return 1.0
    if probability == 0.0:
        return 0.0
    n, m = float(members), float(number)
    ways = special.gammaln(n + 1.0) - special.gammaln(n - 2.0 * m + 1.0) - special.gammaln(m + 1.0) - m * log(2.0)
    return exp(min(float(ways) + m * log(probability), 0.0))


def log_evidence(hits: Ints, probabilities: Floats, error: float) -> float:
    """Log of an e-value against the probabilities (K,) of cells, from hits (K,): its expectation is at most 1.

    A likelihood ratio: mixtures of Dirichlet distributions about the probabilities, over the probabilities themselves.
    By Markov's inequality exp(-log) is a p-value of the whole distribution, for any number of cells and hits, and
    e-values of independent parts multiply (Grünwald, de Heide & Koolen 2024, doi:10.1093/jrsssb/qkae011).
    """
    n = float(hits.sum())
    weights = np.array(PRIORS)[:, None] * n
    parts = special.gammaln(weights * probabilities + hits) - special.gammaln(weights * probabilities)
    ratios = (
        special.gammaln(weights[:, 0])
        - special.gammaln(weights[:, 0] + n)
        + parts.sum(axis=1)
        - hits @ np.log(probabilities)
    )
    top = float(ratios.max())
    slack = float((hits / probabilities).sum()) * error + 1e-11 * n * log2(n + 2.0)  # and of gammaln
    return top + log(float(np.exp(ratios - top).mean())) - slack


def from_evidence(log_value: float) -> float:
    """The p-value that an e-value gives."""
    return 0.0 if log_value == inf else exp(min(-log_value, 0.0))


def gap_to_uniform(values: Floats) -> float:
    """Largest distance of the empirical distribution function from the uniform one on [0, 1]."""
    ordered = np.sort(values)
    steps = np.arange(ordered.size + 1) / ordered.size
    return float(max((steps[1:] - ordered).max(), (ordered - steps[:-1]).max()))
