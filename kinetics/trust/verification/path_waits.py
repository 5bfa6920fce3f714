"""Waits of the paths times exit rates: exponential, to steps finer than 32 bits, and never the same twice."""

from __future__ import annotations

from collections.abc import Iterator
from math import log
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from kinetics.runs import JumpPath
from kinetics.support.arrays import Floats
from kinetics.trust.verification.base import SamplerCheck, SamplerFinding
from kinetics.trust.verification.sampler_runs import EVENTS, SamplerRuns
from kinetics.trust.verification.tail_bounds import disjoint_pairs, gap_to_uniform, uniform_gap

FINE = 2.0**32  # waits must be right to finer steps than random numbers of 32 bits allow
COARSE = 0.01  # of such a step: as exact as the clock must be if they are looked at
SIZES = tuple(2**k for k in range(3, EVENTS.bit_length()))  # of samples: fixed beforehand, unlike the number of events


class PathWaits(SamplerCheck):
    """In units of the exit rate, the runs put one after the other are a Poisson process, whatever cuts them.

    Gaps between distribution functions by Massart's bound, at the largest of ten fixed numbers of waits that were seen;
    equal waits by the expected number of sets of disjoint equal pairs. A sampler of counts alone has no paths.
    """

    name = "waits"
    sees = "waits that are not exponential, come from random numbers of few bits, or recur in other runs or seeds"

    def findings(self, sample: SamplerRuns) -> Iterator[SamplerFinding]:
        """Yield findings of the paths of the seed, and for equal waits of the next one as well."""
        own, others = _waits(sample.paths), _waits(sample.next_paths)
        yield _gap("waits are exponential", -np.expm1(-own.waits), 0.0)
        # Where the clock itself is coarser than 32 bits there is nothing to see.
        yield _gap("waits are finer than 32 bits", own.steps % 1.0, 2.0 * COARSE)
        for what, steps, most in (
            ("of one seed", own.drawn, EVENTS),
            ("of two seeds", np.concatenate([own.drawn, others.drawn]), 2 * EVENTS),
        ):
            pairs = int((np.unique(np.floor(steps), return_counts=True)[1] // 2).sum()) if steps.size else 0
            p = (1.0 + 3.0 * COARSE) / FINE
            yield SamplerFinding(f"pairs of equal waits {what}", pairs, most**2 / 2 * p, disjoint_pairs(pairs, most, p))


class _Waits(NamedTuple):
    """At most EVENTS waits of paths put one after the other, in units of the exit rate.

    steps : their survival probabilities in steps of 2**-32, where the clock has them; drawn : the same, run by run
    """

    waits: Floats
    steps: Floats
    drawn: Floats


def _waits(paths: tuple[JumpPath, ...]) -> _Waits:
    joined: list[Floats] = [np.empty(0)]
    drawn: list[Floats] = [np.empty(0)]
    finest: list[NDArray[np.bool_]] = [np.empty(0, dtype=bool)]
    left = 0.0
    for path in paths:
        exits = path.network.propensities(path.states).sum(axis=1)
        elapsed = exits * np.diff(np.concatenate([[0.0], path.times, [path.end]]))
        drawn.append(elapsed[:-1].copy())
        elapsed[0] += left  # what the run before had waited when it was cut
        joined.append(elapsed[:-1])
        left = float(elapsed[-1])
        finest.append(np.spacing(path.times) * exits[:-1] * FINE < COARSE)
    every, each = np.concatenate(joined)[:EVENTS], np.concatenate(drawn)[:EVENTS]
    fine = np.concatenate(finest)[:EVENTS]
    return _Waits(every, _steps(every[fine]), _steps(each[fine]))


def _steps(waits: Floats) -> Floats:
    """Survival probabilities in steps of 2**-32; late ones are made of too few."""
    survivals: Floats = np.exp(-waits[waits < log(FINE) / 2])
    return survivals * FINE


def _gap(what: str, values: Floats, slack: float) -> SamplerFinding:
    """Of the first values, in one of the fixed numbers; the bound is for all of these numbers together."""
    size = max((size for size in SIZES if size <= values.size), default=0)
    if size == 0:
        return SamplerFinding(what, 0.0, 0.0, 1.0)
    gap = gap_to_uniform(values[:size])
    return SamplerFinding(what, gap, 0.0, min(len(SIZES) * uniform_gap(gap - slack, size), 1.0))
