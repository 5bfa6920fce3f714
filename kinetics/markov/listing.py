"""The states that a chain of a network lists: all that can be reached, or a part of them, at whose edge it is lost."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np
from numpy.typing import ArrayLike, NDArray

from kinetics.markov.passage.entry import nearest_states, reached_states
from kinetics.markov.transient import StateSpace
from kinetics.network import Network
from kinetics.network.predicates import StateNames
from kinetics.support.arrays import Ints

Mask = NDArray[np.bool_]
StateCondition = str | Callable[[Ints], Mask]


def listed(
    network: Network,
    initial: Mapping[str, int] | ArrayLike,
    stop: StateCondition | None,
    within: StateCondition | int | None,
    max_states: int,
) -> tuple[StateSpace, Mask]:
    """The states of a network, and which of them (N,) are not followed further though the chain goes on there.

    stop : where the chain stops; within : where it is followed, or the least number of states to list, nearest first
    """

    def stops(states: Ints) -> Mask:
        return np.zeros(len(states), dtype=bool) if stop is None else held(stop, network, states)

    if within is None:
        space = reached_states(network, initial, max_states, None if stop is None else stops)
        return space, np.zeros(len(space), dtype=bool)
    if not isinstance(within, str) and not callable(within):
        return nearest_states(network, initial, within, max_states, stops)
    inside = within

    def ends(states: Ints) -> Mask:
        return stops(states) | ~held(inside, network, states)

    space = reached_states(network, initial, max_states, ends)
    lost = space.is_stopped & ~stops(space.states)
    if lost[0]:
        raise ValueError("the chain starts outside the states that it is followed within; give a condition that holds")
    return space, lost


def held(condition: StateCondition, network: Network, states: Ints) -> Mask:
    """In which states (n, S) of a network a condition holds (n,)."""
    if callable(condition):
        return np.asarray(condition(states), dtype=bool)
    return StateNames(len(states), network.species, states, {}).holds(condition)
