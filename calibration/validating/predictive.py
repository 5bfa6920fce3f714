"""Predictive p-values and ranges: where something seen ranks among the same thing in simulated groups."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from kinetics.support.arrays import Floats

DOUBTFUL = 0.05  # below this p-value more groups are simulated


def predictive_p(seen: Floats, simulated: Floats, rng: np.random.Generator) -> Floats:
    """Two-sided p-values (K,) of `seen` (K,) by its rank among `simulated` (D, K), ties broken at random.

    Where what was seen is one more group like the others, its rank r is uniform on 1, ..., D + 1, so that
    p = 2 min(r, D + 2 - r) / (D + 1) is at most a with probability a, for each a that it can be: exact.
    """
    n = len(simulated)
    ties = (simulated == seen).sum(axis=0)
    rank = 1 + (simulated < seen).sum(axis=0) + rng.integers(0, ties + 1)
    return np.minimum(2 * np.minimum(rank, n + 2 - rank) / (n + 1), 1.0)


def least_p(groups: int) -> float:
    """The smallest two-sided p-value that so many groups can give."""
    return 2 / (groups + 1)


def staged_p(
    seen: Floats, first: Floats, all_of_them: Callable[[], Floats], rng: np.random.Generator
) -> tuple[Floats, Floats]:
    """`predictive_p` (K,) among the `first` groups, or among all where that is below 0.05; the least possible (K,).

    Valid at every level a: with a < 0.05 the result is at most a only where the second p-value is, and with
    a >= 0.05 only where the first one is, and either has probability at most a.
    """
    p = predictive_p(seen, first, rng)
    least = np.full(p.shape, least_p(len(first)))
    doubtful = p < DOUBTFUL
    if doubtful.any():
        everything = all_of_them()
        p[doubtful] = predictive_p(seen[doubtful], everything[:, doubtful], rng)
        least[doubtful] = least_p(len(everything))
    return p, least


def upper_p(seen: float, simulated: Floats) -> float:
    """Share of the groups, the one seen included, with at least this value."""
    return float((1 + np.count_nonzero(simulated >= seen)) / (1 + simulated.size))


def shown_p(p: float, least: float = 0.0) -> str:
    """A p-value in words; one that no smaller could be is an upper limit."""
    return f"p ≤ {p:.1g}" if p <= least else f"p = {p:.2g}"
