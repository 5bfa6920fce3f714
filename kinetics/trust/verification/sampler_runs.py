"""The runs of a sampler under test: at the times, at fine times under two neighbouring seeds, and event by event."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from kinetics.runs import Ensemble, JumpPath
from kinetics.sampling import SamplingMethod
from kinetics.support.arrays import Ints
from kinetics.trust.verification.reference import Reference

COMPARED = 2000  # runs, at most, that are compared at fine times
PATHS = 0.1  # of the runs, at most, are made once more event by event
EVENTS = 2**13  # of paths, after which no more are made


class CountSampler(Protocol):
    """The least that can be verified: a name, and runs at given times."""

    @property
    def name(self) -> str:
        """The sampler's name in the report."""

    @property
    def simulate(self) -> Callable[..., Ensemble]:
        """Counts of runs (runs, T, S) at `times` (T,), tu; arguments as for `SamplingMethod.simulate`."""


@dataclass(frozen=True, eq=False)
class SamplerRuns:
    """Runs of one sampler with their reference.

    counts : (runs, T, S) at the reference's times
    fine, next_fine : (m, F, S) at its fine times, of the seed and of the next one
    paths, next_paths : runs 0, 1, ... event by event, likewise; none of a sampler that has counts alone
    """

    reference: Reference
    counts: Ints
    fine: Ints
    next_fine: Ints
    paths: tuple[JumpPath, ...] = ()
    next_paths: tuple[JumpPath, ...] = ()

    @classmethod
    def of(cls, reference: Reference, method: CountSampler, runs: int, seed: int, paths: float = PATHS) -> SamplerRuns:
        """Make the runs; `paths` is the share of them that is made event by event."""

        def counts(times: Any, number: int, seed: int) -> Ints:
            return method.simulate(reference.network, reference.start, times, runs=number, seed=seed).counts

        def events(seed: int) -> tuple[JumpPath, ...]:
            found: list[JumpPath] = []
            if isinstance(method, SamplingMethod):
                number, end = 0, float(reference.solution.times[-1])
                made = method.sample_paths(reference.network, reference.start, end, seed)
                while number < EVENTS and len(found) < int(paths * runs):
                    found.append(next(made))
                    number += found[-1].times.size
            return tuple(found)

        few = min(runs, COMPARED)
        fine, next_fine = (counts(reference.fine_times, few, seed + k) for k in range(2))
        return cls(
            reference, counts(reference.solution.times, runs, seed), fine, next_fine, events(seed), events(seed + 1)
        )

    @property
    def runs(self) -> int:
        """Number of runs."""
        return len(self.counts)

    @cached_property
    def rows(self) -> NDArray[np.intp]:
        """Numbers (runs, T) of the states in the reference's space; -1 for a state that it lacks."""
        return self.reference.solution.space.index_of(self.counts)

    @cached_property
    def fine_rows(self) -> NDArray[np.intp]:
        """State numbers (m, F) at the fine times; -1 for an unknown state."""
        return self.reference.solution.space.index_of(self.fine)

    @cached_property
    def next_fine_rows(self) -> NDArray[np.intp]:
        """State numbers (m, F) at the fine times, of runs with the next seed; -1 for an unknown state."""
        return self.reference.solution.space.index_of(self.next_fine)
