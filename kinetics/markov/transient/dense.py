"""The exponential of a generator by scaling and squaring without subtractions, for small and stiff chains."""

from __future__ import annotations

from dataclasses import dataclass
from math import comb, exp, floor, log2
from typing import ClassVar

import numpy as np

from kinetics.markov.transient.base import ListingMethod, ProbabilityTable
from kinetics.markov.transient.certificate import best_entries, distance
from kinetics.markov.transient.poisson import ROUNDOFF, poisson_bounds
from kinetics.markov.transient.states import StateSpace
from kinetics.markov.transient.transitions import Transitions
from kinetics.support.arrays import Floats
from kinetics.support.interrupts import LONG, heard
from kinetics.support.memory import check_memory

MAX_DENSE = 2000  # states
CERTIFIED = 500  # states, some six seconds
LARGEST = 1e100  # of rates and times; their product, and powers of two far below it, must be numbers
TERMS = 10  # of the series for the shortest step
SMALLEST = 1e-290  # entries below this are dropped, so that no arithmetic on denormal numbers slows the product
TINY = 1e-320
OTHER_UNIT = 0.7  # makes q smaller, so the step that was short enough still is


@dataclass(frozen=True)
class Dense(ListingMethod):
    """The matrix exponential by non-negative scaling and squaring, for small chains of any stiffness.

    exp(Q h) for a short step h is the Taylor series of a positive matrix, which is then squared repeatedly. Products
    and sums of positive numbers do not cancel, so every probability keeps its own relative accuracy. After each
    squaring the diagonal is set to what its row needs to sum to one, as Grassmann, Taksar & Heyman do in elimination,
    so that mass is kept and the errors of the entries do not double.

    max_states : larger chains are refused
    certified_states : up to this many states the error is a proven bound, from a second solution in fixed-point
        arithmetic that takes about twenty times as long; above, it is an estimate, from a second solution in another
        unit of time. It is also an estimate where a rate law cannot be bounded.

    Source: Xue & Ye (2013), doi:10.1090/S0025-5718-2013-02677-4, and Grassmann, Taksar & Heyman (1985),
    doi:10.1287/opre.33.5.1107. Cost: the cube of the number of states times log2(fastest rate * last time), for any
    number of times. Choose it for small chains with rates many decades apart, or for tiny probabilities to full
    relative accuracy.

    >>> from kinetics import Dense, Network, solve
    >>> steps = Network.from_text('''A -> B, 1
    ... B -> C, 1
    ... C -> D, 1''')
    >>> soon = solve(steps, Dense(), {"A": 1}, [1e-8])
    >>> f"{soon.probability({'D': 1})[0]:.9e}"  # t^3 / 6, less the part of order t^4
    '1.666666654e-25'
    """

    name: ClassVar[str] = "dense"
    tried_up_to: ClassVar[int | None] = CERTIFIED

    max_states: int = MAX_DENSE
    certified_states: int = CERTIFIED

    def probabilities(
        self, transitions: Transitions, start: Floats, grid: Floats, space: StateSpace | None = None
    ) -> ProbabilityTable:
        """Probabilities of all states."""
        n = transitions.size
        if n > self.max_states:
            raise ValueError(
                f"{n} states are too many for the dense method, which takes at most {self.max_states}; use the "
                f"method 'transient'"
            )
        check_memory(f"{n} states", 8.0 * n * (6 * n + grid.size), "ask for fewer times")
        rates = transitions.generator().toarray()
        np.fill_diagonal(rates, 0.0)
        found = exponential_action(rates, start, grid)
        if n > self.certified_states:
            return ProbabilityTable(found, estimated_error(rates, start, grid, found), False)
        entries = best_entries(transitions, space)
        return ProbabilityTable(found, distance(entries, start, grid, found), entries.is_certified)


def exponential_action(rates: Floats, start: Floats, times: Floats) -> Floats:
    """start @ exp(Q t) (T, N) at `times` (T,), each row summing to one.

    rates : (N, N) off the diagonal, which is 0
    start : (N,) probabilities
    """
    fastest = float(rates.sum(axis=1).max(initial=0.0))
    if fastest == 0.0 or times[-1] == 0.0:
        return np.tile(start, (times.size, 1))
    if not (fastest < LARGEST and times[-1] < LARGEST and times[times > 0][0] > 1 / LARGEST):
        raise ValueError(
            f"rates up to {fastest:.3g} at times from {times[0]:.3g} to {times[-1]:.3g} are beyond what "
            f"numbers hold; ask for times below {LARGEST:.0e} or lower the fastest rates"
        )
    return _by_squaring(rates, fastest, start, times, step_exponent(fastest, times))


def estimated_error(rates: Floats, start: Floats, times: Floats, result: Floats) -> float:
    """Estimate of the summed error of `exponential_action`: another unit of time rounds every product otherwise."""
    fastest = float(rates.sum(axis=1).max(initial=0.0))
    if fastest == 0.0 or times[-1] == 0.0:
        return 0.0
    exponent = step_exponent(fastest, times)
    other = _by_squaring(OTHER_UNIT * rates, OTHER_UNIT * fastest, start, times / OTHER_UNIT, exponent)
    seen = float(np.abs(result - other).sum(axis=1).max())
    return 4.0 * seen + 8.0 * ROUNDOFF * (log2(times[-1]) - exponent + TERMS)


def step_exponent(fastest: float, times: Floats) -> int:
    """k of the shortest step 2**k, so short that `TERMS` terms of its series suffice at every time.

    Cutting the series in each of S steps at M terms keeps of m uniformised jumps the share in which no step holds more
    than M of them, at least 1 - comb(m, M + 1) / S**M. That must be 1 to rounding for all m that a probability above
    1e-320 can need.
    """
    exponents = []
    for time in (times[times > 0][0], times[-1]):
        jumps = poisson_bounds(fastest * time, TINY)[1]
        # of log2: comb(jumps, M + 1) / S**M <= 2**-54
        needed = (log2(comb(jumps, TERMS + 1)) + 54) / TERMS
        exponents.append(floor(log2(time) - max(needed, log2(fastest * time))))
    return min(exponents)


def _by_squaring(rates: Floats, fastest: float, start: Floats, times: Floats, exponent: int) -> Floats:
    """Each time is a sum of powers of two: exactly so, because a double is. Powers below the step go by its series."""
    step = 2.0**exponent
    counts = [int(time / step) for time in times]
    rests = np.array([time - count * step for time, count in zip(times, counts, strict=True)])
    stays = (fastest - rates.sum(axis=1)) / fastest

    # The rest r of each time, below a step, by the Taylor series of exp((Q + q) r), whose terms are all positive; the
    # factor exp(-q r) cancels as rows are scaled to sum 1.
    rows = np.tile(start, (times.size, 1))
    term = rows.copy()
    for m in range(1, TERMS + 1):
        term = (term @ rates / fastest + term * stays) * (fastest * rests / m)[:, None]
        rows += term
    rows /= rows.sum(axis=1, keepdims=True)

    # Then binary powers: exp(Q 2**k h) by repeated squaring, applied to the times that have bit k.
    power = _short_step(rates * step, stays, fastest * step)
    for k in range(max(count.bit_length() for count in counts)):
        has_bit = np.array([bool(count >> k & 1) for count in counts])
        if has_bit.any():
            moved = rows[has_bit] @ power
            rows[has_bit] = moved / moved.sum(axis=1, keepdims=True)
        power = _stochastic(_product(power, power))
    return rows


def _short_step(rates: Floats, stays: Floats, x: float) -> Floats:
    """exp(Q h) by the series of exp(Q h + x) and exp(-x), x = q h; all terms positive. rates : Q h off the diagonal."""
    # Horner's scheme for the sum of (Q h + x)^m / m!, m = 1 to TERMS.
    positive = rates + np.diag(stays * x)
    total = positive / TERMS
    for m in range(TERMS - 1, 0, -1):
        np.fill_diagonal(total, total.diagonal() + 1.0)
        total = _product(positive, total) / m
    return _stochastic((total + np.eye(len(total))) * exp(-x))


def _product(one: Floats, other: Floats) -> Floats:
    """The product of two square matrices, during which Ctrl-C is heard."""
    if len(one) ** 3 < LONG:
        return np.asarray(one @ other)
    return np.asarray(heard(np.matmul, one, other))


def _stochastic(matrix: Floats) -> Floats:
    """Make the rows of a matrix sum to 1, in place: by their diagonal if that is large, else by scaling the row."""
    matrix[matrix < SMALLEST] = 0.0
    diagonal = matrix.diagonal().copy()
    np.fill_diagonal(matrix, 0.0)
    leaving = matrix.sum(axis=1)
    rests = leaving <= 0.5
    diagonal[rests] = 1.0 - leaving[rests]
    np.fill_diagonal(matrix, diagonal)
    matrix[~rests] /= (leaving + diagonal)[~rests, None]
    return matrix
