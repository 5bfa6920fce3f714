"""Linear equations of a Markov chain by iteration, for chains that elimination would fill up.

Each round corrects the solution by what it leaves of the equations, measured relative to the solution itself, so that
small values become right as well as large ones. The bounds are proven afterwards: a vector w > 0 with A w >= v > 0
shows that the inverse of A takes r to w max |r| / v at most.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from kinetics.markov.passage.certified import FINE, BoundedSolution, Equations
from kinetics.markov.transient.poisson import ROUNDOFF
from kinetics.native import linear
from kinetics.native.rate_tables import RateTable
from kinetics.support.arrays import Floats

LARGEST = 830  # binary exponent of the largest value while bounds are proven, so that small ones lose no digits
TINY = 1e-307  # what doubles lose where they are smallest, and more
FLOOR = 1e-290  # of the largest value: below, values are known to this
SWEEPS = 12  # at most with the incomplete factors alone, whose results are never negative
MUCH = 1.0  # a change by which a value is four times as large or small
LEAST = 1e-2  # of a value, that is left of it in one round
ROUGH, ROUGHLY = 8, 1e-2  # rounds at most, until residuals are no more than this of the solution
ROUNDS = 6  # at most, of corrections by residuals in double-double arithmetic
STEPS = 60  # of a Krylov method in one round
MOST_STEPS = 200  # in all rounds of a solution
SURE = 0.6  # residual of the vector that proves, at most
EVEN = 2.0**-20  # of what flows through each state: weights of so much show by themselves how large solutions are
DIGITS = 1e-12  # by which one round may reduce a residual


class Comparison(NamedTuple):
    """A vector w > 0 (n,), and v > 0 (n,) with A w >= v, proven; inf if there is none."""

    wide: Floats
    reached: Floats

    def bounds(self, left: Floats) -> Floats:
        """Bounds (n,) on the errors of a solution whose residuals are at most `left` (n,)."""
        found = 1.001 * self.wide * float((left / self.reached).max(initial=0.0))
        return np.where(np.isnan(found), np.inf, found)


class Iteration(Equations):
    """The equations of a chain by BiCGSTAB with incomplete factors: see `linear.Factors`.

    Cost: some tens of passes over the rates. If it does not converge, bounds are wide or inf.
    """

    def _factor(self, rows: NDArray[Any], columns: NDArray[Any], rates: Floats, leaving: Floats) -> None:

        self._factors = linear.Factors.of(RateTable.of(rows, columns, rates, leaving.size), leaving)
        self._exits = self._factors.exits
        # Beyond this, rounding of the rates is most of the error.
        self.goal = max(4.0 * FINE, self.rates_error / 16.0)

    def solve(self, weights: Floats) -> Floats:
        """Solve the equations for weights (n,) of at least 0."""
        return self.solved(weights).values

    def occupation(self, start: Floats) -> Floats:
        """Expected time (n,) in each state until exit, from a start spread as `start` (n,)."""
        return self.occupied(start).values

    def occupied(self, start: Floats, guess: Floats | None = None) -> BoundedSolution:
        """Expected occupation times (n,) with bounds; guess : (n,) non-negative, of about the size of the solution."""
        return self._certified(start, True, guess)

    def about(self, start: Floats, guess: Floats) -> Floats:
        """The occupation (n,) from a start to a few digits at most, from a guess; nothing is proven."""
        self._steps = MOST_STEPS
        with np.errstate(all="ignore"):
            return self._rough(start, True, guess)

    def at_most(self, weights: Floats, like: Floats, is_occupation: bool = False) -> Floats:  # noqa: ARG002
        """Upper bounds (n,) on the solution for weights of at least 0: a rough one, and what it may lack."""
        self._steps = MOST_STEPS
        with np.errstate(all="ignore"):
            found = self._rough(weights, is_occupation)
            unit = _unit(found)
            found, weights = found * unit, weights * unit
            left, doubt = self._left(weights, found, np.zeros_like(found), is_occupation)
            wide = self._comparison(found, is_occupation).bounds(np.abs(left) + doubt)
            return (1.0 + 4.0 * ROUNDOFF) * (found + wide) / unit + TINY

    def _certified(self, weights: Floats, is_occupation: bool, guess: Floats | None = None) -> BoundedSolution:

        self._steps = MOST_STEPS
        with np.errstate(all="ignore"):
            high = self._rough(weights, is_occupation, guess)
            unit = _unit(high)
            high, weights = high * unit, weights * unit
            low, best = np.zeros_like(high), np.inf
            left, doubt = self._left(weights, high, low, is_occupation)
            sure = self._comparison(high, is_occupation, weights - np.abs(left) - doubt)
            for _ in range(ROUNDS):
                held = high > FLOOR * high.max(initial=0.0)
                loss = float((sure.wide[held] / high[held]).max(initial=0.0))
                relative = loss * float((np.abs(left) / sure.reached).max(initial=0.0))
                if not self.goal < relative < 0.5 * best:  # good enough, or no better than before
                    break
                best = relative
                goal = max(0.3 * self.goal / loss, DIGITS * relative / loss)
                linear.corrected(high, low, self._changed(left, sure.reached, goal, is_occupation))
                low[high < 0.0] = 0.0
                high[high < 0.0] = 0.0
                left, doubt = self._left(weights, high, low, is_occupation)
            errors = sure.bounds(np.abs(left) + doubt)
            errors = 1.001 * (errors + np.abs(low) + self.rates_error * (high + errors))
            nothing = high == 0.0
            if not left[nothing].any():  # sums of nothing negative
                errors[nothing] = 0.0
            errors = np.where(errors > 0.0, errors / unit + TINY, errors)
            return BoundedSolution(high / unit, np.where(np.isnan(errors), np.inf, errors))

    def _rough(self, weights: Floats, is_occupation: bool, guess: Floats | None = None) -> Floats:
        """A solution to a hundredth of the terms of each equation, where the method comes so far."""
        found = self._settled(weights, np.zeros(weights.size) if guess is None else guess, is_occupation)
        for _ in range(ROUGH):
            left, units = self._rest(weights, found, is_occupation), self._units(found)
            if not np.abs(left / units).max(initial=0.0) > ROUGHLY or not self._steps:
                break
            more = found + self._changed(left, units, 0.3 * ROUGHLY, is_occupation)
            if (more > LEAST * found).all():
                found = more
            else:  # where the units were much too large, little is known yet
                found = self._settled(weights, np.maximum(more, LEAST * found), is_occupation)
        return found

    def _settled(self, weights: Floats, found: Floats, is_occupation: bool) -> Floats:
        """Corrected by the factors alone until no value changes much, so that units are right; never negative."""
        floor = FLOOR * found.max(initial=0.0)
        for _ in range(SWEEPS):
            before = found
            more = found + self._swept(self._rest(weights, found, is_occupation), is_occupation)
            found = np.where(more > 0.0, more, found)
            held = np.maximum(found, before) > floor
            if (np.abs(found - before)[held] <= MUCH * np.minimum(found, before)[held]).all():
                break
        return found

    def _comparison(self, like: Floats, is_occupation: bool, known: Floats | None = None) -> Comparison:
        """The comparison vector from one as large as the solution, times the jumps that the chain has left.

        known : (n,) what A makes of `like` at least; if that is even, it is the vector
        """
        if known is not None and (known > EVEN * self._exits * like).all():
            return Comparison(like.copy(), 0.999 * known)
        asked = self._units(like)
        wide = self._settled(asked, np.zeros_like(asked), is_occupation)
        rest = self._rest(asked, wide, is_occupation)
        wide += self._changed(rest, asked, SURE, is_occupation)
        rest, sizes = self._rest(asked, wide, is_occupation), 2.0 * (self._exits * wide + asked)
        doubt = (self._terms + 8.0) * (ROUNDOFF * (sizes + np.abs(rest)) + TINY)
        reached = 0.999 * (asked - np.abs(rest) - doubt)
        if not ((wide > 0.0) & (reached > 0.0)).all():
            wide = np.full_like(wide, np.inf)
        return Comparison(wide, reached)

    def _units(self, like: Floats) -> Floats:
        """The probability flow (n,) through each state, the scale of its residual."""
        return np.asarray(self._exits * np.maximum(like, FLOOR * like.max(initial=0.0)))

    def _rest(self, weights: Floats, found: Floats, is_occupation: bool) -> Floats:
        """The residual of a solution, in plain doubles."""
        return weights - self._factors.product(found, is_occupation)

    def _swept(self, left: Floats, is_occupation: bool) -> Floats:
        """Apply the preconditioner to a residual, in place."""
        self._factors.sweep(left, is_occupation)
        return left

    def _changed(self, left: Floats, units: Floats, goal: float, is_occupation: bool) -> Floats:
        """The correction of a solution with this residual, by BiCGSTAB."""
        change, most, left = np.zeros_like(left), min(STEPS, self._steps), left.copy()
        self._steps -= self._factors.correct(is_occupation, units, left, change, goal, most)
        return np.where(np.isfinite(change), change, 0.0)


def _unit(values: Floats) -> float:
    """The power of two that takes the largest value to `LARGEST`; 1 if there is none."""
    largest = float(values.max(initial=0.0))
    return float(np.ldexp(1.0, min(LARGEST - int(np.frexp(largest)[1]), 1000))) if 0.0 < largest < np.inf else 1.0
