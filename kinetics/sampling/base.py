"""What all exact sampling methods share: checks, random streams, threads, and runs made step by step."""

from __future__ import annotations

import os
import threading
from abc import ABC, abstractmethod
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from itertools import pairwise
from typing import Any, ClassVar, Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from kinetics.network import Network
from kinetics.runs import Ensemble, JumpPath
from kinetics.sampling.cost_model import Shape
from kinetics.support.arrays import Floats, Ints, rising_times, whole_number
from kinetics.support.memory import check_memory

PIECE = 1000  # runs; an interrupt waits for a piece only
FEWEST_DRAWS, MOST_DRAWS = 256, 16384  # of a call to a kernel that reads its random numbers from buffers


class StalledClockError(ValueError):
    """Waits became so short that adding one no longer changed the time."""


class Sampler(Protocol):
    """A network made ready for a kernel. Run number n has the same events however it is asked for."""

    def ensemble(
        self, initial: Ints, grid: Floats, key: NDArray[np.uint64], first_run: int, out: Ints
    ) -> tuple[int, int]:
        """Fill `out` (runs, T, S); the outcome, and the number of the last run begun."""

    def path(self, initial: Ints, end: float, key: NDArray[np.uint64], run: int) -> tuple[int, Floats, Ints]:
        """The outcome, and times and channels of all events until `end`."""


class ExactMethod(ABC):
    """A sampling method, given its `sampler`: see `SamplingMethod` in `kinetics.sampling`."""

    name: ClassVar[str]

    @abstractmethod
    def sampler(self, network: Network) -> Sampler:
        """The network made ready; a ValueError where this method cannot take it."""

    def simulate(
        self,
        network: Network,
        initial: ArrayLike,
        times: ArrayLike,
        runs: int = 1000,
        seed: int = 0,
        threads: int | None = None,
        first_run: int = 0,
    ) -> Ensemble:
        """Counts of `runs` independent runs at `times` (T,), tu.

        threads : at most this many; by default one a processor core
        first_run : number of the first run; with one seed, runs of different numbers are independent
        The same seed gives the same runs for any number of threads and any grid of times.
        """
        grid = rising_times(times)
        if not grid.size:
            raise ValueError("times is empty; give at least one time")
        start = network.state(initial)
        for name, value, least in (("runs", runs, 1), ("first_run", first_run, 0)):
            whole_number(name, value, least)
        workers = len(os.sched_getaffinity(0)) if threads is None else whole_number("threads", threads, 1)
        shape = (runs, grid.size, start.size)
        what = f"all counts of {runs} runs of {start.size} species at {grid.size} times"
        advice = "ask for `simulate_statistics`, which does not grow with the runs, or for fewer"
        check_memory(what, 8.0 * runs * grid.size * start.size, advice)
        key = stream_key(seed)
        sampler = self.sampler(network)
        out = np.empty(shape, dtype=np.int64)
        is_stopped = threading.Event()

        def piece(begin: int, end: int) -> tuple[int, int]:
            if is_stopped.is_set():
                raise KeyboardInterrupt
            return sampler.ensemble(start, grid, key, first_run + begin, out[begin:end])

        cuts = [*range(0, runs, max(1, min(runs // workers, PIECE))), runs]
        if workers == 1 or len(cuts) == 2:
            outcomes = [piece(begin, end) for begin, end in pairwise(cuts)]
        else:
            with ThreadPoolExecutor(workers) as pool:
                try:
                    outcomes = list(pool.map(piece, cuts[:-1], cuts[1:]))
                except BaseException:
                    is_stopped.set()
                    pool.shutdown(wait=False, cancel_futures=True)
                    raise
        for outcome, run in outcomes:
            check_outcome(outcome, run)
        return Ensemble(network, grid, out)

    def sample_path(self, network: Network, initial: ArrayLike, end: float, seed: int = 0, run: int = 0) -> JumpPath:
        """Every event of one run until `end`, tu: run number `run` of `simulate` under the same seed."""
        horizon = float(rising_times([end])[0])
        start = network.state(initial)
        key = stream_key(seed)
        outcome, times, channels = self.sampler(network).path(start, horizon, key, whole_number("run", run, 0))
        check_outcome(outcome, run)
        return JumpPath(network, start, times, channels, horizon)


class Candidate(ExactMethod):
    """A method that `Auto` weighs against others."""

    @abstractmethod
    def cost(self, shape: Shape) -> float:
        """Processor time of an event, ns, as measured on long runs; inf where this method cannot take the network."""


class StepwiseSampler:
    """Runs of a kernel that reads its random numbers from buffers, call after call.

    begin(counts) : a fresh workspace for a run that starts at `counts` (S + 1,), the last one 1
    advance(workspace, counts, seen, clock, waits, uniforms, grid, out, times, channels) : see `kernels.grouped`
    order : (R,) channel of the network for each channel of the kernel
    """

    def __init__(self, begin: Callable[[Ints], Any], advance: Callable[..., int], order: Ints):
        self.begin, self.advance, self.order = begin, advance, order

    def ensemble(
        self, initial: Ints, grid: Floats, key: NDArray[np.uint64], first_run: int, out: Ints
    ) -> tuple[int, int]:
        """Fill `out` (runs, T, S); the outcome, and the number of the last run begun."""
        for i in range(len(out)):
            outcome, _ = self._run(initial, grid, key, first_run + i, out[i], keep_events=False)
            if outcome != 0:
                return outcome, first_run + i
        return 0, first_run + len(out) - 1

    def path(self, initial: Ints, end: float, key: NDArray[np.uint64], run: int) -> tuple[int, Floats, Ints]:
        """The outcome, and times and channels of all events until `end`."""
        out = np.empty((1, initial.size), dtype=np.int64)
        outcome, pieces = self._run(initial, np.array([end]), key, run, out, keep_events=True)
        times, channels = (np.concatenate(columns) for columns in zip(*pieces, strict=True))
        return outcome, times, self.order[channels]

    def _run(
        self, initial: Ints, grid: Floats, key: NDArray[np.uint64], run: int, out: Ints, keep_events: bool
    ) -> tuple[int, list[tuple[Floats, Ints]]]:
        from kinetics.kernels import ssa

        stream = np.empty(4, dtype=np.uint64)
        ssa.start_stream(key, run, stream)
        counts, clock, seen = np.ones(initial.size + 1, dtype=np.int64), np.zeros(1), np.zeros(2, dtype=np.int64)
        counts[:-1] = initial
        workspace = self.begin(counts)
        pieces = []
        n_draws, outcome = FEWEST_DRAWS, ssa.BUFFER_FULL
        waits = uniforms = np.empty(0)
        while outcome == ssa.BUFFER_FULL:
            if waits.size < n_draws:
                waits, uniforms = np.empty(n_draws), np.empty(n_draws)
            n_kept = n_draws if keep_events else 0
            times, channels = np.empty(n_kept), np.empty(n_kept, dtype=np.int64)
            ssa.draw(stream, waits, uniforms)
            outcome = self.advance(workspace, counts, seen, clock, waits, uniforms, grid, out, times, channels)
            pieces.append((times[: seen[1]], channels[: seen[1]]))
            n_draws = min(4 * n_draws, MOST_DRAWS)
        return outcome, pieces


def stream_key(seed: int) -> NDArray[np.uint64]:
    """Key (4,) from which the random stream of every run is derived."""
    return np.asarray(np.random.SeedSequence(whole_number("seed", seed, 0)).generate_state(4, np.uint64), np.uint64)


def check_outcome(outcome: int, run: int) -> None:
    """Raise where a run could not reach its end."""
    from kinetics.kernels import ssa

    if outcome == ssa.STALLED_CLOCK:
        raise StalledClockError(
            f"run {run}: events came so quickly that the clock stood still; the rate constants are too large for "
            f"the times asked for, or counts grow without limit"
        )
    if outcome == ssa.OVERFLOW:
        raise ValueError(f"run {run}: a count went beyond 2**63 - 1, or a propensity beyond 1e308")
