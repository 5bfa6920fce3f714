"""Runs by any sampling method."""

from __future__ import annotations

from numpy.typing import ArrayLike

from kinetics.network import Network
from kinetics.runs import Ensemble, JumpPath
from kinetics.sampling.auto import Auto
from kinetics.sampling.base import SamplingMethod
from kinetics.sampling.exact_methods import EXACT_METHODS

SAMPLING_METHODS: tuple[type[SamplingMethod], ...] = (*EXACT_METHODS, Auto)


def simulate(
    network: Network,
    method: SamplingMethod,
    initial: ArrayLike,
    times: ArrayLike,
    runs: int = 1000,
    seed: int = 0,
    threads: int | None = None,
) -> Ensemble:
    """Counts of `runs` independent runs at `times` (T,), tu; the same for any number of threads.

    All counts of all runs, (runs, T, S): where those are too many, `simulate_statistics` keeps what is known of them.
    """
    return method.simulate(network, initial, times, runs=runs, seed=seed, threads=threads)


def sample_path(network: Network, initial: ArrayLike, end: float, seed: int = 0, run: int = 0) -> JumpPath:
    """Every event of one exact run from `initial` until `end`, tu.

    By the first of `EXACT_METHODS` that takes the network: the direct method, or thinning under other rate laws.
    """
    method = next(method for kind in EXACT_METHODS if (method := kind()).takes(network))
    return method.sample_path(network, initial, end, seed=seed, run=run)
