"""Linear equations of a Markov chain, solved without subtractions, so that every entry keeps its relative accuracy.

Grassmann, Taksar & Heyman (1985), doi:10.1287/opre.33.5.1107.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from kinetics.solving.poisson import ROUNDOFF
from kinetics.solving.transitions import RATE_ERROR, totals
from kinetics.support.arrays import Floats

MAX_WORK = 3e10  # multiplications, some ten seconds
MAX_NUMBERS = 3e8  # in the band, 2.4 GB


class TooLargeError(ValueError):
    """Elimination would take too long."""


class Elimination:
    """A chain on n states that goes from rows (K,) to columns (K,) at rates (K,), and is left at `leaving` (n,).

    rate_error : relative error of each rate, in roundings

    The states are ordered so that the rates lie in a narrow band (Cuthill & McKee 1969,
    doi:10.1145/800195.805928); the cost is n * width**2.

    width : of the band
    error : bound on the relative error of every number that comes out

    Every figure is a ratio of sums of spanning forests, products of one rate out of each state. So a relative error of
    e in the rates out of m states changes it by 2 m e at most (O'Cinneide 1993, doi:10.1007/BF01385743). Where a step
    reroutes the rates out of a state, each of them rounds five times: exit rate (twice), share, product, sum. The steps
    count these states.
    """

    def __init__(
        self,
        rows: NDArray[Any],
        columns: NDArray[Any],
        rates: Floats,
        leaving: Floats,
        rate_error: float = RATE_ERROR,
    ) -> None:
        from scipy.sparse import csr_array
        from scipy.sparse.csgraph import reverse_cuthill_mckee

        from kinetics.kernels import elimination

        n = leaving.size
        pattern: Any = csr_array((np.ones(rows.size), (rows, columns)), shape=(n, n))
        self._order = np.asarray(reverse_cuthill_mckee((pattern + pattern.T).tocsr(), symmetric_mode=True))
        place = np.empty(n, dtype=np.int64)
        place[self._order] = np.arange(n)
        here, there = place[rows], place[columns]
        self.width = int(np.abs(here - there).max(initial=1))
        if n * self.width**2 > MAX_WORK or n * (2 * self.width + 1) > MAX_NUMBERS:
            raise TooLargeError(f"{n} states, up to {self.width} apart, are too many to eliminate")
        self._band = np.zeros((n, 2 * self.width + 1))
        np.add.at(self._band, (here, there - here + self.width), rates)
        self._exits = np.empty(n)
        changes = elimination.reduce(self._band, leaving[self._order].copy(), self._exits)
        # In the rates that come: their own roundings, and sums of those that lead to one place or out of the chain.
        given = rate_error + int(np.bincount(rows, minlength=1).max())
        # On the way back each figure is a sum of `width` products, of figures found so.
        self.error = float(np.expm1(1.001 * ROUNDOFF * (10.0 * changes + n * (self.width + 2.0 * given + 8.0))))

    def solve(self, weights: Floats) -> Floats:
        """x (n,) with exits_i x_i - sum_j rates_ij x_j = weights_i, for weights >= 0: earned on the way out."""
        from kinetics.kernels import elimination

        x = weights[self._order].astype(float)
        elimination.solve(self._band, self._exits, x)
        return self._back(x)

    def occupation(self, start: Floats) -> Floats:
        """Expected time (n,) in each state until the chain is left, from a start spread as `start` (n,)."""
        from kinetics.kernels import elimination

        x = start[self._order].astype(float)
        elimination.occupy(self._band, self._exits, x)
        return self._back(x)

    def stationary(self) -> Floats:
        """Probabilities (n,) that do not change, of an irreducible chain that nothing leaves."""
        from kinetics.kernels import elimination

        x = np.empty(self._order.size)
        elimination.balance(self._band, x)
        return self._back(x / x.sum())

    def _back(self, x: Floats) -> Floats:
        """From the order of the band to that of the caller."""
        result = np.empty_like(x)
        result[self._order] = x
        return result


class SparseFactors:
    """The same equations by sparse LU, for chains too large to eliminate: right to the largest number that comes out.

    error : estimate of the error over the largest entry. The inverse of this matrix is positive, so its norm is known
        from the solution for weights of 1.
    """

    def __init__(self, rows: NDArray[Any], columns: NDArray[Any], rates: Floats, leaving: Floats) -> None:
        from scipy.sparse import csc_array, dia_array
        from scipy.sparse.linalg import splu

        n = leaving.size
        exits = totals(rows, rates, n) + leaving
        jumps: Any = csc_array((rates, (rows, columns)), shape=(n, n))
        diagonal: Any = dia_array((exits[None, :], [0]), shape=(n, n))
        try:
            self._factors: Any = splu(csc_array(diagonal - jumps))
        except RuntimeError:  # singular to working precision
            self.error = float("inf")
            return
        longest = float(self.solve(np.ones(n)).max())
        self.error = 4.0 * float(exits.max()) * longest * ROUNDOFF if longest > 0 else float("inf")

    def solve(self, weights: Floats) -> Floats:
        """As `Elimination.solve`."""
        return self._factors.solve(weights)

    def occupation(self, start: Floats) -> Floats:
        """As `Elimination.occupation`."""
        return self._factors.solve(start, trans="T")


def equations(
    rows: NDArray[Any], columns: NDArray[Any], rates: Floats, leaving: Floats, rate_error: float = RATE_ERROR
) -> Elimination | SparseFactors:
    """Elimination where the chain is small or narrow enough, else sparse LU."""
    try:
        return Elimination(rows, columns, rates, leaving, rate_error)
    except TooLargeError:
        return SparseFactors(rows, columns, rates, leaving)


def mean_over(start: Floats, values: Floats) -> float:
    """Mean of values (n,) over where a start (n,) is; elsewhere they may be beyond all numbers."""
    held = np.flatnonzero(start)
    return float(start[held] @ values[held])


def relative_error(chain: Elimination | SparseFactors, solution: Floats, start: Floats) -> float:
    """Relative error of the mean of a solution (n,) over a start (n,) that is not negative."""
    if isinstance(chain, Elimination):
        # a start in several states adds up products
        terms = int(np.count_nonzero(start))
        return chain.error if terms == 1 else chain.error + 1.001 * ROUNDOFF * terms
    mean = mean_over(start, solution)
    return chain.error * float(start.sum() * solution.max() / mean) if mean > 0 else float("inf")
