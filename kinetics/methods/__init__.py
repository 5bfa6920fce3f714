"""Ways to predict from a network: methods that sample, and methods that solve.

To add one: write its class in a file of its own, after `SamplingMethod` or `SolvingMethod` below, and put it into the
tuple it belongs to. Tests and command line read the tuples.
"""

from __future__ import annotations

from typing import ClassVar, Protocol, runtime_checkable

from numpy.typing import ArrayLike

from kinetics.methods.auto import Auto
from kinetics.methods.dense import Dense
from kinetics.methods.direct import Direct
from kinetics.methods.distribution import Distribution
from kinetics.methods.general import General
from kinetics.methods.lockstep import Lockstep
from kinetics.methods.partial import PartialPropensities
from kinetics.methods.projection import FiniteStateProjection
from kinetics.methods.rejection import CompositionRejection
from kinetics.methods.transient import Transient
from kinetics.network import Network
from kinetics.paths import Ensemble, JumpPath


@runtime_checkable
class SamplingMethod(Protocol):
    """Draws independent runs. `name` is what the command line calls it."""

    name: ClassVar[str]

    def simulate(
        self,
        network: Network,
        initial: ArrayLike,
        times: ArrayLike,
        runs: int = ...,
        seed: int = ...,
        threads: int | None = ...,
        first_run: int = ...,
    ) -> Ensemble:
        """Counts of `runs` independent runs, numbered from `first_run`, at `times`, tu; for any number of threads."""


@runtime_checkable
class SolvingMethod(Protocol):
    """Computes probabilities without sampling. `name` is what the command line calls it."""

    name: ClassVar[str]

    def solve(self, network: Network, initial: ArrayLike, times: ArrayLike) -> Distribution:
        """Probability of every state at `times`, tu."""


SAMPLING_METHODS: tuple[type[SamplingMethod], ...] = (
    Direct,
    Lockstep,
    PartialPropensities,
    CompositionRejection,
    General,
    Auto,
)
SOLVING_METHODS: tuple[type[SolvingMethod], ...] = (Transient, Dense, FiniteStateProjection)


def simulate(
    network: Network,
    method: SamplingMethod,
    initial: ArrayLike,
    times: ArrayLike,
    runs: int = 1000,
    seed: int = 0,
    threads: int | None = None,
) -> Ensemble:
    """Counts of `runs` independent runs at `times`, tu; the same for any number of threads.

    All counts of all runs: where those are too many, `streamed.simulate_statistics` keeps what is known of them.
    """
    return method.simulate(network, initial, times, runs=runs, seed=seed, threads=threads)


def solve(network: Network, method: SolvingMethod, initial: ArrayLike, times: ArrayLike) -> Distribution:
    """Probability of every state at `times`, tu, without sampling."""
    return method.solve(network, initial, times)


def sample_path(network: Network, initial: ArrayLike, end: float, seed: int = 0, run: int = 0) -> JumpPath:
    """Every event of one exact run from `initial` until `end`, tu."""
    method = Direct() if network.is_mass_action else General()
    return method.sample_path(network, initial, end, seed=seed, run=run)
