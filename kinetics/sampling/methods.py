"""The sampling methods, and drawing runs by any of them.

To add one: write its class in a file of its own, after `ExactMethod` in `kinetics.sampling.base`, and put it into
`SAMPLING_METHODS`. Tests and command line read the tuple.
"""

from __future__ import annotations

from typing import ClassVar, Protocol, runtime_checkable

from numpy.typing import ArrayLike

from kinetics.network import Network
from kinetics.runs import Ensemble, JumpPath
from kinetics.sampling.auto import Auto
from kinetics.sampling.direct import Direct
from kinetics.sampling.general import General
from kinetics.sampling.lockstep import Lockstep
from kinetics.sampling.partial import PartialPropensities
from kinetics.sampling.rejection import CompositionRejection


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


SAMPLING_METHODS: tuple[type[SamplingMethod], ...] = (
    Direct,
    Lockstep,
    PartialPropensities,
    CompositionRejection,
    General,
    Auto,
)


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


def sample_path(network: Network, initial: ArrayLike, end: float, seed: int = 0, run: int = 0) -> JumpPath:
    """Every event of one exact run from `initial` until `end`, tu."""
    method = Direct() if network.is_mass_action else General()
    return method.sample_path(network, initial, end, seed=seed, run=run)
