"""The defect u' - u Q of a polynomial u in fixed-point arithmetic: it bounds the error of u, however u was found.

The distance of u from the solution of dp/dt = p Q, summed over the states, grows by no more than the integral of
|u' - u Q|, because exp(Q t) enlarges no such sum. Doubles know the defect only to 2**-53 of the fastest rate; in fixed
point (`kinetics.markov.transient.fixedpoint`) what is cut off is known and as small as is wanted.
"""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction
from math import ceil, floor, log2
from typing import Any, NamedTuple

import numpy as np

from kinetics.markov.transient.certificate import ABOVE, Entries
from kinetics.markov.transient.fixedpoint import FixedPoint
from kinetics.markov.transient.poisson import ROUNDOFF
from kinetics.markov.transient.radau import radau_tables
from kinetics.support.arrays import Floats
from kinetics.support.packages import sparse

LARGEST = 8.0  # coefficients; beyond, whole parts would be no digits. Those of probabilities are below sqrt(2 s + 1)
SPARE_BITS = 16  # by which what is cut off lies below the tolerance


class Defect(NamedTuple):
    """The defect of a polynomial on one step.

    coefficients : (N, s + 1) of u' - u Q h / 2, by Legendre polynomials on [-1, 1]; to a double's accuracy
    jump : (N,) u at the start minus what it should be there; likewise
    bound : proven bound on the error that both add within the step, summed over states
    """

    coefficients: Floats
    jump: Floats
    bound: float


@dataclass(frozen=True, eq=False)
class FixedPointChain:
    """A chain in fixed-point arithmetic; polynomials are digits (count + 1, N, s + 1) of their coefficients.

    count : digits behind the point
    scale : e; rates are held in units of 2**e, in which no exit rate is above 1/2. Steps are at least 2**(2 - e) long
    rates : digits of Q transposed, a list of count + 1 csr_array (N, N)
    cut : bound on the largest row sum of what these leave of Q, in units of 2**e
    """

    arithmetic: FixedPoint
    count: int
    scale: int
    rates: Any
    cut: float

    @classmethod
    def of(cls, entries: Entries, n: int, longest: float, tolerance: float) -> FixedPointChain:
        """A defect with so many digits that truncation in steps up to `longest`, tu, is far below the tolerance."""
        arithmetic = FixedPoint.of(n + 1)
        exits = exit_rates(entries, n)
        scale = max(ceil(log2(2.0 * float(exits.max()))), 2 - floor(log2(longest)))
        terms = int(np.bincount(entries.rows, minlength=n).max())
        count = arithmetic.digits_for(max(log2(longest) + scale, 0.0) - log2(tolerance) + log2(terms) + SPARE_BITS)
        numbers = arithmetic.digits(np.ldexp(entries.rates, -scale), count)
        # The diagonal is made of the digits, so that mass is kept to the last one.
        leaving = np.array([np.bincount(entries.rows, digit, minlength=n) for digit in numbers])
        diagonal = np.arange(n)
        places = np.append(entries.columns, diagonal), np.append(entries.rows, diagonal)
        planes = [sparse.csr_array((values, places), shape=(n, n)) for values in np.append(numbers, -leaving, axis=1)]
        rates = arithmetic.carry(np.array([plane.data for plane in planes]))
        for plane, values in zip(planes, rates, strict=True):
            plane.data = values
        return cls(arithmetic, count, scale, planes, 2.0 * terms * 2.0 ** (-arithmetic.bits * count))

    def digits(self, values: Floats) -> Floats:
        """Values (...) as digits (count + 1, ...)."""
        return self.arithmetic.digits(values, self.count)

    def values(self, planes: Floats) -> Floats:
        """Digits (count + 1, ...) as doubles (...), which are as near as doubles come, but for two roundings."""
        return self.arithmetic.value(planes)

    def constant(self, state: Floats, degree: int) -> Floats:
        """The polynomial that stays at the digits (count + 1, N)."""
        planes = np.zeros((*state.shape, degree + 1))
        planes[:, :, 0] = state
        return planes

    def plus(self, planes: Floats, correction: Floats) -> Floats:
        """A polynomial and coefficients (N, s + 1) together."""
        return self.arithmetic.carry(planes + self.digits(correction))

    def end(self, planes: Floats) -> Floats:
        """Digits (count + 1, N) of a polynomial at the end of its step."""
        return self.arithmetic.carry(planes.sum(axis=2))

    def defect(self, planes: Floats, start: Floats, length: Fraction) -> Defect:
        """The defect of a polynomial that should begin at the digits `start` (count + 1, N).

        length : of the step, tu, a power of two of at least 2**(2 - e)
        """
        arithmetic, bits, size = self.arithmetic, self.arithmetic.bits, planes.shape[2]
        if not np.abs(planes[0]).max() <= LARGEST:
            return Defect(np.zeros(planes.shape[1:]), np.zeros(planes.shape[1]), np.inf)
        jump = self.values(arithmetic.carry(planes @ (-1.0) ** np.arange(size) - start))
        # u' / 2**m - u Q / 2**e, where 2**m is h / 2 in units of 2**-e: u' is moved by m bits, whole digits and a part.
        m = round(log2(length / 2)) + self.scale
        whole, part = divmod(m, bits)
        slopes = arithmetic.carry(planes @ radau_tables(size - 1).derivative.T)
        rest = np.zeros((self.count + whole + 2, *planes.shape[1:]))
        rest[whole + 1 :] = slopes * 2.0 ** (bits - part)
        # u Q, plane by plane of digits; only now is the difference rounded to doubles.
        rest[: self.count + 1] -= arithmetic.multiply(planes, self.rates, self.count, by=_flows)
        coefficients = self.values(arithmetic.carry(rest)) * 2.0**m
        sizes = np.abs(self.values(planes)).sum(axis=0)
        # |u(t) - p(t)| is at most |jump| plus the integral of |u' - u Q|, as exp(Q t) enlarges no sum of absolute
        # values. The digits cut off in the product count as defect.
        lost = 2.0**m * (arithmetic.lost(self.count) + self.cut * sizes)
        bound = integrals_of(size) @ (np.abs(coefficients).sum(axis=0) + lost) + np.abs(jump).sum()
        return Defect(coefficients, jump, ABOVE * float(bound))


def exit_rates(entries: Entries, n: int) -> Floats:
    """Rate (n,) at which each state is left, 1/tu, rounded."""
    return np.bincount(entries.rows, entries.rates, minlength=n).astype(float)


def integrals_of(size: int) -> Floats:
    """Bounds (size,) on the integral of |P_k| over [-1, 1], 2 / sqrt(2 k + 1) by Cauchy & Schwarz."""
    return np.asarray(2.0 / np.sqrt(2.0 * np.arange(size) + 1.0))


def value_at(coefficients: Floats, place: Fraction) -> tuple[Floats, float]:
    """Values (N,) at a place in [-1, 1] of polynomials (N, s + 1), and a bound on how all of this rounds, summed."""
    weights = np.array([float(weight) for weight in legendre(place, coefficients.shape[1] - 1)])
    return coefficients @ weights, (weights.size + 8.0) * ROUNDOFF * float(np.abs(coefficients).sum())


def legendre(x: Fraction, degree: int) -> list[Fraction]:
    """The Legendre polynomials P_0(x), ..., P_degree(x), in exact fractions."""
    values = [Fraction(1), x]
    for k in range(2, degree + 1):
        values.append(((2 * k - 1) * x * values[-1] - (k - 1) * values[-2]) / k)
    return values[: degree + 1]


def _flows(digits: Floats, rates: Any) -> Floats:
    return np.asarray(rates @ digits)
