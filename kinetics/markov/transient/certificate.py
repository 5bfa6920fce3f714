"""A proven bound on the error of a small chain's probabilities, from a second solution in fixed-point arithmetic.

The second solution is by scaling and squaring. Stochastic matrices do not enlarge errors: where two of them differ by d
in their largest row sum, their squares differ by at most 2 d. So s squarings with errors of 2**-w each end within
2**(s + 1 - w), whatever the rates: s bits more than a double has are enough. The error of cutting the series off is
bounded by its next term.

Ball arithmetic (python-flint 0.9, `arb_mat.exp`) proves the same in fewer lines, but took five to ten times as long on
chains of 84 and 297 states, at single times and at a hundred: its products of matrices are not by BLAS.
"""

from __future__ import annotations

from fractions import Fraction
from math import ceil, comb, factorial, log2
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from kinetics.markov.transient.fixedpoint import FixedPoint
from kinetics.markov.transient.poisson import ROUNDOFF
from kinetics.markov.transient.states import StateSpace
from kinetics.markov.transient.transitions import Transitions
from kinetics.network import Network
from kinetics.support.arrays import Floats

STEP_BITS = 16  # the largest row sum of |Q| h is at most 2**-16
RESULT_BITS = 66  # of what comes out; a double has 53
ABOVE = 1.01  # bounds are computed in doubles, and rounded up


class Entries(NamedTuple):
    """Rates from rows (K,) to columns (K,), 1/tu; entries of one place add up, exactly.

    rate_error : bound on the relative error of each, in roundings of 2**-53; inf if there is none
    """

    rows: NDArray[Any]
    columns: NDArray[Any]
    rates: Floats
    rate_error: float = 0.0

    @property
    def is_certified(self) -> bool:
        """True if the errors of the rates are bounded."""
        return bool(np.isfinite(self.rate_error))

    def wrong(self, jumps: float) -> float:
        """Bound on what errors of the rates add to the summed error of probabilities over an expected number of jumps.

        By Duhamel's formula, the integral of |p (Q - Q')|, in which each rate counts twice: in its row and its column.
        """
        return ABOVE * 2.0 * ROUNDOFF * self.rate_error * jumps if self.rate_error and self.is_certified else 0.0


def best_entries(transitions: Transitions, space: StateSpace | None) -> Entries:
    """Rates without rounding where a network gives them by mass action; else as they are, with their errors."""
    if space is None or space.network.laws:
        return Entries(transitions.rows, transitions.columns, transitions.rates, transitions.rate_error)
    return exact_entries(space)


def exact_entries(space: StateSpace) -> Entries:
    """Every rate of a space under mass action as doubles that add up to it, without rounding.

    Rate constants and ways are doubles and combinations whole numbers, so that their products are fractions.
    """
    network, states = space.network, space.states
    changes = network.sparse_stoichiometry
    is_exact = True
    propensities = network.propensities(states)
    propensities[space.is_stopped] = 0.0
    places: list[tuple[int, int]] = []
    values: list[float] = []
    for channel in np.flatnonzero(changes.has_entries).tolist():
        here = np.flatnonzero(propensities[:, channel] > 0)
        there = space.index_of(changes.added_to(states[here], np.full(here.size, channel)))
        for row, column in zip(here.tolist(), there.tolist(), strict=True):
            parts, rest = _parts(_rate(network, channel, states[row].tolist()))
            is_exact &= rest == 0
            places += [(row, column)] * len(parts)
            values += parts
    rows, columns = np.array(places, dtype=np.int64).reshape(-1, 2).T
    return Entries(rows, columns, np.array(values, dtype=np.float64), 0.0 if is_exact else np.inf)


def _rate(network: Network, channel: int, state: list[int]) -> Fraction:
    """Rate constant * ways * combinations of a channel in a state, exactly."""
    ways = 1
    for species, taken in zip(*(part.tolist() for part in network.sparse_reactants.row(channel)), strict=True):
        have = state[species]
        if network.combinations == "product":
            ways *= have**taken
        else:
            ways *= comb(have, taken) * (factorial(taken) if network.combinations == "ordered" else 1)
    return Fraction(float(network.known_rates[channel])) * Fraction(float(network.ways[channel])) * ways


def _parts(number: Fraction) -> tuple[tuple[float, ...], Fraction]:
    """Doubles, the nearest first, and what is left once the next would be too small for a double."""
    parts: list[float] = []
    while len(parts) < 2 or (number and parts[-1]):
        parts.append(float(number))
        number -= Fraction(parts[-1])
    return tuple(parts), number


def distance(entries: Entries, start: Floats, times: Floats, found: Floats) -> float:
    """Proven bound on the summed absolute error of `found` (T, N), at any of the times (T,).

    start : (N,) probabilities
    times : tu, rising; rates and times as far from the limits of doubles as `dense` checks

    Where the rates have errors, these count in each jump that is expected until the last time.
    """
    n = start.size
    if not entries.rates.any() or times[-1] == 0.0:
        return ABOVE * float(np.abs(found - start).sum(axis=1).max())
    arithmetic = FixedPoint.of(n + 1)
    exits = np.bincount(entries.rows, np.abs(entries.rates), minlength=n)
    exponent = -ceil(log2(2.0 * exits.max())) - STEP_BITS
    step = 2.0**exponent
    counts = [int(time / step) for time in times]  # exact, as are the rests: a step is a power of two
    rests = np.array([time - count * step for time, count in zip(times, counts, strict=True)]) / step
    levels = max(count.bit_length() for count in counts)
    most, least = (arithmetic.digits_for(RESULT_BITS + extra) for extra in (levels, 0))

    short, cut = short_rates(arithmetic, entries, step, n, most)
    terms = series_terms(arithmetic.lost(most))
    power = _series(arithmetic, short, terms, most)
    # A step of Horner's rule passes on 2**-16 of its error, and adds a product and a division.
    error = ABOVE * (cut + 3.0 * arithmetic.lost(most))

    rows = _rests(arithmetic, short, start, rests, terms, least)
    rows_error = ABOVE * (cut + (3.0 * terms + 2.0) * arithmetic.lost(least))
    # Jumps from each state in a step: a first, and after it at most 2**-17 on average, as many as of the fastest.
    jumps, worth = ABOVE * float(start @ exits) * step * np.ones(times.size), ABOVE * exits * step
    for level in range(levels):
        has_bit = np.array([bool(count >> level & 1) for count in counts])
        if has_bit.any():
            jumps[has_bit] += arithmetic.value(rows[:, has_bit]) @ worth
            rows[:, has_bit] = arithmetic.multiply(rows[:, has_bit], power, least)
            rows_error = rows_error * (1.0 + error) + error + arithmetic.lost(least)
        if level < levels - 1:
            digits = arithmetic.digits_for(RESULT_BITS + levels - level)
            before = power
            power = arithmetic.multiply(power, power, digits)
            error = 2.0 * error + error**2 + arithmetic.lost(digits)
            worth = worth + arithmetic.value(before) @ worth
    gap = arithmetic.digits(found, least + 3)
    gap[: least + 1] -= rows
    seen = float(np.abs(arithmetic.value(arithmetic.carry(gap))).sum(axis=1).max())
    # Errors of powers are sums over a row, and what they carry is at most the jumps of the fastest state.
    moved = float(jumps.max()) + (rows_error + levels * error) * float(exits.max()) * float(times[-1])
    return ABOVE * (seen + rows_error + arithmetic.lost(least)) + entries.wrong(ABOVE * moved)


def series_terms(lost: float) -> int:
    """How many terms of the series of a short step leave less than a product cuts off."""
    return next(m for m in range(1, 99) if 2.0 ** (-STEP_BITS * (m + 1)) / factorial(m + 1) < lost)


def exact_products(entries: Entries, factor: float) -> Entries:
    """The entries with all rates times a factor: each as two, its product and what that rounds off (Dekker 1971).

    doi:10.1007/BF01397083
    """
    (high, low), (one, two) = _halves(entries.rates), _halves(np.float64(factor))
    product = entries.rates * factor
    rest = low * two - (((product - high * one) - low * one) - high * two)
    rows, columns = (np.tile(each, 2) for each in entries[:2])
    return Entries(rows, columns, np.concatenate([product, rest]), entries.rate_error)


def _halves(values: Any) -> tuple[Any, Any]:
    """Each as a sum of two of half its digits."""
    large = values * (2.0**27 + 1.0)
    high = large - (large - values)
    return high, values - high


def short_rates(arithmetic: FixedPoint, entries: Entries, step: float, n: int, count: int) -> tuple[Floats, float]:
    """Q times the step, a power of two, as digits (count + 1, N, N), and a bound on the row sums of what is cut off."""
    places = entries.rows * n + entries.columns
    numbers = arithmetic.digits(entries.rates * step, count)
    planes = np.array([np.bincount(places, digit, minlength=n * n) for digit in numbers]).reshape(-1, n, n)
    diagonal = np.arange(n)
    planes[:, diagonal, diagonal] -= planes.sum(axis=2)
    longest = int(np.bincount(entries.rows, minlength=n).max())
    return arithmetic.carry(planes), 2.0 * longest * 2.0 ** (-arithmetic.bits * count)


def _series(arithmetic: FixedPoint, short: Floats, terms: int, count: int) -> Floats:
    """exp(Q h) from Q h, both as digits (count + 1, N, N), by Horner's rule."""
    power, diagonal = np.zeros_like(short), np.arange(short.shape[1])
    for m in range(terms, 0, -1):
        power[0, diagonal, diagonal] += 1.0
        power = arithmetic.divide(arithmetic.multiply(short, power, count), m)
    power[0, diagonal, diagonal] += 1.0
    return power


def _rests(arithmetic: FixedPoint, short: Floats, start: Floats, rests: Floats, terms: int, count: int) -> Floats:
    """start @ exp(Q h r) at every rest r (T,) below 1 of a step, as digits (count + 1, T, N)."""
    parts = arithmetic.digits(rests[:, None], count + 1)
    term = arithmetic.digits(np.tile(start, (rests.size, 1)), count)
    rows = term.copy()
    for m in range(1, terms + 1):
        moved = arithmetic.multiply(term, short, count)
        term = arithmetic.divide(arithmetic.multiply(moved, parts, count, by=np.multiply), m)
        rows += term
    return arithmetic.carry(rows)
