"""The states a network can reach, and the sparse generator of its Markov chain."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from kinetics.markov.transient.search import (
    CHUNK,
    MAX_STATES,
    Search,
    StateTable,
    entries_of,
    key_changes_of,
    key_multipliers,
    keys_of,
)
from kinetics.markov.transient.transitions import RATE_ERROR, Transitions
from kinetics.native import state_tables
from kinetics.network import Network
from kinetics.support.arrays import Floats, Ints, integers, read_only, whole_number

if TYPE_CHECKING:
    from scipy.sparse import csr_array

CERTIFIED_ORDER = 5  # combinations of so many reactants, constant and ways round at most `RATE_ERROR` times


@dataclass(frozen=True, eq=False)
class StateSpace:
    """The states of a network: all that can be reached from the first one, or those that a projection kept.

    states : (N, S) counts, all different; row 0 is the initial state
    is_stopped : (N,) bool, whether the chain stops in a state because it is a target

    >>> from kinetics import Network, reachable
    >>> space = reachable(Network.from_text("A <-> B, 2, 3"), {"A": 2})
    >>> space.states.tolist()
    [[2, 0], [1, 1], [0, 2]]
    >>> space.generator().toarray().tolist()
    [[-4.0, 4.0, 0.0], [3.0, -5.0, 2.0], [0.0, 6.0, -6.0]]
    """

    network: Network
    states: Ints
    is_stopped: NDArray[np.bool_]

    def __post_init__(self) -> None:
        for name, weights in self.network.conserved.items():
            amounts = self.states @ weights
            drift = np.abs(amounts - amounts[0]).max()
            if drift > 1e-9 * max(1.0, abs(amounts[0])):
                raise ArithmeticError(f"{name} is not conserved over the state space: it varies by {drift:g}")
        for array in (self.states, self.is_stopped):
            read_only(array)

    def __len__(self) -> int:
        return len(self.states)

    @cached_property
    def rate_errors(self) -> Floats:
        """Bounds (R,) on the relative errors of each channel's rates, in roundings of 2**-53; inf if there is none.

        By mass action of a low order `RATE_ERROR`; by a rate law what interval arithmetic finds in these states; 0 for
        channels that change nothing.
        """
        network, works = self.network, self.network.sparse_stoichiometry.has_entries
        needed = network.sparse_reactants
        orders = np.bincount(needed.rows, needed.copies, minlength=len(network.channels))
        errors = np.where(orders <= CERTIFIED_ORDER, RATE_ERROR, np.inf)
        errors[~works] = 0.0
        states = self.states[~self.is_stopped] if network.laws else self.states
        for name, law in network.channel_laws.items():
            r = network.channel_places[name]
            if works[r]:
                errors[r] = law.rate_error(states, float(network.known_rates[r]), float(network.ways[r]))
        return read_only(errors)

    @cached_property
    def _table(self) -> StateTable:
        multipliers = key_multipliers(len(self.network.species))
        keys = keys_of(self.states, multipliers)
        return StateTable(multipliers, keys, state_tables.tabulate(keys, keys.size, state_tables.slots_for(keys.size)))

    def index_of(self, states: ArrayLike) -> NDArray[np.intp]:
        """Rows (...) of states (..., S); -1 for a state that is not among these."""
        asked = np.ascontiguousarray(states, dtype=np.int64)
        flat = asked.reshape(-1, len(self.network.species))
        table = self._table
        rows = state_tables.find(flat, keys_of(flat, table.multipliers), (self.states, table.keys, table.slots))
        return rows.reshape(asked.shape[:-1])

    def rows_with(self, counts: Mapping[str, int] | ArrayLike) -> NDArray[np.intp]:
        """Rows (n,) of the states with these counts: `{"A": 2}` leaves all other species open, S counts name one state.

        >>> from kinetics import Network, reachable
        >>> reachable(Network.from_text("A <-> B, 2, 3"), {"A": 2}).rows_with({"B": 1}).tolist()
        [1]
        """
        if not isinstance(counts, Mapping):
            row = self.index_of(self.network.state(counts))
            return np.flatnonzero(row >= 0) + row  # none, or this one
        columns = [self.network.index(name) for name in counts]
        asked = integers("state", list(counts.values()), (None,), minimum=0)
        return np.flatnonzero((self.states[:, columns] == asked).all(axis=1))

    def transitions(self) -> Transitions:
        """All transitions, one entry per state and channel; channels that change nothing are left out."""
        network, table = self.network, self._table
        changes = network.sparse_stoichiometry
        key_changes = key_changes_of(changes, table.multipliers)
        leaks = np.zeros(len(self))
        rows, columns, fired = ([np.empty(0, np.int64)] for _ in range(3))
        rates = [np.empty(0)]
        length = max(1, CHUNK // max(len(network.channels), 1))
        for begin in range(0, len(self), length):
            part = slice(begin, min(begin + length, len(self)))
            propensities = network.propensities(_unless(self.is_stopped[part], self.states[part]))
            propensities[self.is_stopped[part]] = 0.0
            propensities[:, ~changes.has_entries] = 0.0  # A -> A changes nothing
            ends = state_tables.neighbours(
                begin, propensities, entries_of(changes), key_changes, (self.states, table.keys, table.slots)
            )
            leaks[part] = np.where(ends == state_tables.OUTSIDE, propensities, 0.0).sum(axis=1)
            here, channels = np.nonzero(ends >= 0)
            rows.append(here + begin)
            columns.append(ends[here, channels])
            rates.append(propensities[here, channels])
            fired.append(channels)
        sides = np.concatenate(rows), np.concatenate(columns)
        error = float(self.rate_errors.max(initial=0.0))
        return Transitions(*sides, np.concatenate(rates), leaks, error, np.concatenate(fired))

    def generator(self) -> csr_array:
        """Q (N, N) in 1/tu: rates from row to column off the diagonal, minus their sum on it. dp/dt = p Q."""
        return self.transitions().generator()


def reachable(
    network: Network,
    initial: Mapping[str, int] | ArrayLike,
    stop: Callable[[Ints], NDArray[np.bool_]] | None = None,
    max_states: int = MAX_STATES,
) -> StateSpace:
    """The state space of `network` from `initial`, enumerated breadth first.

    stop : function of states (n, S) that says in which of them (n,) the chain stops, such as the targets of a passage
    max_states : larger spaces are refused
    ValueError: max_states is no whole number of at least 1, or too small

    Channels whose rate is known to be 0 are ignored. Cost: linear in states times channels.

    >>> from kinetics import Network, reachable
    >>> turnover = Network.from_text("0 <-> A, 5, 1")
    >>> len(reachable(turnover, {"A": 0}, stop=lambda states: states[:, 0] >= 10))
    11
    """
    search = Search(network, network.state(initial)[None, :], whole_number("max_states", max_states, 1), stop)
    search.go_on(0)
    return StateSpace(network, search.states, search.stopped())


def _unless(is_stopped: NDArray[np.bool_], states: Ints) -> Ints:
    """The states (n, S), with one that goes on in the place of those that do not: their rate laws may hold no more."""
    if not is_stopped.any() or is_stopped.all():
        return states
    return np.where(is_stopped[:, None], states[np.argmin(is_stopped)], states)
