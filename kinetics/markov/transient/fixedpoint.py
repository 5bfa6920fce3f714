"""Matrices in fixed-point arithmetic: digits that are whole numbers, multiplied by BLAS without rounding.

A number is the sum over d of digit[d] * 2**(-bits * d). Digits are doubles that hold whole numbers up to half the base,
so short that sums of their products stay below 2**53: whatever the order in which a library adds them, they are exact
(the error-free products of Ozaki et al. 2012, doi:10.1007/s11075-011-9478-1). Only what is cut off at the end is lost,
and that is known beforehand.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from math import log2
from typing import Any

import numpy as np

from kinetics.support.arrays import Floats

MAX_DIGITS = 40


@dataclass(frozen=True)
class FixedPoint:
    """Arithmetic on arrays of digits (D + 1, ...).

    size : longest sum in a matrix product
    bits : of a digit
    """

    size: int
    bits: int

    @classmethod
    def of(cls, size: int) -> FixedPoint:
        """Digits as long as sums of `size` products, MAX_DIGITS of them together, allow."""
        return cls(size, int((53 - log2(size * (MAX_DIGITS + 3))) / 2) + 1)

    def digits_for(self, bits: float) -> int:
        """D such that a product of matrices is right to 2**-bits in its largest row sum."""
        for count in range(1, MAX_DIGITS + 1):
            if self.lost(count) <= 2.0**-bits:
                return count
        raise ValueError(f"{bits:.0f} bits take more than {MAX_DIGITS} digits of {self.bits} bits each")

    def lost(self, count: int) -> float:
        """Bound on the largest row sum of what `multiply` to `count` digits cuts off, at most `size` numbers a row.

        The products of digits that together lie beyond one more digit than is kept, then that digit.
        """
        return self.size * (0.26 * self.size * (count + 3) + 0.51) * 2.0 ** (-self.bits * count)

    def digits(self, values: Floats, count: int) -> Floats:
        """Values (...) as digits (count + 1, ...), right to half a unit of the last one."""
        planes, rest = np.empty((count + 1, *values.shape)), np.asarray(values, dtype=float)
        for plane in planes:
            plane[...] = np.rint(rest)
            rest = (rest - plane) * 2.0**self.bits
        return planes

    def value(self, planes: Floats) -> Floats:
        """The nearest doubles (...), but for some roundings."""
        total = np.zeros(planes.shape[1:])
        for plane in planes[::-1]:
            total = total * 2.0**-self.bits + plane
        return total

    def carry(self, planes: Floats) -> Floats:
        """Carry digits, in place, until none but the first is beyond half the base."""
        for d in range(len(planes) - 1, 0, -1):
            over = np.rint(planes[d] * 2.0**-self.bits)
            planes[d] -= over * 2.0**self.bits
            planes[d - 1] += over
        return planes

    def multiply(self, left: Floats, right: Floats, count: int, by: Callable[..., Any] = np.matmul) -> Floats:
        """Product to `count` digits of two arrays of carried digits whose numbers are at most about 1."""
        planes = np.zeros((count + 2, *by(left[0], right[0]).shape))
        for d, one in enumerate(left[: count + 2]):
            if one.any():
                for e, other in enumerate(right[: count + 2 - d]):
                    planes[d + e] += by(one, other)
        return self.carry(planes)[:-1]

    def divide(self, planes: Floats, divisor: int) -> Floats:
        """Divide by a small whole number, in place, exact to a unit of the last digit."""
        rest: Floats = np.zeros(planes.shape[1:])
        for d, plane in enumerate(planes):
            whole = plane + rest * 2.0**self.bits
            planes[d] = np.rint(whole / divisor)
            rest = whole - planes[d] * divisor
        return self.carry(planes)
