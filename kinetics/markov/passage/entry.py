"""The checks that precede every solution on the reachable states, and the enumeration of these states."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np
from numpy.typing import ArrayLike, NDArray

from kinetics.markov.transient import StateSpace, reachable
from kinetics.markov.transient.search import Search, TooManyStatesError
from kinetics.network import Network
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


def nearest_states(
    network: Network,
    initial: Mapping[str, int] | ArrayLike,
    at_least: int,
    max_states: int,
    stop: Callable[[Ints], NDArray[np.bool_]],
) -> tuple[StateSpace, NDArray[np.bool_]]:
    """The states that the fewest events lead to, `at_least` so many; those that are not followed are stopped.

    And which of them (N,) are not followed though `stop` does not hold: those that the last event led to.
    """
    network.known_rates  # noqa: B018
    enough, most = whole_number("within", at_least, 1), whole_number("max_states", max_states, 1)
    if enough > most:
        raise TooManyStatesError.of(
            f"within = {enough} states, but at most {most} are listed", "Follow the chain within fewer, or allow more"
        )
    search = Search(network, network.state(initial)[None, :], most, stop)
    begin = 0
    while begin < len(search) < enough:
        end = len(search)
        search.go_on(begin, end)
        begin = end
    is_stopped = search.stopped()
    lost = ~is_stopped & (np.arange(len(search)) >= begin)
    return StateSpace(network, search.states, is_stopped | lost), lost
