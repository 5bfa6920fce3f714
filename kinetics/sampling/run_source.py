"""The runs of a network that was made ready once: any of them, by number."""

from __future__ import annotations

import os
import threading
from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from kinetics.kernels import outcomes
from kinetics.support.arrays import Floats, Ints
from kinetics.support.memory import check_memory

PIECE = 1000  # runs; an interrupt waits for a piece only
WEIGHED_BYTES = 2**26  # of all counts that are there at a time, where only sums of them are asked for
BLOCK_BYTES = 2**24  # of counts that are there at a time; larger ones cost more to have than to fill
FEWEST_RUNS = 16  # of a block, however large a run is


class StalledClockError(ValueError):
    """Waits became so short that adding one no longer changed the time."""


class Sampler(Protocol):
    """A network made ready for a method. Run number n has the same events however it is asked for."""

    def ensemble(
        self, initial: Ints, grid: Floats, key: NDArray[np.uint64], first_run: int, out: Ints
    ) -> tuple[int, int]:
        """Fill `out` (runs, T, S); the outcome, see `kernels.outcomes`, and the number of the last run begun."""

    def path(self, initial: Ints, end: float, key: NDArray[np.uint64], run: int) -> tuple[int, Floats, Ints]:
        """The outcome, and times and channels of all events until `end`."""


@dataclass(frozen=True, eq=False)
class RunSource:
    """Independent runs from one start, under one seed.

    sampler : the network made ready
    start : (S,) counts at time 0
    key : (4,) from which the random stream of every run is derived, see `base.stream_key`
    weights : (S, V) whole weights, for V sums of counts instead of all counts; None for these
    """

    sampler: Sampler
    start: Ints
    key: NDArray[np.uint64]
    weights: Ints | None = None

    def __post_init__(self) -> None:
        if self.start.ndim != 1:
            raise ValueError(f"start has shape {self.start.shape}; expected (species,)")

    @property
    def width(self) -> int:
        """Number of counts, or sums, of a run at a time."""
        return self.start.size if self.weights is None else self.weights.shape[1]

    def starting_at(self, start: Ints) -> RunSource:
        """The same from other counts (S,)."""
        return replace(self, start=start)

    def counts(self, grid: Floats, runs: int, first_run: int = 0, threads: int | None = None) -> Ints:
        """Counts (runs, T, S), or sums (runs, T, V), at `grid` (T,) of the runs from number `first_run` on.

        threads : at most this many; by default one a processor core
        ValueError: more counts than memory holds, or a run that could not reach its end
        """
        n_species = self.start.size
        if self.weights is None:
            what = f"all counts of {runs} runs of {n_species} species at {grid.size} times"
            advice = "ask for `simulate_statistics`, which does not grow with the runs, or for fewer"
            check_memory(what, 8.0 * runs * grid.size * n_species, advice)
            return self._made(grid, runs, first_run, threads)
        block = max(1, WEIGHED_BYTES // (8 * grid.size * n_species))
        parts = [
            self._made(grid, min(block, runs - begin), first_run + begin, threads) @ self.weights
            for begin in range(0, runs, block)
        ]
        return parts[0] if len(parts) == 1 else np.concatenate(parts)

    def blocks(self, grid: Floats, begin: int, end: int, threads: int | None = None) -> Iterator[Ints]:
        """The same of the runs from number `begin` to before `end`, a block at a time."""
        block = max(FEWEST_RUNS, BLOCK_BYTES // (8 * grid.size * self.width))
        for at in range(begin, end, block):
            yield self.counts(grid, min(block, end - at), at, threads)

    def _made(self, grid: Floats, runs: int, first_run: int, threads: int | None) -> Ints:
        workers = len(os.sched_getaffinity(0)) if threads is None else threads
        out = np.empty((runs, grid.size, self.start.size), dtype=np.int64)
        writable = grid.copy()  # kernels are compiled for one kind of array
        is_stopped = threading.Event()

        def piece(begin: int, end: int) -> tuple[int, int]:
            if is_stopped.is_set():
                raise KeyboardInterrupt
            return self.sampler.ensemble(self.start, writable, self.key, first_run + begin, out[begin:end])

        cuts = [*range(0, runs, max(1, min(runs // workers, PIECE))), runs]
        if workers == 1 or len(cuts) == 2:
            ends = [piece(begin, end) for begin, end in pairwise(cuts)]
        else:
            from concurrent.futures import ThreadPoolExecutor

            with ThreadPoolExecutor(workers) as pool:
                try:
                    ends = list(pool.map(piece, cuts[:-1], cuts[1:]))
                except BaseException:
                    is_stopped.set()
                    pool.shutdown(wait=False, cancel_futures=True)
                    raise
        for outcome, run in ends:
            check_outcome(outcome, run)
        return out


def check_outcome(outcome: int, run: int) -> None:
    """Raise where a run could not reach its end."""
    if outcome == outcomes.STALLED_CLOCK:
        raise StalledClockError(
            f"run {run}: events came so quickly that the clock stood still; the rate constants are too large for "
            f"the times asked for, or counts grow without limit"
        )
    if outcome == outcomes.OVERFLOW:
        raise ValueError(f"run {run}: a count went beyond 2**63 - 1, or a propensity beyond 1e308")
