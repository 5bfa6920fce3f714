"""Ways to predict from a network: methods that sample, and methods that solve.

To add one: write its class in a file of its own, and put it into the tuple it belongs to. Tests and command line read
the tuples. A sampling method has `simulate(network, initial, times, runs, seed, threads) -> Ensemble`, a solving method
`solve(network, initial, times) -> Distribution`.
"""

from __future__ import annotations

from numpy.typing import ArrayLike

from kinetics.methods.direct import Direct
from kinetics.methods.transient import Distribution, Transient
from kinetics.network import Network
from kinetics.paths import Ensemble, JumpPath

SAMPLING_METHODS = (Direct,)
SOLVING_METHODS = (Transient,)

SamplingMethod = Direct
SolvingMethod = Transient


def simulate(
    network: Network,
    method: SamplingMethod,
    initial: ArrayLike,
    times: ArrayLike,
    runs: int = 1000,
    seed: int = 0,
    threads: int | None = None,
) -> Ensemble:
    """Counts of `runs` independent runs at `times`, tu; the same for any number of threads."""
    return method.simulate(network, initial, times, runs=runs, seed=seed, threads=threads)


def solve(network: Network, method: SolvingMethod, initial: ArrayLike, times: ArrayLike) -> Distribution:
    """Probability of every state at `times`, tu, without sampling."""
    return method.solve(network, initial, times)


def sample_path(network: Network, initial: ArrayLike, end: float, seed: int = 0, run: int = 0) -> JumpPath:
    """Every event of one exact run from `initial` until `end`, tu."""
    return Direct().sample_path(network, initial, end, seed=seed, run=run)
