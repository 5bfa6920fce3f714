"""Runs that know of each other: products of centred counts of two runs, whose mean is 0."""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial

import numpy as np

from kinetics.support.arrays import Floats
from kinetics.trust.verification.base import SamplerCheck, SamplerFinding
from kinetics.trust.verification.repeated_runs import disjoint
from kinetics.trust.verification.sampler_runs import SamplerRuns
from kinetics.trust.verification.tail_bounds import bennett

LAGS = (1, 2, 3, 4, 8)
MOST_SPECIES = 24


class CorrelatedRuns(SamplerCheck):
    """Centred counts of runs i and i + k, and of runs of two seeds, multiplied; pairs are disjoint, so independent.

    Bennett's bound from the exact variance, which is that of a count squared.
    """

    name = "correlated runs"
    sees = "runs or seeds that share random numbers, so that runs are correlated without being equal"

    def findings(self, sample: SamplerRuns) -> Iterator[SamplerFinding]:
        """Yield findings of every species at every time, or of the first 24 species."""
        reference, n = sample.reference, sample.runs
        last_of_gap = slice(reference.parts - 1, None, reference.parts)
        rows = sample.rows, sample.fine_rows[:, last_of_gap], sample.next_fine_rows[:, last_of_gap]
        for t, time in enumerate(reference.solution.times):
            p = reference.solution.probabilities[t]
            for s, name in enumerate(reference.network.species[:MOST_SPECIES]):
                off = reference.shares[t][:, s] - p @ reference.shares[t][:, s]
                variance, width = float(p @ off**2), float(np.abs(off).max())
                # A state that the reference lacks counts as 0; it is as likely as the error allows.
                values = np.append(off, 0.0)
                own, fine, next_fine = (values[part[:, t]] for part in rows)
                product = partial(_product, variance**2, width**2, 4.0 * reference.error)
                at = f"{name} at {time:g} tu"
                for lag in sorted({lag for lag in (*LAGS, n // 2) if lag <= n // 2}):
                    for colour, half in enumerate(("first", "second")):
                        first = disjoint(n, lag, colour)
                        if first.size:
                            yield product(f"{at} of runs i and i + {lag}, {half} half", own[first], own[first + lag])
                yield product(f"{at} of runs i of two seeds", fine, next_fine)
                yield product(f"{at} of runs i + 1 and i of two seeds", fine[1:], next_fine[:-1])
                yield product(f"{at} of runs i and i + 1 of two seeds", fine[:-1], next_fine[1:])


def _product(variance: float, width: float, error: float, what: str, one: Floats, other: Floats) -> SamplerFinding:
    found = float((one * other).mean())
    return SamplerFinding(what, found, 0.0, bennett(found, variance, width, one.size, error * width))
