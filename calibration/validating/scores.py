"""Scores of held-out runs against a predicted ensemble: bands, misfit, continuous ranked probability score (CRPS)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from kinetics.support.arrays import Floats, Ints

Counts = NDArray[np.integer[Any]]  # the predicted runs are many, and int32 halves them


@dataclass(frozen=True)
class Score:
    """How well held-out runs fit the predicted ones: CRPS in copies, averaged over runs and times; less is better.

    score : of the held-out runs
    floor : of groups of as many runs made by the model itself, their mean; a perfect model reaches it on average
    p_value : share of those groups that score as badly or worse
    """

    species: str
    score: float
    floor: float
    p_value: float


@dataclass(frozen=True)
class BandShare:
    """A share of points inside a band, and the middle 95 % of what simulated groups have of it.

    Points at neighbouring times, and of different species, hang together, so that the share scatters widely.
    """

    share: float
    low: float
    high: float


def share_inside(seen: np.ndarray, predicted: np.ndarray, low: Floats, high: Floats) -> BandShare:
    """Share of `seen` (...) inside a band, beside those of predicted groups (groups, ...).

    The band was made of the same groups, which pulls their shares up a little: by the order of 1 / groups.
    """
    axes = tuple(range(1, predicted.ndim))
    shares = ((low <= predicted) & (predicted <= high)).mean(axis=axes)
    limits = np.quantile(shares, [0.025, 0.975], method="inverted_cdf")
    return BandShare(float(((low <= seen) & (seen <= high)).mean()), float(limits[0]), float(limits[1]))


def group_scores(species: Sequence[str], counts: Ints, predicted: Counts) -> tuple[Score, ...]:
    """Scores of held-out runs `counts` (n, T, S) among predicted groups (groups, n, T, S): per species, then their sum.

    The predicted runs of all groups together are the predicted distribution.
    """
    pairs = []
    for s in range(len(species)):
        table = crps_table(predicted[..., s].reshape(-1, counts.shape[1]), int(counts[..., s].max(initial=0)))
        at = np.arange(counts.shape[1])
        pairs.append((table[at, counts[..., s]].mean(), table[at, predicted[..., s]].mean(axis=(1, 2))))
    pairs.append((sum(pair[0] for pair in pairs), np.sum([pair[1] for pair in pairs], axis=0)))
    return tuple(
        Score(name, float(own), float(null.mean()), float((1 + np.count_nonzero(null >= own)) / (1 + null.size)))
        for name, (own, null) in zip((*species, "all"), pairs, strict=True)
    )


def crps_table(samples: Counts, largest: int = 0) -> Floats:
    """Continuous ranked probability score (T, M + 1) of 0, 1, ..., M copies against `samples` (n, T).

    Their distribution has steps at whole numbers only, so the integral of (F - 1[x <= .])^2 is a sum (Gneiting &
    Raftery 2007).
    """
    top = max(int(samples.max()), largest)
    cdf = np.array([np.bincount(column, minlength=top + 1) for column in samples.T]).cumsum(axis=1) / len(samples)
    below = np.cumsum(cdf**2, axis=1) - cdf**2
    above = np.cumsum(((1 - cdf) ** 2)[:, ::-1], axis=1)[:, ::-1]
    return below + above


def central_band(samples: np.ndarray, level: float = 0.95) -> tuple[Floats, Floats]:
    """Order statistics over the first axis between which one more sample falls with a chance of at least `level`."""
    n = len(samples)
    rank = int((n + 1) * (1 - level) / 2 + 1e-9)
    if rank < 1:
        raise ValueError(f"{n} samples cannot bound a band of {level:g}; draw at least {int(np.ceil(2 / (1 - level)))}")
    ordered = np.partition(samples, (rank - 1, n - rank), axis=0)
    return ordered[rank - 1].astype(float), ordered[n - rank].astype(float)


def mean_misfit(observed: Floats, means: Floats) -> tuple[float, float]:
    """Mean squared z of a mean trajectory (T, S) among those of predicted groups (groups, T, S), and its p-value.

    About 1 if the observed one is a group like the others. The observed one takes part in the mean and the spread that
    z is taken with, so that under the model all groups + 1 trajectories are on the same footing: the rank is exact.
    """
    everything = np.concatenate([observed[None], means])
    sd = everything.std(axis=0)
    varies = sd > 1e-9
    if not varies.any():
        return 0.0, 1.0
    z = (everything - everything.mean(axis=0))[:, varies] / sd[varies]
    squared = (z**2).mean(axis=1)
    return float(squared[0]), float(np.count_nonzero(squared >= squared[0] * (1 - 1e-9)) / squared.size)
