"""Statistics of ensembles of any size, in memory that does not grow with it."""

from __future__ import annotations

import signal
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace

from numpy.typing import ArrayLike

from kinetics.network import Model, Network
from kinetics.sampling.base import SamplingMethod, check_numbers
from kinetics.sampling.methods import sampling_method
from kinetics.sampling.run_source import RunSource
from kinetics.sampling.statistics import EnsembleStatistics, Tally, kept_pairs
from kinetics.sampling.watch import MAX_EVENTS
from kinetics.support.arrays import Counts, some_times


def simulate_statistics(
    model: Model | Network,
    method: SamplingMethod | str,
    initial: Counts | None = None,
    times: ArrayLike = (),
    runs: int = 1000,
    seed: int = 0,
    threads: int | None = None,
    *,
    covariances: bool | None = None,
    progress: Callable[[int], None] | None = None,
    max_events: int = MAX_EVENTS,
) -> EnsembleStatistics:
    """Statistics of the runs that `simulate` would give; runs are made in blocks and not kept.

    covariances : of all pairs of species; by default up to `statistics.MOST_COVARIED` of them
    progress : called with the number of runs done, after each block
    max_events : the most events of a run, see `simulate`
    ValueError: as in `simulate`, memory apart

    The same seed gives the same statistics, to the last bit. After Ctrl-C they are those of the first runs,
    up to one that was not finished, if any; see `is_complete`.

    >>> import numpy as np
    >>> from kinetics import Network, simulate, simulate_statistics
    >>> decay = Network.from_text("A -> 0, 0.1")
    >>> statistics = simulate_statistics(decay, "auto", {"A": 100}, [10.0], runs=500, seed=1)
    >>> np.array_equal(statistics.mean(), simulate(decay, "auto", {"A": 100}, [10.0], runs=500, seed=1).mean())
    True
    """
    given, sampler = Model.of(model, initial), sampling_method(method)
    source = sampler.source(given.network, given.initial, seed, max_events)
    made = streamed(given.network, source, times, runs, threads, covariances=covariances, progress=progress)
    return replace(made, method=sampler.name_for(given.network, given.initial))


def streamed(
    network: Network,
    source: RunSource,
    times: ArrayLike,
    runs: int,
    threads: int | None,
    first_run: int = 0,
    covariances: bool | None = None,
    progress: Callable[[int], None] | None = None,
) -> EnsembleStatistics:
    """Statistics of the runs of a source; `network` names what it counts, which may be sums."""
    grid, n_species = some_times(times), len(network.species)
    check_numbers(runs, threads, first_run)
    tally = Tally(network, grid, kept_pairs(n_species, covariances))
    watch = source.watch(grid, first_run)
    try:
        for part in source.blocks(grid, first_run, first_run + runs, threads, watch):
            with unbroken():
                tally.add(part)
            if progress is not None:
                progress(tally.runs)
    except KeyboardInterrupt:
        if not tally.runs:
            raise
    tally.cut(watch.n_times)
    made = tally.statistics(runs)
    return replace(made, truncated=watch.truncation(made.runs))


@contextmanager
def unbroken() -> Iterator[None]:
    """Let Ctrl-C wait until the end of the block: half a block taken in would falsify the statistics."""
    before = signal.getsignal(signal.SIGINT)
    if threading.current_thread() is not threading.main_thread() or before is None:
        yield
        return
    held: list[int] = []
    signal.signal(signal.SIGINT, lambda number, _: held.append(number))
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)
        if held:
            signal.raise_signal(signal.SIGINT)
