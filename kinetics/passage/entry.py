"""The checks that precede every solution on the reachable states, and the enumeration of these states."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np
from numpy.typing import ArrayLike, NDArray

from kinetics.network import Network
from kinetics.solving import StateSpace, reachable
from kinetics.support.arrays import Ints, whole_number


def reached_states(
    network: Network,
    initial: Mapping[str, int] | ArrayLike,
    max_states: int,
    stop: Callable[[Ints], NDArray[np.bool_]] | None = None,
) -> StateSpace:
    """As `reachable`; missing rates and a limit that is none are refused before any state is explored."""
    network.known_rates  # noqa: B018
    return reachable(network, initial, stop, whole_number("max_states", max_states, 1))
