"""Solutions of a chain's linear equations with bounds that are proven afterwards, from what they leave of these.

The matrix A of such equations is an M-matrix: its inverse holds no negative number, so that an x which leaves r of
them is wrong by at most the inverse of A times |r|, state by state. A sum in doubles cannot show an r that is small
enough where a chain jumps often before it ends, hence r is in double-double arithmetic, and so is x, which is refined
first.

Berman & Plemmons (1994), Nonnegative Matrices, ch. 6, doi:10.1137/1.9781611971262; refinement: Wilkinson (1963).
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from kinetics.markov.transient.poisson import ROUNDOFF
from kinetics.markov.transient.transitions import RATE_ERROR
from kinetics.native import linear
from kinetics.support.arrays import Floats

REFINEMENTS = 8  # at most; one or two are the rule
FINE = 2.0**-50  # a relative error that needs no refinement
PAIRS = 2.0**-102  # relative error of a product of pairs and its addition, at most
SMALLEST = 1e-291  # what a product may lose where it is below the reach of pairs


class BoundedSolution(NamedTuple):
    """Values (n,), none negative, and bounds (n,) on their absolute errors, rounding of the rates included."""

    values: Floats
    errors: Floats

    def mean(self, start: Floats) -> tuple[float, float]:
        """Mean over a start (n,), and its relative error; values elsewhere may be beyond all numbers."""
        held = np.flatnonzero(start)
        mean, wrong = (float(start[held] @ each[held]) for each in self)
        if wrong == 0.0:
            return mean, ROUNDOFF * (held.size - 1)
        relative = 1.001 * (wrong / mean + ROUNDOFF * held.size) if mean > 0 else np.inf
        return mean, float(np.nan_to_num(relative, nan=np.inf, posinf=np.inf))

    @property
    def relative(self) -> float:
        """The largest relative error of any value."""
        return self.relative_above(0.0)

    def relative_above(self, least: float) -> float:
        """The largest relative error of any value but those that are known to be no more than `least`."""
        held = (self.errors > 0.0) & ~(self.values + self.errors <= least)
        if not held.any():
            return 0.0
        with np.errstate(all="ignore"):
            # negative ones come from a solution that failed: of these nothing is known
            largest = float(np.where(self.values[held] > 0.0, self.errors[held] / self.values[held], np.inf).max())
        return float(np.nan_to_num(largest, nan=np.inf, posinf=np.inf))


class Equations(ABC):
    """A chain on n states that goes from rows (K,) to columns (K,) at rates (K,), and is left at `leaving` (n,).

    rate_error : bound on the relative error of each rate, in roundings
    """

    error = np.inf  # relative error of what `solve` and `occupation` give, as far as it is known beforehand

    def __init__(
        self,
        rows: NDArray[Any],
        columns: NDArray[Any],
        rates: Floats,
        leaving: Floats,
        rate_error: float = RATE_ERROR,
    ) -> None:
        self.rate_error = rate_error
        self._rates = (rows.astype(np.int64), columns.astype(np.int64), np.asarray(rates, dtype=float), leaving)
        # In the rates that come: their own roundings, and sums of those that lead to one place or out of the chain.
        self.given = rate_error + int(np.bincount(rows, minlength=1).max())
        # Every figure is a ratio of sums of spanning forests: see `elimination`. Leaving and weights round once, too.
        self.rates_error = float(np.expm1(1.001 * ROUNDOFF * 2.0 * leaving.size * (self.given + 2.0)))
        self._terms = 4.0 + float(np.bincount(columns, minlength=1).max()) + self.given
        self._factor(rows, columns, rates, leaving)

    @abstractmethod
    def _factor(self, rows: NDArray[Any], columns: NDArray[Any], rates: Floats, leaving: Floats) -> None:
        """Prepare what `solve` and `occupation` need."""

    @abstractmethod
    def solve(self, weights: Floats) -> Floats:
        """x (n,) with exits_i x_i - sum_j rates_ij x_j = weights_i: the reward accumulated until exit."""

    @abstractmethod
    def occupation(self, start: Floats) -> Floats:
        """Expected time (n,) in each state until the chain is left, from a start spread as `start` (n,)."""

    @abstractmethod
    def at_most(self, weights: Floats, like: Floats, is_occupation: bool = False) -> Floats:
        """Proven upper bounds (n,) on the exact solution for weights of at least 0; inf if there are none.

        like : (n,) their scale; some bounds are tight only relative to it
        """

    def solved(self, weights: Floats) -> BoundedSolution:
        """Solve the equations for weights (n,) of at least 0, with bounds on the errors; see `solve`."""
        return self._certified(weights, False)

    def occupied(self, start: Floats) -> BoundedSolution:
        """Expected occupation times (n,), with bounds on the errors; see `occupation`."""
        return self._certified(start, True)

    def _certified(self, weights: Floats, is_occupation: bool) -> BoundedSolution:
        """The solution, refined until its residual proves it; otherwise with the error known beforehand."""
        solve = self.occupation if is_occupation else self.solve
        begun = np.array(solve(weights))
        prior = BoundedSolution(begun, np.full_like(begun, np.inf) if self.error == np.inf else self.error * begun)
        high, low = begun.copy(), np.zeros_like(begun)
        errors = np.full_like(begun, np.inf)
        with np.errstate(all="ignore"):
            left, _ = self._left(weights, high, low, is_occupation)
            nothing = begun == 0.0
            # States that nothing leads from, or to: without subtractions, their sums are 0.
            is_nothing = not left[nothing].any()
            # Iterative refinement: solve for the residual and add the correction in double-double pairs. The solution
            # for the absolute residual bounds the error, as the inverse of an M-matrix is non-negative.
            for _ in range(REFINEMENTS):
                if not np.isfinite(left).all():
                    return prior
                linear.corrected(high, low, solve(left))
                left, doubt = self._left(weights, high, low, is_occupation)
                errors = self.at_most(np.abs(left) + doubt, begun, is_occupation)
                if (errors[~nothing] <= FINE * high[~nothing]).all():
                    break
            # Then the error of the rates themselves, relative to the solution, and the low parts, which are left out.
            errors = 1.001 * (errors + np.abs(low) + self.rates_error * (np.abs(high) + errors))
            errors = np.where(nothing & is_nothing, 0.0, np.where(np.isnan(errors), np.inf, errors))
            better = errors < prior.errors
        return BoundedSolution(np.where(better, np.maximum(high, 0.0), begun), np.where(better, errors, prior.errors))

    def _left(self, weights: Floats, high: Floats, low: Floats, is_occupation: bool) -> tuple[Floats, Floats]:
        """The residual (n,) of a solution in double-double pairs, and a bound on its rounding error."""
        left = np.stack([weights, np.zeros_like(weights)], axis=1)
        sizes = np.abs(weights)
        linear.take_off(is_occupation, *self._rates, high, low, left, sizes)
        rest = left.sum(axis=1)
        return rest, self._terms * (PAIRS * sizes + SMALLEST) + ROUNDOFF * np.abs(rest)


def leaving_rates(places: NDArray[Any], rates: Floats, n: int) -> Floats:
    """Sums (n,) of the rates (K,) that lead out of a chain at each place (K,), rounded once."""
    sums = np.zeros(n, dtype=np.longdouble)
    np.add.at(sums, places, rates)
    return sums.astype(float)
