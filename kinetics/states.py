"""The states a network can reach, and the sparse generator of its Markov chain."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from kinetics.arrays import Ints, read_only
from kinetics.network import Network

if TYPE_CHECKING:
    from scipy.sparse import csr_array

MAX_STATES = 1_000_000


class TooManyStatesError(ValueError):
    """More states than allowed can be reached."""


@dataclass(frozen=True, eq=False)
class StateSpace:
    """All states reachable from the first one.

    states : (N, S) counts; row 0 is the initial state
    is_stopped : (N,) bool, states that the chain never leaves because it was told to stop there
    multipliers : (S,) uint64; a state's key is its product with them, and no two states share a key
    """

    network: Network
    states: Ints
    is_stopped: NDArray[np.bool_]
    multipliers: NDArray[np.uint64]

    def __post_init__(self) -> None:
        for name, weights in self.network.conserved.items():
            amounts = self.states @ weights
            drift = np.abs(amounts - amounts[0]).max()
            if drift > 1e-9 * max(1.0, abs(amounts[0])):
                raise ArithmeticError(f"{name} is not conserved over the state space: it varies by {drift:g}")
        for array in (self.states, self.is_stopped, self.multipliers):
            read_only(array)

    def __len__(self) -> int:
        return len(self.states)

    @cached_property
    def _sorted_keys(self) -> tuple[NDArray[np.uint64], NDArray[np.intp]]:
        keys = _keys(self.states, self.multipliers)
        order = np.argsort(keys)
        return keys[order], order

    def index_of(self, states: ArrayLike) -> NDArray[np.intp]:
        """Rows (...) of states (..., S); -1 for a state that cannot be reached."""
        asked = np.asarray(states, dtype=np.int64)
        keys, order = self._sorted_keys
        places = np.searchsorted(keys, _keys(asked, self.multipliers))
        rows = order[np.minimum(places, keys.size - 1)]
        return np.where((self.states[rows] == asked).all(axis=-1), rows, -1)

    def generator(self) -> csr_array:
        """Q (N, N) in 1/tu: rates from row to column off the diagonal, minus their sum on it. dp/dt = p Q."""
        from scipy.sparse import csr_array, dia_array

        network = self.network
        propensities = network.propensities(self.states)
        propensities[self.is_stopped] = 0.0
        propensities[:, ~network.stoichiometry.any(axis=1)] = 0.0  # A -> A changes nothing
        rows, channels = np.nonzero(propensities)
        columns = self.index_of(self.states[rows] + network.stoichiometry[channels])
        if columns.size and columns.min() < 0:
            raise ArithmeticError("the state space is not closed: a channel leads out of it")
        n = len(self)
        exits = propensities.sum(axis=1)
        jumps = csr_array((propensities[rows, channels], (rows, columns)), shape=(n, n))
        generator = csr_array(jumps - dia_array((exits[None, :], [0]), shape=(n, n)))
        excess = np.abs(generator.sum(axis=1))
        if np.any(excess > 1e-12 * exits):
            raise ArithmeticError(f"a row of the generator sums to {excess.max():g} instead of 0")
        return generator


def reachable(
    network: Network,
    initial: ArrayLike,
    stop: Callable[[Ints], NDArray[np.bool_]] | None = None,
    max_states: int = MAX_STATES,
) -> StateSpace:
    """State space of `network` from `initial`, breadth first.

    stop : tells of states (n, S) which ones the chain never leaves (targets of a passage)
    max_states : more than that are refused
    Channels whose rate is known to be 0 lead nowhere.
    """
    start = network.state(initial)
    rng = np.random.default_rng(0)  # the keys decide the order of states, so they are always the same ones
    while True:
        multipliers = rng.integers(1, 2**64 - 1, size=start.size, dtype=np.uint64, endpoint=True)
        found = _explore(network, start, stop, max_states, multipliers)
        if found is not None:
            return StateSpace(network, *found, multipliers)


def _explore(
    network: Network,
    start: Ints,
    stop: Callable[[Ints], NDArray[np.bool_]] | None,
    max_states: int,
    multipliers: NDArray[np.uint64],
) -> tuple[Ints, NDArray[np.bool_]] | None:
    """States and which of them are stops; None where two states shared a key (chance N**2 / 2**65)."""
    works = np.ones(len(network.channels), dtype=bool)
    if network.rate_constants is not None:
        works = network.rate_constants * network.ways > 0
    reactants, changes = network.reactants[works], network.stoichiometry[works]

    states = start[None, :]
    keys = _keys(states, multipliers)
    levels, level_stops = [], []
    seen_keys, seen_rows = keys, np.zeros(1, dtype=np.intp)
    sizes: list[int] = []
    frontier = states
    while len(frontier):
        sizes.append(len(frontier))
        if sum(sizes) > max_states:
            raise TooManyStatesError(_too_many(max_states, sizes))
        is_stop = np.zeros(len(frontier), dtype=bool) if stop is None else stop(frontier)
        levels.append(frontier)
        level_stops.append(is_stop)

        able = (frontier[:, None, :] >= reactants).all(axis=2) & ~is_stop[:, None]
        rows, channels = np.nonzero(able)
        targets = frontier[rows] + changes[channels]
        if targets.size and targets.min() < 0:
            raise ValueError("a count grows beyond 2**63 - 1")
        keys, first, again = np.unique(_keys(targets, multipliers), return_index=True, return_inverse=True)
        if not np.array_equal(targets[first][again], targets):
            return None
        targets = targets[first]
        places = np.minimum(np.searchsorted(seen_keys, keys), seen_keys.size - 1)
        is_new = seen_keys[places] != keys
        everything = np.concatenate(levels)
        if not np.array_equal(everything[seen_rows[places[~is_new]]], targets[~is_new]):
            return None
        frontier = targets[is_new]
        new_rows = np.arange(len(frontier)) + len(everything)
        spots = np.searchsorted(seen_keys, keys[is_new])
        seen_keys = np.insert(seen_keys, spots, keys[is_new])
        seen_rows = np.insert(seen_rows, spots, new_rows)
    return np.concatenate(levels), np.concatenate(level_stops)


def _keys(states: Ints, multipliers: NDArray[np.uint64]) -> NDArray[np.uint64]:
    """Keys (...) of states (..., S): a product that wraps around at 2**64."""
    return (states.astype(np.uint64) * multipliers).sum(axis=-1, dtype=np.uint64)


def _too_many(max_states: int, sizes: list[int]) -> str:
    recent = ", ".join(str(size) for size in sizes[-4:])
    return (
        f"over {max_states} states are reachable: {len(sizes)} events away from the initial state, and the number of "
        f"states still goes {recent} with each further event. Start from fewer copies, stop the network's growth, "
        f"sample with the direct method instead, or raise max_states"
    )
