"""Which way a chain's linear equations are solved: by iteration, elimination without subtractions, or sparse LU."""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from kinetics.markov.passage.certified import BoundedSolution, Equations
from kinetics.markov.passage.elimination import (
    CHEAP,
    MAX_FACTORED,
    Elimination,
    SparseFactors,
    TooLargeError,
    direct,
    work_of,
)
from kinetics.markov.passage.iteration import Iteration
from kinetics.markov.transient.transitions import RATE_ERROR
from kinetics.support.arrays import Floats

FEW = 300  # states that are eliminated at once
EASY = 100.0  # multiplications a rate, by which elimination is no slower than iteration
ALIKE = 2.0  # times the error by rounding of the rates: no method would have much less
FINE = 1e-12  # a relative error that needs no other way
ROUGH = 1e-3  # one that is told rather than refused


class Iterated(Equations):
    """The equations by iteration, as long as that proves what a direct way would; from then on by a direct one.

    Sparse LU is tried before elimination, which takes three times as long for ten groups of 300 states that are rarely
    left; it is taken if it proves as much.
    """

    def _factor(self, rows: NDArray[Any], columns: NDArray[Any], rates: Floats, leaving: Floats) -> None:
        self._iteration = Iteration(rows, columns, rates, leaving, self.rate_error)
        self._chosen: Equations = self._iteration

    @cached_property
    def _factors(self) -> Equations | None:
        """Sparse factors, if they neither fill up nor take longer than elimination."""
        work = work_of(*self._rates[:2], self._rates[3].size)
        return SparseFactors(*self._rates, self.rate_error) if CHEAP < work <= MAX_FACTORED else None

    @cached_property
    def _direct(self) -> Equations:
        try:
            return Elimination(*self._rates, self.rate_error)
        except TooLargeError:
            if self._factors is None:
                raise
            return self._factors

    def solve(self, weights: Floats) -> Floats:
        """Solve the equations for weights (n,) of at least 0."""
        return self.solved(weights).values

    def occupation(self, start: Floats) -> Floats:
        """Expected time (n,) in each state until exit, from a start spread as `start` (n,)."""
        return self.occupied(start).values

    def solved(self, weights: Floats) -> BoundedSolution:
        """Solve the equations for weights (n,) of at least 0, with bounds on the errors."""
        return self._found(lambda way: way.solved(weights))

    def occupied(self, start: Floats) -> BoundedSolution:
        """Expected occupation times (n,) from a start (n,), with bounds on the errors."""
        return self._found(lambda way: way.occupied(start))

    def at_most(self, weights: Floats, like: Floats, is_occupation: bool = False) -> Floats:
        """Proven upper bounds (n,) on the solution for weights (n,) of at least 0."""
        found = self._chosen.at_most(weights, like, is_occupation)
        if np.isfinite(found).all() or self._chosen is not self._iteration:
            return found
        return self._direct.at_most(weights, like, is_occupation)

    def _found(self, ask: Callable[[Equations], BoundedSolution]) -> BoundedSolution:
        found = ask(self._chosen)
        if self._chosen is not self._iteration or found.relative <= self._fine:
            return found
        if self._factors is not None:
            factored = ask(self._factors)
            if factored.relative <= self._fine:
                self._chosen = self._factors
                return factored
            found = min(found, factored, key=lambda solution: solution.relative)
        try:
            self._chosen = self._direct
        except TooLargeError:
            if found.relative < ROUGH:
                return found
            raise
        return ask(self._chosen)

    @property
    def _fine(self) -> float:
        return max(FINE, ALIKE * self.rates_error)


def equations(
    rows: NDArray[Any], columns: NDArray[Any], rates: Floats, leaving: Floats, rate_error: float = RATE_ERROR
) -> Equations:
    """Iteration where elimination would take longer; if that does not converge, or for few states, a direct way."""
    if is_easy(rows, columns, leaving.size):
        return direct(rows, columns, rates, leaving, rate_error)
    return Iterated(rows, columns, rates, leaving, rate_error)


def is_easy(rows: NDArray[Any], columns: NDArray[Any], n: int) -> bool:
    """Whether a chain on n states is so small or narrow that elimination is the quickest way."""
    return n <= FEW or n * float(np.abs(rows - columns).max(initial=1)) ** 2 <= EASY * rows.size
