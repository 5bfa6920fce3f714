"""The tuple of all solving methods, and `solve`, the master equation by any of them."""

# ruff: noqa: F401, I001 - the imports are the list, in this order

from __future__ import annotations

from numpy.typing import ArrayLike

from kinetics.network import Network
from kinetics.solving.base import SolvingMethod
from kinetics.solving.distribution import Distribution
from kinetics.support.families import members

from kinetics.solving.transient import Transient
from kinetics.solving.dense import Dense
from kinetics.solving.collocation import Collocation
from kinetics.solving.projection import FiniteStateProjection

SOLVING_METHODS: tuple[type[SolvingMethod], ...] = members(globals(), SolvingMethod)


def solve(network: Network, method: SolvingMethod, initial: ArrayLike, times: ArrayLike) -> Distribution:
    """Probability of every state at `times` (T,), tu, without sampling; the same as `method.solve`."""
    return method.solve(network, initial, times)
