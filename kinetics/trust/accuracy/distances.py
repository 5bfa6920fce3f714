"""Distances of a result from the exact distribution of each species, and their expectation for exact sampling."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple, Protocol

import numpy as np

from kinetics.support.arrays import Floats
from kinetics.support.packages import stats


class Distance(NamedTuple):
    """The largest over times and species.

    copies : Wasserstein distance, the area between their distribution functions
    total_variation : largest difference in the probability of any set of counts; nan for a number alone
    mean : difference of the means, copies
    """

    copies: float
    total_variation: float
    mean: float


class HasMarginals(Protocol):
    """A distribution, exact or sampled."""

    def marginal(self, species: str) -> Floats:
        """Probabilities (T, M + 1) of 0, 1, ..., M copies of one species."""


@dataclass(frozen=True)
class Marginals:
    """The distribution of each species at each time.

    tables : one (T, M + 1) a species, probabilities of 0, 1, ..., M copies. They may sum to less than one: what is
        missing counts as if it were at the largest count of either table
    """

    tables: Sequence[Floats]

    @classmethod
    def of(cls, result: HasMarginals, species: Sequence[str]) -> Marginals:
        """The marginals of a result that has a `marginal` for each species."""
        return cls([result.marginal(name) for name in species])

    def distance(self, exact: Marginals) -> Distance:
        """The distance from the exact marginals, largest over times and species."""
        found = []
        for mine, theirs in zip(self.tables, exact.tables, strict=True):
            top = max(mine.shape[1], theirs.shape[1])
            p, q = (np.pad(table, ((0, 0), (0, top - table.shape[1]))) for table in (mine, theirs))
            area = np.abs(np.cumsum(p - q, axis=1)[:, :-1]).sum(axis=1)
            missing = p.sum(axis=1) - q.sum(axis=1)
            apart = (np.abs(p - q).sum(axis=1) + np.abs(missing)) / 2
            mean = np.abs((p - q) @ np.arange(top) - missing * (top - 1))
            found.append((area.max(), apart.max(), mean.max()))
        return Distance(*(float(largest) for largest in np.max(found, axis=0)))

    @property
    def top(self) -> int:
        """Largest count of any species."""
        return max(len(table.T) for table in self.tables) - 1


@dataclass(frozen=True)
class Certainty:
    """One number (T, S) for every count, as a rate equation gives it: all its probability is there."""

    values: Floats

    def distance(self, exact: Marginals) -> Distance:
        """The distance from the exact marginals: mean distance of a count from the number."""
        found = []
        for value, table in zip(self.values.T, exact.tables, strict=True):
            off = np.arange(table.shape[1]) - value[:, None]
            found.append(((np.abs(off) * table).sum(axis=1).max(), np.abs((off * table).sum(axis=1)).max()))
        copies, mean = np.max(found, axis=0)
        return Distance(float(copies), float("nan"), float(mean))


def sampling_floor(exact: Marginals, runs: int) -> float:
    """Expected distance, copies, of the shares among `runs` independent exact runs, at the time when it is largest.

    The area between the distribution functions is a sum of |X / n - F| with binomial X, whose mean is known in closed
    form (De Moivre; Diaconis & Zabell 1991). The mean of the largest distance is no smaller than this.
    """
    largest = 0.0
    for table in exact.tables:
        below = np.clip(np.cumsum(table, axis=1)[:, :-1], 0.0, 1.0)
        # E|X - n F| = 2 v P(X = v) (1 - F) with v = floor(n F) + 1; if v > n, F is 1 and nothing is random
        v = np.minimum(np.floor(runs * below) + 1, runs)
        largest = max(largest, float((2 * v * stats.binom.pmf(v, runs, below) * (1 - below) / runs).sum(axis=1).max()))
    return largest
