"""The states that a chain of a network lists: all that can be reached, or a part, at whose edge it is truncated."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np
from numpy.typing import ArrayLike, NDArray

from kinetics.markov.transient import StateSpace, reachable
from kinetics.markov.transient.search import Search, TooManyStatesError
from kinetics.network import Network
from kinetics.network.predicates import StateNames
from kinetics.support.arrays import Ints, whole_number

Mask = NDArray[np.bool_]
Condition = str | Callable[[Ints], Mask]


def enumerated(
    network: Network,
    initial: Mapping[str, int] | ArrayLike,
    stop: Condition | None,
    truncate: Condition | int | None,
    max_states: int,
) -> tuple[StateSpace, Mask]:
    """The states of a network, and which of them (N,) are truncated: not followed though the chain goes on there.

    stop : where the chain stops; truncate : condition of the states that are kept, or their least number, nearest first
    """
    network.known_rates  # noqa: B018 - missing rates are refused before any state is explored

    def stops(states: Ints) -> Mask:
        return np.zeros(len(states), dtype=bool) if stop is None else held(stop, network, states)

    most = whole_number("max_states", max_states, 1)
    if truncate is None:
        space = reachable(network, initial, None if stop is None else stops, most)
        return space, np.zeros(len(space), dtype=bool)
    if not isinstance(truncate, str) and not callable(truncate):
        return _nearest(network, initial, truncate, most, stops)
    inside = truncate

    def ends(states: Ints) -> Mask:
        return stops(states) | ~held(inside, network, states)

    space = reachable(network, initial, ends, most)
    truncated = space.is_stopped & ~stops(space.states)
    if truncated[0]:
        raise ValueError(
            "the chain starts outside the states to which it is truncated; give a condition that holds there"
        )
    return space, truncated


def _nearest(
    network: Network,
    initial: Mapping[str, int] | ArrayLike,
    at_least: int,
    most: int,
    stop: Callable[[Ints], Mask],
) -> tuple[StateSpace, Mask]:
    """The states that the fewest events lead to, `at_least` so many; those that the last event led to are truncated."""
    enough = whole_number("truncate", at_least, 1)
    if enough > most:
        raise TooManyStatesError.of(
            f"truncate = {enough} states, but at most {most} are enumerated", "Truncate to fewer, or allow more"
        )
    search = Search(network, network.state(initial)[None, :], most, stop)
    begin = 0
    while begin < len(search) < enough:
        end = len(search)
        search.go_on(begin, end)
        begin = end
    is_stopped = search.stopped()
    truncated = ~is_stopped & (np.arange(len(search)) >= begin)
    return StateSpace(network, search.states, is_stopped | truncated), truncated


def held(condition: Condition, network: Network, states: Ints) -> Mask:
    """True (n,) for the states (n, S) of a network in which a condition holds."""
    if callable(condition):
        found = np.asarray(condition(states), dtype=bool)
        if found.shape != (len(states),):
            raise ValueError(f"a condition gives shape {found.shape}; expected one truth a state, ({len(states)},)")
        return found
    return StateNames(len(states), network.species, states, {}).holds(condition)
