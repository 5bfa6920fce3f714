"""The states a network can reach, and the sparse generator of its Markov chain."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from kinetics.kernels.outcomes import OVERFLOW
from kinetics.native import twins
from kinetics.network import Network
from kinetics.network.sparse_tables import SparseTable
from kinetics.solving.transitions import RATE_ERROR, Transitions
from kinetics.support.arrays import Floats, Ints, integers, read_only, whole_number

if TYPE_CHECKING:
    from scipy.sparse import csr_array

MAX_STATES = 1_000_000
CHUNK = 2**22  # propensities that are computed at a time
CERTIFIED_ORDER = 5  # combinations of so many reactants, constant and ways round at most `RATE_ERROR` times


class TooManyStatesError(ValueError):
    """More states than allowed can be reached."""


class StateTable(NamedTuple):
    """States as `kernels.exploration` looks them up: factors of the keys, a key each, and the rows by key."""

    multipliers: NDArray[np.uint64]
    keys: NDArray[np.uint64]
    slots: Ints


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
        """Bounds (R,) on the relative errors of each channel's rates, in roundings of 2**-53; inf where there is none.

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
        multipliers = _multipliers(len(self.network.species))
        keys = _keys(self.states, multipliers)
        return StateTable(multipliers, keys, twins.tabulate(keys, keys.size, _slots_for(keys.size)))

    def index_of(self, states: ArrayLike) -> NDArray[np.intp]:
        """Rows (...) of states (..., S); -1 for a state that is not among these."""
        asked = np.ascontiguousarray(states, dtype=np.int64)
        flat = asked.reshape(-1, len(self.network.species))
        table = self._table
        rows = twins.find(flat, _keys(flat, table.multipliers), self.states, table.keys, table.slots)
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
        key_changes = _key_changes(changes, table.multipliers)
        leaks = np.zeros(len(self))
        rows, columns, fired = ([np.empty(0, np.int64)] for _ in range(3))
        rates = [np.empty(0)]
        length = max(1, CHUNK // max(len(network.channels), 1))
        for begin in range(0, len(self), length):
            part = slice(begin, min(begin + length, len(self)))
            propensities = network.propensities(_unless(self.is_stopped[part], self.states[part]))
            propensities[self.is_stopped[part]] = 0.0
            propensities[:, ~changes.has_entries] = 0.0  # A -> A changes nothing
            ends = twins.neighbours(
                begin, propensities, _parts(changes), key_changes, self.states, table.keys, table.slots
            )
            leaks[part] = np.where(ends == twins.OUTSIDE, propensities, 0.0).sum(axis=1)
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
    search = Search(network, network.state(initial)[None, :], whole_number("max_states", max_states, 1))
    if stop is None:
        search.go_on(0)
        return StateSpace(network, search.states.copy(), np.zeros(len(search), dtype=bool))
    is_stopped = np.zeros(1024, dtype=bool)
    begin = 0
    while begin < len(search):
        end = len(search)
        if end > is_stopped.size:
            is_stopped = np.append(is_stopped, np.zeros(end, dtype=bool))
        is_stopped[begin:end] = stop(search.states[begin:])
        search.go_on(begin, end, is_stopped)
        begin = end
    return StateSpace(network, search.states.copy(), is_stopped[: len(search)].copy())


class Search:
    """A growing set of states.

    states : (n, S) to begin with, none twice
    max_states : more are refused
    levels : how many states each further event added, by breadth
    """

    def __init__(self, network: Network, states: Ints, max_states: int = MAX_STATES) -> None:
        network.check_homogeneous()
        works = network.sparse_stoichiometry.has_entries
        if network.rate_constants is not None:
            works &= network.rate_constants * network.ways > 0
        multipliers = _multipliers(len(network.species))
        needed, changes = (
            table.picked(np.flatnonzero(works)) for table in (network.sparse_reactants, network.sparse_stoichiometry)
        )
        self._channels = _parts(needed), _parts(changes), _key_changes(changes, multipliers)
        self._multipliers = multipliers
        self._network, self._max_states = network, max_states
        self._n = len(states)
        self._states = np.concatenate([states, states])  # room to grow into
        self._keys = _keys(self._states, multipliers)
        self._slots = twins.tabulate(self._keys, self._n, _slots_for(2 * self._n))
        self.levels = [self._n]

    def __len__(self) -> int:
        return self._n

    @property
    def states(self) -> Ints:
        """The states found so far (N, S)."""
        return self._states[: self._n]

    def add(self, states: Ints) -> Ints:
        """Rows (n,) of the states (n, S), which are added where they are new."""
        keys, room = _keys(states, self._multipliers), self._n + len(states)
        if room > self._keys.size:
            more = max(room, 2 * self._n) - self._n
            self._states = np.concatenate([self.states, np.empty((more, states.shape[1]), dtype=np.int64)])
            self._keys = np.append(self._keys[: self._n], np.empty(more, dtype=np.uint64))
            self._slots = twins.tabulate(self._keys, self._n, _slots_for(self._keys.size))
        rows = np.empty(len(states), dtype=np.int64)
        self._n = twins.insert(states, keys, self._states, self._keys, self._slots, self._n, rows)
        if self._n > self._max_states:
            raise TooManyStatesError(self._too_many())
        return rows

    def go_on(self, begin: int, end: int = -1, is_stopped: NDArray[np.bool_] | None = None) -> None:
        """Add what the states begin, begin + 1, ... before `end` lead to in one event; without an end, in any number.

        is_stopped : (N,) bool, states that lead nowhere
        """
        if self._network.laws:
            self._go_on_by_law(begin, end, is_stopped)
            return
        stopped = np.empty(0, dtype=bool) if is_stopped is None else is_stopped
        self._states, self._keys, self._slots, self._n, outcome, levels = twins.explore(
            *self._channels, self._states, self._keys, self._slots, self._n, begin, end, stopped, self._max_states
        )
        self.levels += [int(size) for size in levels if size]
        if outcome == OVERFLOW:
            raise ValueError("a count grows beyond 2**63 - 1")
        if outcome == twins.TOO_MANY:
            raise TooManyStatesError(self._too_many())

    def _go_on_by_law(self, begin: int, end: int, is_stopped: NDArray[np.bool_] | None) -> None:
        """The same for rate laws that may be 0 though all reactants are there: level by level, by the propensities."""
        network = self._network
        known = network if network.rate_constants is not None else network.with_rates(np.ones(len(network.channels)))
        until, found = len(self) if end < 0 else end, len(self)
        while begin < until:
            # Pieces keep the table of propensities small.
            last = min(until, begin + max(1, CHUNK // max(len(network.channels), 1)))
            here = self.states[begin:last]
            if is_stopped is not None and is_stopped.size:
                here = here[~is_stopped[begin:last]]
            goes = known.propensities(here) > 0.0
            goes[:, ~network.sparse_stoichiometry.has_entries] = False
            rows, channels = np.nonzero(goes)
            new = network.sparse_stoichiometry.added_to(here[rows], channels)
            if new.size and new.min() < 0:
                raise ValueError("a count grows beyond 2**63 - 1")
            self.add(np.unique(new, axis=0))
            begin = last
            if begin == until:
                self.levels.append(len(self) - found)
                until, found = len(self) if end < 0 else end, len(self)

    def _too_many(self) -> str:
        recent = ", ".join(str(size) for size in self.levels[-5:-1])
        pace = ""
        if recent:
            last = sum(self.levels[-2:])  # the very last level may be cut short
            tops, before = self.states[-last:].max(axis=0), self.states[:-last].max(axis=0, initial=0)
            risen = [
                f"{name} up to {top}"
                for name, top, old in zip(self._network.species, tops, before, strict=True)
                if top > old
            ]
            growing = f" ({', '.join(risen[:3])} and rising)" if risen else ""
            pace = (
                f": {len(self.levels) - 1} events away from the initial state, and the number of states still goes "
                f"{recent} with each further event{growing}"
            )
        return (
            f"over {self._max_states} states are reachable{pace}. Start from fewer copies, "
            f"stop the network's growth, keep only the likely states by the method 'fsp', follow the chain within "
            f"some of them (`Chain.of(..., within=...)`, --within), sample with the direct method instead, or raise "
            f"max_states"
        )


def _unless(is_stopped: NDArray[np.bool_], states: Ints) -> Ints:
    """The states (n, S), with one that goes on in the place of those that do not: their rate laws may hold no more."""
    if not is_stopped.any() or is_stopped.all():
        return states
    return np.where(is_stopped[:, None], states[np.argmin(is_stopped)], states)


def _multipliers(n_species: int) -> NDArray[np.uint64]:
    """Random odd numbers (S,), always the same ones."""
    rng = np.random.default_rng(0)
    return rng.integers(0, 2**63, size=n_species, dtype=np.uint64) * np.uint64(2) + np.uint64(1)


def _keys(states: Ints, multipliers: NDArray[np.uint64]) -> NDArray[np.uint64]:
    """Keys (...) of states (..., S): a product that wraps around at 2**64."""
    return (states.astype(np.uint64) * multipliers).sum(axis=-1, dtype=np.uint64)


def _key_changes(changes: SparseTable, multipliers: NDArray[np.uint64]) -> NDArray[np.uint64]:
    """What each channel (R,) adds to a key."""
    parts = changes.copies.astype(np.uint64) * multipliers[changes.columns]
    sums = np.append(np.zeros(1, dtype=np.uint64), np.cumsum(parts, dtype=np.uint64))
    return sums[changes.starts[1:]] - sums[changes.starts[:-1]]


def _parts(table: SparseTable) -> tuple[Ints, Ints, Ints]:
    return table.starts, table.columns, table.copies


def _slots_for(n: int) -> int:
    """Size of a table, a power of two, that n states fill to a half at most."""
    return int(2 ** max(4, (2 * n - 1).bit_length()))
