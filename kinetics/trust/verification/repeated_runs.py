"""Runs that are equal although they should be independent, within a seed and from one seed to the next."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from kinetics.support.arrays import Ints
from kinetics.trust.verification.base import SamplerCheck, SamplerFinding
from kinetics.trust.verification.sampler_runs import SamplerRuns
from kinetics.trust.verification.tail_bounds import at_least, disjoint_pairs

LAGS = (1, 2, 3, 4, 8, 16, 64)
PREFIXES = (1, 4, 16)  # all runs, the first quarter, the first sixteenth


class RepeatedRuns(SamplerCheck):
    """Equal runs among pairs at fixed distances, by the binomial distribution; and among all pairs.

    How likely two independent runs agree at all times is a sum of squares over all paths, which the squared transition
    probabilities give.
    """

    name = "repeated runs"
    sees = "runs that occur more than once, in one seed or in two consecutive ones"

    def findings(self, sample: SamplerRuns) -> Iterator[SamplerFinding]:
        """Yield findings at the times, at fine times, and of neighbouring seeds at fine times."""
        reference = sample.reference
        yield from _within("at all times", _labels(sample.counts), reference.repeat_at_times)
        p = reference.repeat_at_fine_times
        both = _labels(np.concatenate([sample.fine, sample.next_fine]))
        own, other = np.split(both, 2)
        yield from _within("at fine times", own, p)
        for shift in (0, 1, -1):
            a, b = own[max(shift, 0) :], other[max(-shift, 0) :]
            size = min(a.size, b.size)
            what = f"runs i + {shift} that equal run i of the next seed" if shift else "runs equal in the next seed"
            yield _pairs(what, a[:size], b[:size], p)
        yield from _anywhere("of two seeds", both, p)


def _labels(counts: Ints) -> NDArray[np.intp]:
    """Numbers (runs,), the same for runs that agree."""
    flat = np.ascontiguousarray(counts.reshape(len(counts), -1))
    whole = flat.view(np.dtype((np.void, flat.dtype.itemsize * flat.shape[1]))).ravel()
    return np.unique(whole, return_inverse=True)[1].ravel()


def _within(where: str, labels: NDArray[np.intp], p: float) -> Iterator[SamplerFinding]:
    n = labels.size
    for lag in sorted({lag for lag in (*LAGS, n // 2) if lag <= n // 2}):
        first = disjoint(n, lag)
        yield _pairs(f"runs i that equal run i + {lag} {where}", labels[first], labels[first + lag], p)
    for part in PREFIXES:
        yield from _anywhere(f"{where} among {n // part} runs", labels[: n // part], p)


def disjoint(n: int, lag: int, colour: int = 0) -> NDArray[np.intp]:
    """The i of pairs (i, i + lag) below n of which no two share a member; colours 0 and 1 give all pairs."""
    i = np.arange(n - lag)
    return i[np.equal(i // lag % 2, colour)]


def _pairs(what: str, a: NDArray[np.intp], b: NDArray[np.intp], p: float) -> SamplerFinding:
    equal = int((a == b).sum())
    return SamplerFinding(what, equal / a.size, p, at_least(equal, a.size, p))


def _anywhere(where: str, labels: NDArray[np.intp], p: float) -> Iterator[SamplerFinding]:
    n = labels.size
    pairs = int((np.bincount(labels) // 2).sum())
    yield SamplerFinding(
        f"disjoint pairs of equal runs {where}", pairs, n * (n - 1) / 2 * p, disjoint_pairs(pairs, n, p)
    )
