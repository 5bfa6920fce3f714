"""P-values of counts over groups, given their sum: valid whatever the number of draws, and as small as they need be.

Under the null n events spread over groups by a multinomial with known shares. Plain draws from it cannot give a p-value
below 1 / draws. These draws come half from the null and half from alternatives that spread or tilt the counts, and are
weighted by the ratio of the probabilities; with the weight of the observation itself counted as a draw, a test at any
level alpha has a size of at most alpha (Harrison 2012, doi:10.1093/biomet/asr079).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Protocol

import numpy as np

from kinetics.support.arrays import Floats, Ints

DRAWS = 3000  # a p-value of 0.01 has a standard error of about a seventh of itself
INFLATIONS = (1.5, 3.0, 8.0, 25.0, 80.0)  # of the variance of counts, under the alternatives that spread them
TILTS = (2.0, 4.0, 7.0, 11.0, 16.0, 25.0)  # of the mean, in standard deviations, to either side


class Proposal(Protocol):
    """A distribution of counts (G,) with a known sum."""

    def draw(self, rng: np.random.Generator, size: int) -> Ints:
        """Counts (size, G)."""

    def log_ratio(self, counts: Ints) -> Floats:
        """Logarithm (size,) of its probability over that under the null."""


class Multinomial:
    """n events over groups with shares (G,), beside a null with the shares `null`."""

    def __init__(self, n: int, share: Floats, null: Floats) -> None:
        self.n, self.share = n, share / share.sum()
        self.log = np.log(np.maximum(self.share, 1e-300)) - np.log(null)

    def draw(self, rng: np.random.Generator, size: int) -> Ints:
        """Counts (size, G)."""
        return rng.multinomial(self.n, self.share, size=size)

    def log_ratio(self, counts: Ints) -> Floats:
        """Of its probability to the null's."""
        return np.asarray(counts @ self.log)


class DirichletMultinomial:
    """n events over groups whose shares vary about those of the null, with `inflation` times the variance."""

    def __init__(self, n: int, null: Floats, inflation: float) -> None:
        self.n, self.null = n, null
        self.alpha = null * (n - inflation) / (inflation - 1)

    def draw(self, rng: np.random.Generator, size: int) -> Ints:
        """Counts (size, G)."""
        return rng.multinomial(self.n, rng.dirichlet(self.alpha, size=size))

    def log_ratio(self, counts: Ints) -> Floats:
        """Of its probability to the null's."""
        from scipy.special import gammaln

        whole = self.alpha.sum()
        rising = (gammaln(counts + self.alpha) - gammaln(self.alpha)).sum(axis=1)
        return np.asarray(rising - gammaln(whole + self.n) + gammaln(whole) - counts @ np.log(self.null))


def spread_test(events: Ints, exposure: Floats, rng: np.random.Generator) -> tuple[float, float]:
    """Pearson's dispersion, about 1 where one rate holds in all groups (G,), and its p-value (one-sided: too large).

    Every group needs exposure, there are two or more, and one event at least.
    """
    n, share = int(events.sum()), exposure / exposure.sum()
    expected = n * share
    proposals = [DirichletMultinomial(n, share, inflation) for inflation in INFLATIONS if inflation < n]

    def statistic(counts: Ints) -> Floats:
        return np.asarray(((counts - expected) ** 2 / expected).sum(axis=-1))

    p_value = weighted_p_value(events, share, proposals, statistic, rng)
    return float(statistic(events)) / (events.size - 1), p_value


def trend_test(events: Ints, exposure: Floats, values: Floats, rng: np.random.Generator) -> tuple[float, float]:
    """Does the rate rise or fall with `values` (G,), not all equal? The score, in standard deviations, and its p-value.

    The score test of a rate proportional to exp(beta * value), two-sided (Cox & Lewis 1966, chapter 3, where the value
    is the time). One event at least.
    """
    n, share = int(events.sum()), exposure / exposure.sum()
    centred = values - share @ values
    spread = float(np.sqrt(share @ centred**2))
    score = centred / (spread * np.sqrt(n))
    # As far as the counts can go; a further tilt would only put all events into one group.
    slopes = [sign * tilt for tilt in TILTS for sign in (-1, 1)]
    proposals = [Multinomial(n, share * np.exp(slope * (score - (slope * score).max() / slope)), share)
                 for slope in slopes]  # fmt: skip
    p_value = weighted_p_value(events, share, proposals, lambda counts: np.abs(counts @ score), rng)
    return float(events @ score), p_value


def weighted_p_value(
    seen: Ints,
    share: Floats,
    proposals: Sequence[Proposal],
    statistic: Callable[[Ints], Floats],
    rng: np.random.Generator,
    draws: int = DRAWS,
) -> float:
    """P-value of `statistic(seen)`, large values being extreme, for counts that are multinomial with shares (G,)."""
    null = Multinomial(int(seen.sum()), share, share)
    each = draws // 2 // max(len(proposals), 1)
    sizes = [draws - each * len(proposals), *[each] * len(proposals)]
    mixed = [null, *proposals]
    drawn = np.concatenate([p.draw(rng, size) for p, size in zip(mixed, sizes, strict=True)])
    counts = np.concatenate([seen[None], drawn])
    logs = np.array([p.log_ratio(counts) + np.log(size / draws) for p, size in zip(mixed, sizes, strict=True)])
    weights = np.exp(-np.logaddexp.reduce(logs, axis=0))
    found = statistic(counts)
    # ties are many with few events, and rounding must not break them
    is_extreme = found >= found[0] * (1 - 1e-9)
    return float(min(weights[is_extreme].sum() / (draws + 1), 1.0))
