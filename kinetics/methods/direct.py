"""Gillespie's direct method: exact trajectories, one event after the other."""

from __future__ import annotations

import os
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from itertools import pairwise
from math import factorial
from typing import ClassVar

import numpy as np
from numpy.typing import ArrayLike

from kinetics.arrays import Floats, Ints, rising_times
from kinetics.network import Network
from kinetics.paths import Ensemble, JumpPath

MAX_BYTES = 4 * 2**30  # of counts in one ensemble
BUFFER = 4096  # events a sampled path grows by


class StalledClockError(ValueError):
    """Waits became so short that adding one no longer changed the time."""


@dataclass(frozen=True)
class Direct:
    """Direct method (Gillespie 1977). Exact; the cost grows with the number of events.

    Choose it by default: for networks of up to some tens of channels no exact method is quicker.
    """

    name: ClassVar[str] = "ssa"

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
        from kinetics.kernels import ssa

        grid = rising_times(times)
        if not grid.size:
            raise ValueError("times is empty; give at least one time")
        start = network.state(initial)
        for name, value, least in (("runs", runs, 1), ("first_run", first_run, 0)):
            whole_number(name, value, least)
        workers = len(os.sched_getaffinity(0)) if threads is None else whole_number("threads", threads, 1)
        shape = (runs, grid.size, start.size)
        if np.prod(shape, dtype=float) * 8 > MAX_BYTES:
            raise ValueError(f"{runs} runs at {grid.size} times need over {MAX_BYTES / 2**30:.0f} GB; ask for fewer")
        out = np.empty(shape, dtype=np.int64)
        key = stream_key(seed)
        model = (*kernel_arrays(network), start, grid, key)

        def piece(begin: int, end: int) -> tuple[int, int]:
            return ssa.ensemble(*model, first_run + begin, out[begin:end])

        # Pieces, not one share a thread: an interrupt then waits for a piece only.
        length = max(1, min(runs // workers, 1000))
        cuts = [*range(0, runs, length), runs]
        if workers == 1 or len(cuts) == 2:
            outcomes = [piece(begin, end) for begin, end in pairwise(cuts)]
        else:
            with ThreadPoolExecutor(workers) as pool:
                try:
                    outcomes = list(pool.map(piece, cuts[:-1], cuts[1:]))
                except BaseException:
                    pool.shutdown(wait=False, cancel_futures=True)
                    raise
        for outcome, run in outcomes:
            check_outcome(outcome, run)
        return Ensemble(network, grid, out)

    def sample_path(self, network: Network, initial: ArrayLike, end: float, seed: int = 0, run: int = 0) -> JumpPath:
        """Every event of one run until `end`, tu: run number `run` of `simulate` under the same seed."""
        from kinetics.kernels import ssa

        horizon = rising_times([end])[0]
        start = network.state(initial)
        stream = np.empty(4, dtype=np.uint64)
        ssa.start_stream(stream_key(seed), whole_number("run", run, 0), stream)
        counts = np.append(start, 1)
        clock = np.zeros(1)
        pieces = []
        model = kernel_arrays(network)
        outcome = ssa.BUFFER_FULL
        while outcome == ssa.BUFFER_FULL:
            times, channels = np.empty(BUFFER), np.empty(BUFFER, dtype=np.int64)
            outcome, n_events = ssa.advance(*model, counts, clock, horizon, stream, times, channels)
            pieces.append((times[:n_events], channels[:n_events]))
        check_outcome(outcome, run)
        all_times, all_channels = (np.concatenate(columns) for columns in zip(*pieces, strict=True))
        return JumpPath(network, start, all_times, all_channels, horizon)


def kernel_arrays(network: Network) -> tuple[Floats, Ints, Ints]:
    """Coefficients (R,), factors (3, R, K) and stoichiometry (R, S) as `kernels.ssa` reads them."""
    coefficients = network.known_rates * network.ways
    n_species = len(network.species)
    order = int(network.reactants.sum(axis=1).max(initial=2))
    factors = np.zeros((3, len(network.channels), order), dtype=np.int64)
    factors[0] = n_species  # the constant 1, until a reactant takes the place
    for r, needed in enumerate(network.reactants):
        place = 0
        for s in np.flatnonzero(needed):
            m = int(needed[s])
            if network.combinations == "distinct":
                coefficients[r] /= factorial(m)
            for i in range(m):
                factors[:, r, place] = (s, 0, m) if network.combinations == "product" else (s, i, i + 1)
                place += 1
    return coefficients, factors, np.ascontiguousarray(network.stoichiometry)


def stream_key(seed: int) -> np.ndarray:
    """Key (4,) uint64 from which the random stream of every run is derived."""
    return np.random.SeedSequence(whole_number("seed", seed, 0)).generate_state(4, np.uint64)


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


def whole_number(name: str, value: int, least: int) -> int:
    """`value` where it is a whole number of at least `least`."""
    if isinstance(value, bool) or not isinstance(value, int | np.integer) or value < least:
        raise ValueError(f"{name} = {value!r}; expected a whole number of at least {least}")
    return int(value)
