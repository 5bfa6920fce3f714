"""The rates of a Markov chain between its states, in which every solver and every question is written."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from kinetics.native import twins
from kinetics.support.arrays import Floats, Ints
from kinetics.support.packages import sparse

if TYPE_CHECKING:
    from scipy.sparse import csr_array

RATE_ERROR = 8.0  # roundings in a rate by mass action: constant, ways and combinations of up to five reactants


class Transitions(NamedTuple):
    """Which state leads to which: from rows (K,) to columns (K,) at rates (K,), 1/tu; leaks (N,) lead elsewhere.

    No state leads to itself; two entries of one place add up.

    rate_error : bound on the relative error of each rate, in roundings of 2**-53: 0 for rates that are what they are,
        `RATE_ERROR` by mass action, more by rate laws; inf if there is none, and so no proven error of a solution
    channels : (K,) the channel behind each entry, where they are those of a network

    >>> from kinetics import Network, reachable
    >>> chain = reachable(Network.from_text("A <-> B, 2, 3"), {"A": 1}).transitions()
    >>> chain.exits.tolist(), chain.generator().toarray().tolist()
    ([2.0, 3.0], [[-2.0, 2.0], [3.0, -3.0]])
    """

    rows: Ints
    columns: Ints
    rates: Floats
    leaks: Floats
    rate_error: float = RATE_ERROR
    channels: Ints | None = None

    @property
    def size(self) -> int:
        """Number of states N."""
        return self.leaks.size

    @property
    def exits(self) -> Floats:
        """Rates (N,) at which the states are left, 1/tu."""
        return totals(self.rows, self.rates, self.size) + self.leaks

    @property
    def is_certified(self) -> bool:
        """True if the errors of the rates are bounded, and rates of 0 are known to be 0."""
        return bool(np.isfinite(self.rate_error))

    @property
    def roundings(self) -> float:
        """The rate error that error bounds use: the proven one, or the one of mass action, for an estimate."""
        return self.rate_error if self.is_certified else RATE_ERROR

    def stopped(self, is_stopped: NDArray[np.bool_]) -> Transitions:
        """The chain that never leaves the states (N,) in which it is stopped."""
        goes = ~is_stopped[self.rows]
        leaks = np.where(is_stopped, 0.0, self.leaks)
        channels = None if self.channels is None else self.channels[goes]
        return Transitions(self.rows[goes], self.columns[goes], self.rates[goes], leaks, self.rate_error, channels)

    def within(self, kept: NDArray[np.bool_]) -> Transitions:
        """The chain of the states kept (N,), in their order; all others are one last state, which is never left."""
        place = np.where(kept, np.cumsum(kept) - 1, np.count_nonzero(kept))
        goes = kept[self.rows]
        leaks = np.append(self.leaks[kept], 0.0)
        channels = None if self.channels is None else self.channels[goes]
        rows, columns = place[self.rows[goes]], place[self.columns[goes]]
        return Transitions(rows, columns, self.rates[goes], leaks, self.rate_error, channels)

    def generator(self) -> csr_array:
        """Q (N, N) in 1/tu: rates from row to column off the diagonal, minus their sum on it. dp/dt = p Q."""
        if self.leaks.any():
            raise ArithmeticError("the state space is not closed: a channel leads out of it")
        shape = (self.size, self.size)
        jumps = sparse.csr_array((self.rates, (self.rows, self.columns)), shape=shape)
        diagonal: Any = sparse.dia_array((self.exits[None, :], [0]), shape=shape)
        return sparse.csr_array(jumps - diagonal)

    def reached_from(self, begins: NDArray[np.bool_]) -> NDArray[np.bool_]:
        """The states (N,) that some way leads to from where it begins (N,), those themselves included."""
        return _connected(self.rows, self.columns, begins)

    def leading_to(self, goals: NDArray[np.bool_]) -> NDArray[np.bool_]:
        """The states (N,) that have some way to a goal (N,), the goals themselves included."""
        return _connected(self.columns, self.rows, goals)


def totals(places: NDArray[Any], values: Floats, n: int) -> Floats:
    """Sums (n,) of the values (K,) at each place (K,)."""
    return np.asarray(np.bincount(places, values, minlength=n), dtype=np.float64)


def _connected(rows: Ints, columns: Ints, begins: NDArray[np.bool_]) -> NDArray[np.bool_]:
    order = np.argsort(rows, kind="stable")
    starts = np.searchsorted(rows[order], np.arange(begins.size + 1))
    found, queue = begins.astype(bool), np.empty(begins.size, dtype=np.int64)
    first = np.flatnonzero(begins)
    queue[: first.size] = first
    twins.reach(starts.astype(np.int64), columns[order].astype(np.int64), queue, first.size, found)
    return found
