"""The search for the states that a network can reach: breadth first, within a number of states and of bytes."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from kinetics.kernels.outcomes import OVERFLOW
from kinetics.markov.transient.endless import endless_growth
from kinetics.native import state_tables
from kinetics.network import Network
from kinetics.network.network import check_homogeneous
from kinetics.network.sparse_tables import SparseTable
from kinetics.support.arrays import Ints

Mask = NDArray[np.bool_]
MAX_STATES = 1_000_000
MAX_BYTES = 2**29  # of the table of states
CHUNK = 2**22  # propensities that are computed at a time
DOUBTFUL = 20_000  # states; of a network that reaches more it is asked whether it has an end
MANY = 1024  # states whose laws are worth evaluating at once
MOST_AHEAD = 4096  # states that are judged beside those, before they are known to be reached
NOTHING_STOPS = np.zeros(0, dtype=bool)
ADVICE = (
    "Start from smaller counts, stop the network's growth, keep only the likely states by the method 'fsp', "
    "truncate the chain (`Chain.of(..., truncate=...)`), or sample with the direct method instead"
)


class TooManyStatesError(ValueError):
    """More states than allowed can be reached.

    came : what was found, without the advice, in whose place a command puts its own
    """

    came: str

    @classmethod
    def of(cls, came: str, advice: str = ADVICE) -> TooManyStatesError:
        """The error that says what came, then what to do."""
        error = cls(f"{came}. {advice}")
        error.came = came
        return error


class StateTable(NamedTuple):
    """States as `kernels.exploration` looks them up: factors of the keys, a key each, and the rows by key."""

    multipliers: NDArray[np.uint64]
    keys: NDArray[np.uint64]
    slots: Ints


class Search:
    """A growing set of states.

    states : (n, S) to begin with, none twice
    max_states : more are refused, as are more than `MAX_BYTES` hold
    stop : function of states (n, S) that says in which of them (n,) nothing more happens
    levels : how many states each further event added, by breadth
    """

    def __init__(
        self,
        network: Network,
        states: Ints,
        max_states: int = MAX_STATES,
        stop: Callable[[Ints], Mask] | None = None,
    ) -> None:
        check_homogeneous(network)
        works = network.sparse_stoichiometry.has_entries
        if network.rate_constants is not None:
            works &= network.rate_constants * network.ways > 0
        multipliers = key_multipliers(len(network.species))
        chosen = np.flatnonzero(works)
        needed, changes = (table.picked(chosen) for table in (network.sparse_reactants, network.sparse_stoichiometry))
        self._channels = entries_of(needed), entries_of(changes), key_changes_of(changes, multipliers)
        self._multipliers = multipliers
        self._network, self._stop = network, stop
        self._max_states = min(max_states, MAX_BYTES // state_bytes(len(network.species)))
        self._is_bounded_by_bytes = self._max_states < max_states
        self._n = len(states)
        self._states = np.concatenate([states, states])  # room to grow into
        self._keys = keys_of(self._states, multipliers)
        self._slots = state_tables.tabulate(self._keys, self._n, state_tables.slots_for(2 * self._n))
        self.levels = [self._n]
        places = network.channel_places
        self._laws = [(law, places[name]) for name, law in network.channel_laws.items() if works[places[name]]]
        law_of = np.full(len(network.channels), -1, dtype=np.int64)
        law_of[[r for _, r in self._laws]] = np.arange(len(self._laws))
        self._law_of = law_of[chosen]
        self._judged = self._as_judged(states[:0])
        (rows, keys, slots), verdicts = self._judged
        self._unjudging = (rows, keys, slots[:0]), verdicts  # no table of what is known: nothing need be known
        self._ahead, self._asked, self._last = 64, 0, 0

    def __len__(self) -> int:
        return self._n

    @property
    def _table(self) -> state_tables.Table:
        return self._states, self._keys, self._slots

    @property
    def states(self) -> Ints:
        """The states found so far (N, S)."""
        return self._states[: self._n]

    def add(self, states: Ints) -> Ints:
        """Rows (n,) of the states (n, S), which are added where they are new."""
        keys, room = keys_of(states, self._multipliers), self._n + len(states)
        if room > self._keys.size:
            room = max(room, 2 * self._n)
            self._states, self._keys, self._slots = state_tables.enlarged(self._table, self._n, room)
        rows = np.empty(len(states), dtype=np.int64)
        self._n = state_tables.insert(states, keys, self._table, self._n, rows)
        if self._n > self._max_states:
            raise self._too_many()
        return rows

    def stopped(self) -> Mask:
        """True (N,) for the states in which nothing more can happen."""
        if self._stop is None:
            return np.zeros(self._n, dtype=bool)
        return np.concatenate([self._stops(self.states[k : k + CHUNK]) for k in range(0, self._n, CHUNK)])

    def go_on(self, begin: int, end: int = -1, is_stopped: Mask = NOTHING_STOPS) -> None:
        """Add what the states begin, begin + 1, ... before `end` lead to in one event; without an end, in any number.

        is_stopped : (N,) bool, further states that lead nowhere
        """
        found, level = self._n, len(self.levels)
        level_end = self._n if end < 0 else end
        outcome, i, last = state_tables.COMPLETE, begin, np.iinfo(np.int64).max if end < 0 else end
        # A call ends after some tenths of a second, so that an interrupt is heard.
        piece = max(1, CHUNK // (len(self._network.species) + len(self._network.channels)))
        is_asked = end >= 0 or self._stop is not None or self._max_states <= DOUBTFUL
        while i < min(self._n, last):
            if not is_asked and self._n > DOUBTFUL:
                is_asked = True
                self._check_end()
            before, upto = i, min(i + (piece if is_asked else MANY), last)
            now = state_tables.explore(
                self._channels, self._table, self._n, i, upto, level_end, is_stopped,
                *(self._judged if self._laws or self._stop else self._unjudging), self._max_states,
            )  # fmt: skip
            (self._states, self._keys, self._slots), self._n, i, level_end, outcome, sizes = now
            self._asked += i - before
            self.levels += [int(size) for size in sizes if size]
            if outcome == OVERFLOW:
                raise ValueError("a count grows beyond 2**63 - 1")
            if outcome == state_tables.UNJUDGED:
                self._judge(i, min(self._n, last), is_stopped)
            elif outcome != state_tables.COMPLETE:
                break
        if self._n > level_end:
            self.levels.append(self._n - level_end)
        if outcome == state_tables.TOO_MANY:
            raise self._too_many()
        if self._laws:
            self._order(found, self.levels[level:])

    def _judge(self, begin: int, end: int, is_stopped: Mask) -> None:
        """Find out what happens in the states from `begin` on, and in some that these may lead to.

        Many at once, since a law or a condition takes as long for a thousand states as for one: in a narrow network
        an event leads to few new states. Those ahead are found as if all laws were above 0 and nothing stopped the
        chain; if a law or a condition has no value in one that is never reached, none are judged ahead any more.
        """
        front = self._states[begin : min(end, begin + max(MANY, CHUNK // (1 + len(self._network.channels))))]
        goes = np.ones(len(front), dtype=bool)
        known = is_stopped[begin : begin + len(front)]
        goes[: known.size] = ~known
        front = front[goes]
        if self._last:  # how many of those judged last were reached: far fewer are no use
            self._ahead = min(2 * self._ahead, MOST_AHEAD) if 4 * self._asked >= self._last else self._ahead // 2
        self._asked = 0
        if self._ahead and len(front) < MANY:
            try:
                self._judged = self._as_judged(self._with_more(front))
            except Exception:  # noqa: BLE001  # what a function of the caller's raises where it is not meant to be asked
                self._ahead = 0
            else:
                self._last = self._judged[0][1].size
                return
        self._last = 0
        self._judged = self._as_judged(front)

    def _with_more(self, front: Ints) -> Ints:
        """The states (n, S), and some that they may lead to."""
        keys = keys_of(front, self._multipliers)
        slots, n = state_tables.tabulate(keys, len(front), state_tables.slots_for(len(front))), len(front)
        most = n + self._ahead
        (states, *_), n, *_ = state_tables.explore(
            self._channels, (front.copy(), keys, slots), n, 0, most, n, NOTHING_STOPS, *self._unjudging, most
        )
        return states[:n]

    def _as_judged(self, states: Ints) -> tuple[state_tables.Table, state_tables.Verdicts]:
        """A table of the states (n, S), and what happens in them."""
        keys = keys_of(states, self._multipliers)
        stops = self._stops(states) if len(states) else np.zeros(0, dtype=bool)
        works = np.zeros((len(states), len(self._laws)), dtype=bool)
        going = states[~stops]
        for k, (law, r) in enumerate(self._laws if len(going) else []):
            works[~stops, k] = self._factor(r) * law.values(going, 0.0) > 0.0
        slots = state_tables.tabulate(keys, len(states), state_tables.slots_for(max(len(states), 1)))
        # All writable, whatever came: kernels would be compiled once more for arrays that are not.
        return (np.array(states), keys, slots), (stops, works, self._law_of)

    def _stops(self, states: Ints) -> Mask:
        if self._stop is None:
            return np.zeros(len(states), dtype=bool)
        return np.full(len(states), self._stop(states), dtype=bool)

    def _factor(self, r: int) -> float:
        """Constant times ways of a channel; 1 if there is no constant yet."""
        known = self._network.rate_constants
        return 1.0 if known is None else float(known[r] * self._network.ways[r])

    def _order(self, found: int, sizes: list[int]) -> None:
        """Sort the states from row `found` on within their levels, so that laws do not change their order."""
        if max(sizes, default=1) == 1:
            return
        new = self._states[found : self._n]
        level = np.repeat(np.arange(len(sizes)), sizes)
        columns = [column for column in new.T[::-1] if column[0] != column[-1] or (column != column[0]).any()]
        order = np.lexsort([*columns, level])
        self._states[found : self._n] = new[order]
        self._keys[found : self._n] = self._keys[found : self._n][order]
        self._slots = state_tables.tabulate(self._keys, self._n, self._slots.size)

    def _check_end(self) -> None:
        growth = endless_growth(self._network, self.states)
        if growth:
            raise TooManyStatesError.of(f"infinitely many states are reachable: {growth}")

    def _too_many(self) -> TooManyStatesError:
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
        if self._is_bounded_by_bytes:
            held = f", all that {MAX_BYTES // 2**20} MB hold for {len(self._network.species)} species"
            return TooManyStatesError.of(f"over {self._max_states} states are reachable{held}{pace}")
        return TooManyStatesError.of(
            f"over {self._max_states} states are reachable{pace}", f"{ADVICE}, or raise max_states"
        )


def state_bytes(n_species: int) -> int:
    """Bytes that a state takes: its counts, the chain's copy of them, its key, and its slots in the table of keys."""
    return 8 * (2 * n_species + 1 + 4)


def key_multipliers(n_species: int) -> NDArray[np.uint64]:
    """Random odd numbers (S,), always the same ones."""
    rng = np.random.default_rng(0)
    return rng.integers(0, 2**63, size=n_species, dtype=np.uint64) * np.uint64(2) + np.uint64(1)


def keys_of(states: Ints, multipliers: NDArray[np.uint64]) -> NDArray[np.uint64]:
    """Keys (...) of states (..., S): a product that wraps around at 2**64."""
    return np.asarray((states.astype(np.uint64) * multipliers).sum(axis=-1, dtype=np.uint64))


def key_changes_of(changes: SparseTable, multipliers: NDArray[np.uint64]) -> NDArray[np.uint64]:
    """The change (R,) of a state's key when each channel fires."""
    parts = changes.copies.astype(np.uint64) * multipliers[changes.columns]
    sums = np.append(np.zeros(1, dtype=np.uint64), np.cumsum(parts, dtype=np.uint64))
    return sums[changes.starts[1:]] - sums[changes.starts[:-1]]


def entries_of(table: SparseTable) -> tuple[Ints, Ints, Ints]:
    """Starts, columns and values of a sparse table."""
    return table.starts, table.columns, table.copies
