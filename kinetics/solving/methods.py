"""The solving methods, and the master equation solved by any of them.

To add one: write its class in a file of its own, after `SolvingMethod`, and put it into `SOLVING_METHODS`. Tests and
command line read the tuple.
"""

from __future__ import annotations

from typing import ClassVar, Protocol, runtime_checkable

from numpy.typing import ArrayLike

from kinetics.network import Network
from kinetics.solving.dense import Dense
from kinetics.solving.distribution import Distribution
from kinetics.solving.projection import FiniteStateProjection
from kinetics.solving.transient import Transient


@runtime_checkable
class SolvingMethod(Protocol):
    """Computes probabilities without sampling. `name` is what the command line calls it."""

    name: ClassVar[str]

    def solve(self, network: Network, initial: ArrayLike, times: ArrayLike) -> Distribution:
        """Probability of every state at `times`, tu."""


SOLVING_METHODS: tuple[type[SolvingMethod], ...] = (Transient, Dense, FiniteStateProjection)


def solve(network: Network, method: SolvingMethod, initial: ArrayLike, times: ArrayLike) -> Distribution:
    """Probability of every state at `times`, tu, without sampling."""
    return method.solve(network, initial, times)
