"""P-values of counts over groups, and of gaps between events, given their sum: valid whatever the number of draws, and
as small as they need be.

Under the null n events spread over groups by a multinomial with known shares. Plain draws from it cannot give a p-value
below 1 / draws. These draws come half from the null and half from alternatives that spread or tilt the counts, and are
weighted by the ratio of the probabilities; with the weight of the observation itself counted as a draw, a test at any
level alpha has a size of at most alpha (Harrison 2012, doi:10.1093/biomet/asr079).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple, Protocol

import numpy as np

from kinetics.support.arrays import Floats, Ints
from kinetics.support.packages import special

DRAWS = 3000  # a p-value of 0.01 has a standard error of about a seventh of itself
INFLATIONS = (1.5, 3.0, 8.0, 25.0, 80.0)  # of the variance of counts, under the alternatives that spread them
STEPS = (1.0, 2.5, 4.5, 7.0, 11.0)  # of the logarithm of the shape of gaps, in standard deviations to either side
LARGEST, FEWEST_DRAWS = 1_500_000, 200  # numbers drawn for a test of gaps, and its draws where there are very many
TILTS = (2.0, 4.0, 7.0, 11.0, 16.0, 25.0)  # of the mean, in standard deviations, to either side


class Proposal(Protocol):
    """A distribution of counts or gaps (G,) with a known sum."""

    def draw(self, rng: np.random.Generator, size: int) -> Any:
        """Counts or gaps (size, G)."""

    def log_ratio(self, counts: Any, /) -> Floats:
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
        """Logarithm (size,) of the ratio of its probability to the null's."""
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
        """Logarithm (size,) of the ratio of its probability to the null's."""
        whole = self.alpha.sum()
        rising = (special.gammaln(counts + self.alpha) - special.gammaln(self.alpha)).sum(axis=1)
        return np.asarray(
            rising - special.gammaln(whole + self.n) + special.gammaln(whole) - counts @ np.log(self.null)
        )


class Spacings:
    """n gaps (n,) that sum to 1, Dirichlet of one shape: 1, the null, between points without order, below it clustered
    and above it regular."""

    def __init__(self, n: int, shape: float) -> None:
        self.n, self.shape = n, shape

    def draw(self, rng: np.random.Generator, size: int) -> Floats:
        """Gaps (size, n)."""
        drawn = np.maximum(rng.standard_gamma(self.shape, (size, self.n)), 1e-300)
        return np.asarray(drawn / drawn.sum(axis=1, keepdims=True))

    def log_ratio(self, gaps: Floats) -> Floats:
        """Logarithm (size,) of the ratio of its density to the null's."""
        of_shape = special.gammaln(self.n * self.shape) - self.n * special.gammaln(self.shape) - special.gammaln(self.n)
        return np.asarray(of_shape + (self.shape - 1) * np.log(gaps).sum(axis=1))


class Independent:
    """Counts of several tables, one after the other, each with its own distribution."""

    def __init__(self, tables: Sequence[Multinomial]) -> None:
        self.tables = tables
        self.ends = np.cumsum([table.share.size for table in tables])

    def draw(self, rng: np.random.Generator, size: int) -> Ints:
        """Counts (size, G)."""
        return np.concatenate([table.draw(rng, size) for table in self.tables], axis=1)

    def log_ratio(self, counts: Ints) -> Floats:
        """Logarithm (size,) of the ratio of its probability to the null's."""
        parts = np.split(counts, self.ends[:-1], axis=1)
        ratios = [table.log_ratio(part) for table, part in zip(self.tables, parts, strict=True)]
        return np.asarray(np.sum(ratios, axis=0))


def spread_test(
    events: Ints, exposure: Floats, rng: np.random.Generator, *, by_expected: bool = True
) -> tuple[float, float]:
    """The dispersion of counts, about 1 under one rate in all groups (G,), and its p-value (one-sided: too large).

    Statistic: squares of seen less expected events, each over the expected number (Pearson), or, not `by_expected`, as
    they are. The mean of (n - kx)^2 is that of kx whatever ends the exposure x, as n - kx is a martingale; that of
    (n - kx)^2 / kx is above 1 if an event uses up its own reactant, and so ends x early.

    Every group needs exposure, there are two or more, and one event at least.
    """
    n, share = int(events.sum()), exposure / exposure.sum()
    expected = n * share
    scale = expected if by_expected else np.ones(share.size)
    proposals = [DirichletMultinomial(n, share, inflation) for inflation in INFLATIONS if inflation < n]

    def statistic(counts: Ints) -> Floats:
        return np.asarray(((counts - expected) ** 2 / scale).sum(axis=-1))

    p_value = weighted_p_value(events, Multinomial(n, share, share), proposals, statistic, rng)
    return float(statistic(events) / (expected * (1 - share) / scale).sum()), p_value


class Trended(NamedTuple):
    """Events and exposure (G,) of one channel in groups with known values (G,), not all equal; one event at least."""

    events: Ints
    exposure: Floats
    values: Floats


def trend_test(channels: Sequence[Trended], rng: np.random.Generator) -> tuple[float, float]:
    """Do the rates of one or more channels rise or fall with a value? The score, in standard deviations, and its p.

    The score test of rates proportional to exp(beta * value), one beta for all channels and a constant for each;
    two-sided (Cox & Lewis 1966, chapter 3, where the value is the time).
    """
    shares = [table.exposure / table.exposure.sum() for table in channels]
    sums = [int(table.events.sum()) for table in channels]
    centred = [table.values - share @ table.values for table, share in zip(channels, shares, strict=True)]
    variance = sum(n * (share @ c**2) for n, share, c in zip(sums, shares, centred, strict=True))
    scores = [c / np.sqrt(variance) for c in centred]

    def tilted(slope: float) -> Independent:
        """A proposal whose rates go as exp(slope * score)."""
        logs = [slope * score for score in scores]
        shifted = [share * np.exp(log - log.max()) for share, log in zip(shares, logs, strict=True)]
        return Independent([Multinomial(*each) for each in zip(sums, shifted, shares, strict=True)])

    every = np.concatenate(scores)
    seen = np.concatenate([table.events for table in channels])
    p_value = weighted_p_value(
        seen, tilted(0.0), [tilted(sign * t) for t in TILTS for sign in (-1, 1)], lambda x: np.abs(x @ every), rng
    )
    return float(seen @ every), p_value


def spacing_test(gaps: Floats, rng: np.random.Generator) -> tuple[float, float]:
    """Anderson-Darling statistic of gaps (n,) against exponentials of unknown mean, and its p-value.

    Gaps of 0, of which an exponential has none, count as 1e-12 of the mean. n is 2 or more.
    """
    n = gaps.size
    shares = np.maximum(gaps, 1e-12 * gaps.mean())
    shares = shares / shares.sum()
    proposals = [Spacings(n, float(np.exp(sign * step / n**0.5))) for step in STEPS for sign in (-1, 1)]
    draws = int(np.clip(LARGEST // n, FEWEST_DRAWS, DRAWS))
    found = weighted_p_value(shares, Spacings(n, 1.0), proposals, anderson_darling, rng, draws)
    return float(anderson_darling(shares[None])[0]), found


def anderson_darling(shares: Floats) -> Floats:
    """Statistic (k,) of samples (k, n) of gaps that sum to 1, against the exponential with their mean (Anderson &
    Darling 1954)."""
    n = shares.shape[-1]
    x = np.sort(shares, axis=-1) * n
    odd = 2 * np.arange(1, n + 1) - 1
    return np.asarray(-n - (odd * (np.log(-np.expm1(-x)) - x[..., ::-1])).sum(axis=-1) / n)


def weighted_p_value(
    seen: Any,
    null: Proposal,
    proposals: Sequence[Proposal],
    statistic: Callable[[Any], Floats],
    rng: np.random.Generator,
    draws: int = DRAWS,
) -> float:
    """P-value of `statistic(seen)` for counts or gaps (G,) that follow `null`; large values are extreme."""
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
    smallest = np.finfo(float).tiny  # nothing is impossible
    return float(np.clip(weights[is_extreme].sum() / (draws + 1), smallest, 1.0))
