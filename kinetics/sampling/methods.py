"""Runs and paths by any sampling method: `simulate` and `sample_path`."""

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

    The result holds all counts, (runs, T, S). Where these are too many for memory, `simulate_statistics` keeps their
    statistics alone.
    """
    return method.simulate(network, initial, times, runs=runs, seed=seed, threads=threads)


def sample_path(network: Network, initial: ArrayLike, end: float, seed: int = 0, run: int = 0) -> JumpPath:
    """Every event of one exact run from `initial` until `end`, tu.

    The method is that of `path_method`: the direct method under mass action, `General` under other rate laws.
    """
    return path_method(network).sample_path(network, initial, end, seed=seed, run=run)


def path_method(network: Network) -> SamplingMethod:
    """The method of `sample_path`: the first of `EXACT_METHODS` that takes the network."""
    return next(method for kind in EXACT_METHODS if (method := kind()).takes(network))
