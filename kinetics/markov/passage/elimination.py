"""Linear equations of a Markov chain, solved without subtractions, so that every entry keeps its relative accuracy.

Grassmann, Taksar & Heyman (1985), doi:10.1287/opre.33.5.1107.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from kinetics.markov.passage.certified import Equations
from kinetics.markov.transient.poisson import ROUNDOFF
from kinetics.markov.transient.transitions import RATE_ERROR, totals
from kinetics.native import linear
from kinetics.support.arrays import Floats
from kinetics.support.interrupts import heard
from kinetics.support.packages import sparse

MAX_WORK = 3e10  # multiplications, some ten seconds
MAX_FACTORED = 1e12  # the same for sparse LU, which takes some hundred seconds then
MAX_NUMBERS = 3e8  # in the band, 2.4 GB
FLOOR = 1e-250  # of a scale, over its largest value
CHEAP = 1e7  # multiplications, some ten milliseconds


class TooLargeError(ValueError):
    """Elimination would take too long; `work` multiplications."""

    def __init__(self, message: str, work: float) -> None:
        super().__init__(message)
        self.work = work


class Elimination(Equations):
    """The equations of a chain by elimination without subtractions, which knows its error beforehand.

    The states are ordered so that the rates lie in a narrow band (Cuthill & McKee 1969,
    doi:10.1145/800195.805928); the cost is n * width**2.

    width : of the band
    error : bound on the relative error of every number that comes out

    Every figure is a ratio of sums of spanning forests, products of one rate out of each state. So a relative error of
    e in the rates out of m states changes it by 2 m e at most (O'Cinneide 1993, doi:10.1007/BF01385743). If a step
    reroutes the rates out of a state, each of them rounds five times: exit rate (twice), share, product, sum. The steps
    count these states.
    """

    def _factor(self, rows: NDArray[Any], columns: NDArray[Any], rates: Floats, leaving: Floats) -> None:
        n = leaving.size
        self._order, here, there = in_a_band(rows, columns, n)
        self.width = int(np.abs(here - there).max(initial=1))
        if n * self.width**2 > MAX_WORK or n * (2 * self.width + 1) > MAX_NUMBERS:
            message = f"{n} states, up to {self.width} apart, are too many to eliminate"
            raise TooLargeError(message, n * float(self.width) ** 2)
        self._band = np.zeros((n, 2 * self.width + 1))
        np.add.at(self._band, (here, there - here + self.width), rates)
        self._exits = np.empty(n)
        changes = linear.reduce(self._band, leaving[self._order].copy(), self._exits)
        # On the way back each figure is a sum of `width` products, of figures found so.
        self.error = float(np.expm1(1.001 * ROUNDOFF * (10.0 * changes + n * (self.width + 2.0 * self.given + 8.0))))

    def solve(self, weights: Floats) -> Floats:
        """x (n,) with exits_i x_i - sum_j rates_ij x_j = weights_i >= 0: the reward accumulated until exit.

        It is inf if a state is left too rarely for a double.
        """
        if not self._exits.all():
            return np.full(weights.size, np.inf)
        x = weights[self._order].astype(float)
        linear.solve(self._band, self._exits, x)
        return self._back(x)

    def occupation(self, start: Floats) -> Floats:
        """Expected time (n,) in each state until the chain is left, from a start spread as `start` (n,); or inf."""
        if not self._exits.all():
            return np.full(start.size, np.inf)
        x = start[self._order].astype(float)
        linear.occupy(self._band, self._exits, x)
        return self._back(x)

    def stationary(self) -> Floats:
        """Probabilities (n,) that do not change, of an irreducible chain that nothing leaves."""
        x = np.empty(self._order.size)
        linear.balance(self._band, x)
        return self._back(x / x.sum())

    def at_most(self, weights: Floats, like: Floats, is_occupation: bool = False) -> Floats:  # noqa: ARG002
        """Upper bounds (n,) on the solution for weights of at least 0, relative to it."""
        found = self.occupation(weights) if is_occupation else self.solve(weights)
        return found / (1.0 - self.error) if self.error < 0.1 else np.full_like(found, np.inf)

    def _back(self, x: Floats) -> Floats:
        """Values reordered from the order of the band to the caller's."""
        result = np.empty_like(x)
        result[self._order] = x
        return result


def in_a_band(rows: NDArray[Any], columns: NDArray[Any], n: int) -> tuple[NDArray[Any], NDArray[Any], NDArray[Any]]:
    """An order of n states with the rates close to the diagonal, and the places of rows and columns (K,) in it.

    States that are few, or come as a search found them, near those that they lead to, are left as they are: importing
    what orders them takes longer than their elimination.
    """
    reach = float(np.abs(rows - columns).max(initial=1))
    if n * reach**2 <= CHEAP:
        return np.arange(n), rows, columns

    pattern: Any = sparse.csr_array((np.ones(rows.size), (rows, columns)), shape=(n, n))
    order = np.asarray(sparse.csgraph.reverse_cuthill_mckee((pattern + pattern.T).tocsr(), symmetric_mode=True))
    place = np.empty(n, dtype=np.int64)
    place[order] = np.arange(n)
    return order, place[rows], place[columns]


def work_of(rows: NDArray[Any], columns: NDArray[Any], n: int) -> float:
    """Multiplications that eliminating n states would take."""
    _, here, there = in_a_band(rows, columns, n)
    return n * float(np.abs(here - there).max(initial=1)) ** 2


class SparseFactors(Equations):
    """Equations of a chain by sparse LU, if it is too large to eliminate; errors are relative to the largest value.

    Minimum degree on the pattern of A + A' and pivots on the diagonal, which suit M-matrices: two to four times
    faster than a narrow band here (George & Liu 1989, doi:10.1137/1031001).
    """

    def _factor(self, rows: NDArray[Any], columns: NDArray[Any], rates: Floats, leaving: Floats) -> None:

        n = leaving.size
        self._exits = totals(rows, rates, n) + leaving
        jumps: Any = sparse.csc_array((rates, (rows, columns)), shape=(n, n))
        diagonal: Any = sparse.dia_array((self._exits[None, :], [0]), shape=(n, n))
        matrix = sparse.csc_array(diagonal - jumps)
        factorise: Any = sparse.linalg.splu
        ordering: Any = {"permc_spec": "MMD_AT_PLUS_A", "diag_pivot_thresh": 0.0, "options": {"SymmetricMode": True}}
        try:
            self._factors = heard(factorise, matrix, **ordering)
        except RuntimeError:  # singular to working precision
            self._factors = None

    def solve(self, weights: Floats) -> Floats:
        """Solve the equations for weights (n,) of any sign."""
        return self._by_factors(weights, False)

    def occupation(self, start: Floats) -> Floats:
        """Expected time (n,) in each state until exit, from a start spread as `start` (n,)."""
        return self._by_factors(start, True)

    def _by_factors(self, weights: Floats, is_occupation: bool) -> Floats:
        if self._factors is None:
            return np.full(weights.size, np.inf)
        return np.asarray(self._factors.solve(weights, trans="T" if is_occupation else "N"))

    def at_most(self, weights: Floats, like: Floats, is_occupation: bool = False) -> Floats:
        """Upper bounds (n,) on the solution for weights of at least 0: a solution, and what it leaves.

        A vector w > 0 with A w >= v > 0 shows that the inverse of A takes r to w max |r| / v at most. With v the exit
        rates times `like`, w is about as much larger as the chain jumps often, whatever the units and the spread.
        """
        found = np.maximum(self._by_factors(weights, is_occupation), 0.0)
        left, doubt = self._left(weights, found, np.zeros_like(found), is_occupation)
        asked = self._exits * np.maximum(like, FLOOR * like.max(initial=0.0))
        wide = self._by_factors(asked, is_occupation)
        rest, more = self._left(asked, wide, np.zeros_like(wide), is_occupation)
        reached = 0.999 * (asked - np.abs(rest) - more)
        if not ((wide > 0.0) & (reached > 0.0)).all():
            return np.full_like(wide, np.inf)
        return found + wide * float(((np.abs(left) + doubt) / reached).max(initial=0.0))


def direct(
    rows: NDArray[Any], columns: NDArray[Any], rates: Floats, leaving: Floats, rate_error: float = RATE_ERROR
) -> Equations:
    """Elimination where the chain is small or narrow enough, else sparse LU; TooLargeError where that would fill up."""
    try:
        return Elimination(rows, columns, rates, leaving, rate_error)
    except TooLargeError as refusal:
        if refusal.work > MAX_FACTORED:
            raise
        return SparseFactors(rows, columns, rates, leaving, rate_error)


def mean_over(start: Floats, values: Floats) -> float:
    """Mean of values (n,) over where a start (n,) is; elsewhere they may be beyond all numbers."""
    held = np.flatnonzero(start)
    return float(start[held] @ values[held])
