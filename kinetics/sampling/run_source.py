"""The runs of a network that was made ready once: any of them, by number."""

from __future__ import annotations

import os
from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from kinetics.kernels.ensemble_work import Stop
from kinetics.sampling.outlook import Outlook
from kinetics.sampling.watch import MAX_EVENTS, Watch
from kinetics.support.arrays import Floats, Ints
from kinetics.support.memory import check_memory

PIECE = 1000  # runs; an interrupt waits for a piece only
WEIGHED_BYTES = 2**26  # of all counts that are there at a time, where only sums of them are asked for
BLOCK_BYTES = 2**24  # of counts that are there at a time; larger ones cost more to have than to fill
FEWEST_RUNS = 16  # of a block, however large a run is


class InterruptedRuns(KeyboardInterrupt):
    """Ctrl-C while runs were made: `finished` are the counts (n, T, S) of the first of them."""

    def __init__(self, finished: Ints) -> None:
        super().__init__()
        self.finished = finished


class Sampler(Protocol):
    """A network made ready for a method. Run number n has the same events however it is asked for.

    Its kernels return after a fraction of a second, and `watch.pause` is called before they go on. A run that cannot
    go on, or not within the events allowed, is reported to `watch.stop`; other runs go on.
    """

    def ensemble(
        self, initial: Ints, grid: Floats, key: NDArray[np.uint64], first_run: int, out: Ints, watch: Watch
    ) -> None:
        """Fill `out` (runs, T, S) as far as the watch needs it."""

    def path(self, initial: Ints, end: float, key: NDArray[np.uint64], run: int, watch: Watch) -> tuple[Floats, Ints]:
        """Times and channels of all events until `end`."""


@dataclass(frozen=True, eq=False)
class RunSource:
    """Independent runs from one start, under one seed.

    sampler : the network made ready
    start : (S,) counts at time 0
    key : (4,) from which the random stream of every run is derived, see `base.stream_key`
    weights : (S, V) whole weights, for V sums of counts instead of all counts; None for these
    outlook : forecast of the events that a run has before it; None if there is none
    max_events : the most events of a run
    until : the condition at which runs end; None if there is none
    ends_at_once : whether it holds at the start
    """

    sampler: Sampler
    start: Ints
    key: NDArray[np.uint64]
    weights: Ints | None = None
    outlook: Outlook | None = None
    max_events: int = MAX_EVENTS
    until: Stop | None = None
    ends_at_once: bool = False

    def __post_init__(self) -> None:
        if self.start.ndim != 1:
            raise ValueError(f"start has shape {self.start.shape}; expected (species,)")

    @property
    def width(self) -> int:
        """Number of counts, or sums, of a run at a time."""
        return self.start.size if self.weights is None else self.weights.shape[1]

    def starting_at(self, start: Ints) -> RunSource:
        """A copy of the source that starts its runs at counts (S,)."""
        return replace(self, start=start)

    def watch(self, grid: Floats, first_run: int = 0, runs: int = 1) -> Watch:
        """A watch over `runs` runs from number `first_run` on, for several calls of `counts` or for `blocks`."""
        return Watch(grid, self.outlook, self.max_events, first_run, until=self.until, runs=runs)

    def counts(
        self, grid: Floats, runs: int, first_run: int = 0, threads: int | None = None, watch: Watch | None = None
    ) -> Ints:
        """Counts (runs, T, S), or sums (runs, T, V), at `grid` (T,) of the runs from number `first_run` on.

        threads : at most this many; by default one a processor core
        watch : for runs some of which may be truncated, after which there are fewer times
        ValueError: more counts than memory holds; a truncated run, without a watch or before the first time
        InterruptedRuns: Ctrl-C
        """
        watched = self.watch(grid, first_run, runs) if watch is None else watch
        found = self._counts(grid, runs, first_run, threads, watched)
        if watch is None:
            watched.check()
        return found

    def _counts(self, grid: Floats, runs: int, first_run: int, threads: int | None, watch: Watch) -> Ints:
        n_species = self.start.size
        if self.weights is None:
            what = f"all counts of {runs} runs of {n_species} species at {grid.size} times"
            advice = "use `simulate_statistics`, whose memory does not grow with the runs, or ask for fewer"
            check_memory(what, 8.0 * runs * grid.size * n_species, advice)
            return self._made(grid, runs, first_run, threads, watch)
        block = max(1, WEIGHED_BYTES // (8 * grid.size * n_species))
        parts = []
        for begin in range(0, runs, block):
            try:
                made = self._made(grid, min(block, runs - begin), first_run + begin, threads, watch)
            except InterruptedRuns as interrupted:
                parts.append(interrupted.finished @ self.weights)
                raise InterruptedRuns(_joined(parts)) from None
            parts.append(made @ self.weights)
        return _joined(parts)

    def path(self, end: float, run: int, watch: Watch) -> tuple[Floats, Ints]:
        """Times and channels of all events of one run until `end`, or until the condition holds."""
        if self.ends_at_once:
            watch.reached[:] = 0.0
            return np.empty(0), np.empty(0, dtype=np.int64)
        return self.sampler.path(self.start, end, self.key, run, watch)

    def blocks(
        self, grid: Floats, begin: int, end: int, threads: int | None = None, watch: Watch | None = None
    ) -> Iterator[Ints]:
        """Counts, as `counts` gives them, of the runs from number `begin` to before `end`, a block at a time.

        At Ctrl-C the runs of a block that are finished come before the KeyboardInterrupt.
        """
        block = max(FEWEST_RUNS, BLOCK_BYTES // (8 * grid.size * self.width))
        for at in range(begin, end, block):
            try:
                made = self.counts(grid, min(block, end - at), at, threads, watch)
            except InterruptedRuns as interrupted:
                if len(interrupted.finished):
                    yield interrupted.finished
                raise
            yield made

    def _made(self, grid: Floats, runs: int, first_run: int, threads: int | None, watch: Watch) -> Ints:
        workers = len(os.sched_getaffinity(0)) if threads is None else threads
        out = np.empty((runs, grid.size, self.start.size), dtype=np.int64)
        if self.ends_at_once:
            out[:], watch.reached[:] = self.start, 0.0
            return out
        writable = grid.copy()  # kernels are compiled for one kind of array

        def piece(begin: int, end: int) -> None:
            if watch.is_stopped.is_set():
                raise KeyboardInterrupt
            self.sampler.ensemble(self.start, writable, self.key, first_run + begin, out[begin:end], watch)
            watch.complete[first_run + begin] = end - begin

        cuts = [*range(0, runs, max(1, min(runs // workers, PIECE))), runs]
        try:
            if workers == 1 or len(cuts) == 2:
                for begin, end in pairwise(cuts):
                    piece(begin, end)
            else:
                from concurrent.futures import ThreadPoolExecutor

                with ThreadPoolExecutor(workers) as pool:
                    try:
                        list(pool.map(piece, cuts[:-1], cuts[1:]))
                    except BaseException:
                        watch.is_stopped.set()
                        pool.shutdown(wait=False, cancel_futures=True)
                        raise
        except KeyboardInterrupt:
            raise InterruptedRuns(out[: _leading(cuts, first_run, watch), : watch.n_times]) from None
        if not watch.n_times:
            watch.check()
        return out if watch.n_times == grid.size else np.ascontiguousarray(out[:, : watch.n_times])


def _leading(cuts: list[int], first_run: int, watch: Watch) -> int:
    """The number of first runs that are all done; taken by run number, so that short runs are not favoured."""
    done = 0
    for begin, end in pairwise(cuts):
        done = begin + watch.complete.get(first_run + begin, 0)
        if done < end:
            break
    return done if watch.n_times else 0


def _joined(parts: list[Ints]) -> Ints:
    """Blocks of runs as one, at the times that all have passed."""
    n_times = parts[-1].shape[1]
    return parts[0] if len(parts) == 1 else np.concatenate([part[:, :n_times] for part in parts])
