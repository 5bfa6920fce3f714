"""Rate laws enclosed between two numbers: interval arithmetic over arrays of states, every operation rounded outwards.

Enclosed is the real value of an expression; its constants, parameters and pi are the doubles that they were read as. A
sum, product, quotient or root is known to half a unit in the last place, and where an error-free transformation shows
that it is exact it stays as it is (Ogita, Rump & Oishi 2005, doi:10.1137/030601818). Functions of the library are taken
to be right to `LIBRARY_ULPS`: numpy states 4 for its own, the GNU C library 1 for exp, log, pow, sin and cos. What may
be undefined is nan. Moore (1966), Interval Analysis. `kernels.intervals`, for sampling, bounds what the machine finds
over a stretch of time instead.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from functools import reduce
from typing import Any, NamedTuple

import numpy as np

from kinetics.network.laws.graph import Code
from kinetics.network.laws.program import UFUNCS, Step
from kinetics.support.arrays import Ints

LIBRARY_ULPS = 4.0
TINY = 5e-324
SMALL = 1e-250  # of products; below, what they lose may be lost itself
LARGEST_WHOLE = 2**53  # up to which every count is a double
LARGEST_ANGLE = 1e7  # beyond it, rounding takes too much of an angle
SPLIT = 2.0**27 + 1.0
EXACT_AT = {Code.EXP: 0.0, Code.LOG: 1.0, Code.SINE: 0.0, Code.COSINE: 0.0}


class Interval(NamedTuple):
    """Lower and upper bounds (...) of a value; the same array twice if it is known exactly."""

    low: Any
    high: Any

    @property
    def is_point(self) -> bool:
        """Whether it is known."""
        return self.low is self.high


def enclosed(steps: Iterable[Step], states: Ints) -> Interval:
    """Bounds (...) on the real value of a program at states (..., S); nan if it may be undefined."""
    stack: list[Interval] = []
    kept: dict[int, Interval] = {}
    ends = np.zeros(states.shape[:-1], dtype=bool)  # where a guard found too few copies
    with np.errstate(all="ignore"):
        for code, operand, number in steps:
            if code == Code.CONSTANT:
                stack.append(_point(np.float64(number)))
            elif code == Code.CLOCK:
                stack.append(_point(np.float64(np.nan)))
            elif code == Code.COUNT:
                stack.append(_count(states[..., operand]))
            elif code == Code.TIMES:
                less = _sum(_count(states[..., operand]), _point(np.float64(-number)))
                stack[-1] = _product(stack[-1], less)
            elif code == Code.GUARD:
                ends |= states[..., operand] < number
            elif code == Code.SELECT:
                other, condition, value = stack.pop(), stack.pop(), stack.pop()
                stack.append(enclosed_by(code, value, condition, other))
            elif code == Code.KEEP:
                kept[operand] = stack[-1]
            elif code == Code.RECALL:
                stack.append(kept[operand])
            elif code >= Code.NEGATE:
                stack.append(enclosed_by(code, stack.pop()))
            elif code != Code.REFUSE:  # which shows in the value itself
                right, left = stack.pop(), stack.pop()
                stack.append(enclosed_by(code, left, right))
    low, high = (np.where(ends, 0.0, bound) for bound in stack[-1])
    return Interval(low, high)


def enclosed_by(code: Code, *parts: Interval) -> Interval:
    """Bounds (...) on the real value of one operation on parts with these bounds."""
    if code == Code.SELECT:
        return _selected(*parts)
    if len(parts) == 1:
        return _of_one(code, parts[0])
    return OF_TWO[code](*parts) if code in OF_TWO else _compared(code, *parts)


def _point(values: Any) -> Interval:
    return Interval(values, values)


def _count(copies: Ints) -> Interval:
    values = copies.astype(np.float64)
    return _outwards(values, 1.0) if copies.max(initial=0) > LARGEST_WHOLE else _point(values)


def _outwards(values: Any, ulps: float) -> Interval:
    wide = np.abs(values) * (ulps * 2.0**-52) + TINY
    return Interval(values - wide, values + wide)


def _rounded(low: Any, high: Any, low_lost: Any, high_lost: Any) -> Interval:
    """Ends rounded outwards, unless what they lost, exact end minus end, lies within; nan if that is not known."""
    if low is high and np.all(low_lost == 0.0):
        return _point(low)
    inner_low, inner_high = low_lost >= 0.0, high_lost <= 0.0
    return Interval(
        np.where(inner_low, low, np.nextafter(low, -np.inf)), np.where(inner_high, high, np.nextafter(high, np.inf))
    )


def _added(x: Any, y: Any) -> tuple[Any, Any]:
    """The sum of two numbers, and its rounding error (Knuth's TwoSum)."""
    found = x + y
    part = found - x
    return found, (x - (found - part)) + (y - part)


def _multiplied(x: Any, y: Any) -> tuple[Any, Any]:
    """The product of two numbers, and its rounding error (Dekker's TwoProduct); nan if that may underflow."""
    found = x * y
    (above, below), (over, under) = _split(x), _split(y)
    lost = below * under - (((found - above * over) - below * over) - above * under)
    return found, np.where((np.abs(found) > SMALL) | (x == 0.0) | (y == 0.0), lost, np.nan)


def _split(x: Any) -> tuple[Any, Any]:
    wide = SPLIT * x
    above = wide - (wide - x)
    return above, x - above


def _divided(x: Any, y: Any) -> tuple[Any, Any]:
    """The quotient of two numbers, and a number with the sign of its rounding error."""
    found = x / y
    back, lost = _multiplied(found, y)
    return found, np.where(x == 0.0, 0.0, ((x - back) - lost) * np.sign(y))


def _exactly(found: tuple[Any, Any]) -> Interval:
    return _rounded(found[0], found[0], found[1], found[1])


def _between(least: tuple[Any, Any], most: tuple[Any, Any]) -> Interval:
    return _rounded(least[0], most[0], least[1], most[1])


def _sum(x: Interval, y: Interval) -> Interval:
    least = _added(x.low, y.low)
    return _exactly(least) if x.is_point and y.is_point else _between(least, _added(x.high, y.high))


def _difference(x: Interval, y: Interval) -> Interval:
    return _sum(x, _negated(y))


def _negated(x: Interval) -> Interval:
    return _point(-x.low) if x.is_point else Interval(-x.high, -x.low)


def _product(x: Interval, y: Interval) -> Interval:
    if x.is_point and y.is_point:
        return _exactly(_multiplied(x.low, y.low))
    if np.all(x.low >= 0.0) and np.all(y.low >= 0.0):
        return _between(_multiplied(x.low, y.low), _multiplied(x.high, y.high))
    return _hull(_exactly(_multiplied(one, other)) for one in x for other in y)


def _quotient(x: Interval, y: Interval) -> Interval:
    if x.is_point and y.is_point:
        return _exactly(_divided(x.low, np.where(y.low == 0.0, np.nan, y.low)))
    if np.all(x.low >= 0.0) and np.all(y.low > 0.0):
        return _between(_divided(x.low, y.high), _divided(x.high, y.low))
    found = _hull(_exactly(_divided(one, other)) for one in x for other in y)
    is_right = (y.low > 0.0) | (y.high < 0.0)
    return Interval(np.where(is_right, found.low, np.nan), np.where(is_right, found.high, np.nan))


def _hull(corners: Iterable[Interval]) -> Interval:
    """From the least to the largest of all: of a function that is monotonic in each of two numbers, in its corners."""
    lows, highs = zip(*corners, strict=True)
    return Interval(reduce(np.minimum, lows), reduce(np.maximum, highs))


def _power(x: Interval, y: Interval) -> Interval:
    """x**y, monotonic in each where x is not below 0; else only of known numbers."""
    is_positive = x.low >= 0.0
    if y.is_point and np.ndim(y.low) == 0 and y.low in (1.0, 2.0, 3.0, 4.0) and (x.is_point or np.all(is_positive)):
        # products are known better than powers
        square = x if y.low == 1.0 else _product(x, x)
        return square if y.low <= 2.0 else _product(square, x if y.low == 3.0 else square)
    if x.is_point and y.is_point:
        return _raised(x.low, y.low)
    low, high = _hull(_raised(base, exponent) for base in x for exponent in y)
    return Interval(np.where(is_positive, np.maximum(low, 0.0), np.nan), np.where(is_positive, high, np.nan))


def _raised(x: Any, y: Any) -> Interval:
    found = np.power(x, y)
    low, high = _outwards(found, LIBRARY_ULPS)
    is_exact = (x == 0.0) | (x == 1.0) | (y == 0.0)
    return Interval(np.where(is_exact, found, low), np.where(is_exact, found, high))


def _remainder(x: Interval, y: Interval) -> Interval:
    """From 0 to y, and less where x crosses no multiple of a known y."""
    low, high = np.mod(x.low, y.low), np.mod(x.high, y.low)
    is_same = (y.low == y.high) & (x.high - x.low < 0.5 * y.low) & (low <= high)
    is_exact = x.low >= 0.0  # else the machine adds y, and rounds
    low = np.where(is_exact, low, np.maximum(np.nextafter(low, -np.inf), 0.0))
    high = np.where(is_exact, high, np.nextafter(high, np.inf))
    is_right = y.low > 0.0
    return Interval(
        np.where(is_right, np.where(is_same, low, 0.0), np.nan),
        np.where(is_right, np.where(is_same, high, y.high), np.nan),
    )


def _least(x: Interval, y: Interval) -> Interval:
    return Interval(np.minimum(x.low, y.low), np.minimum(x.high, y.high))


def _largest(x: Interval, y: Interval) -> Interval:
    return Interval(np.maximum(x.low, y.low), np.maximum(x.high, y.high))


OF_TWO: dict[Code, Callable[[Interval, Interval], Interval]] = {
    Code.ADD: _sum,
    Code.SUBTRACT: _difference,
    Code.MULTIPLY: _product,
    Code.DIVIDE: _quotient,
    Code.POWER: _power,
    Code.MODULO: _remainder,
    Code.MINIMUM: _least,
    Code.MAXIMUM: _largest,
    Code.AND: _least,  # of truths, which are 0 or 1
    Code.OR: _largest,
}


def _compared(code: Code, x: Interval, y: Interval) -> Interval:
    """[1, 1] if a comparison certainly holds, [0, 0] if it certainly does not, else [0, 1]."""
    if code == Code.LESS:
        return _truth(x.high < y.low, x.low >= y.high)
    if code == Code.LESS_EQUAL:
        return _truth(x.high <= y.low, x.low > y.high)
    equal = (x.low == y.high) & (x.high == y.low)
    apart = (x.high < y.low) | (y.high < x.low)
    return _truth(equal, apart) if code == Code.EQUAL else _truth(apart, equal)


def _truth(holds: Any, fails: Any) -> Interval:
    return Interval(np.where(holds, 1.0, 0.0), np.where(fails, 0.0, 1.0))


def _selected(value: Interval, condition: Interval, other: Interval) -> Interval:
    holds, fails = condition.low == 1.0, condition.high == 0.0
    low, high = np.minimum(value.low, other.low), np.maximum(value.high, other.high)
    return Interval(
        np.where(holds, value.low, np.where(fails, other.low, low)),
        np.where(holds, value.high, np.where(fails, other.high, high)),
    )


def _of_one(code: Code, x: Interval) -> Interval:
    if code == Code.NEGATE:
        return _negated(x)
    if code == Code.NOT:
        return _truth((x.low == 0.0) & (x.high == 0.0), (x.low > 0.0) | (x.high < 0.0))
    if code == Code.ABSOLUTE:
        return Interval(np.maximum(np.maximum(x.low, -x.high), 0.0), np.maximum(-x.low, x.high))
    if code in (Code.FLOOR, Code.CEILING):  # both whole numbers where a jump lies between
        return Interval(UFUNCS[code](x.low), UFUNCS[code](x.high))
    if code == Code.SQRT:
        return _root(x)
    if code in (Code.SINE, Code.COSINE):
        return _wave(code, x)
    low, high = (_by_library(code, end) for end in x)
    if code == Code.EXP:
        return Interval(np.maximum(low.low, 0.0), high.high)
    is_right = x.low > 0.0
    return Interval(np.where(is_right, low.low, np.nan), np.where(is_right, high.high, np.nan))


def _by_library(code: Code, x: Any) -> Interval:
    found = UFUNCS[code](x)
    low, high = _outwards(found, LIBRARY_ULPS)
    is_exact = x == EXACT_AT[code]
    return Interval(np.where(is_exact, found, low), np.where(is_exact, found, high))


def _root(x: Interval) -> Interval:
    ends = []
    for square in x:
        found = np.sqrt(np.where(x.low < 0.0, np.nan, square))
        back, lost = _multiplied(found, found)
        ends.append((found, (square - back) - lost))  # of the sign of what rounding lost
    return _between(*ends)


def _wave(code: Code, x: Interval) -> Interval:
    """Sines or cosines: as `kernels.intervals.range_of_wave`."""
    one, other = (_by_library(code, end) for end in x)
    low, high = np.minimum(one.low, other.low), np.maximum(one.high, other.high)
    if not x.is_point:
        # Where rounding moves a peak just out of the interval, the ends are as high as it within what was added.
        turn, peak = 2.0 * np.pi, 0.5 * np.pi if code == Code.SINE else 0.0
        valley = peak + np.pi
        high = np.where(peak + turn * np.ceil((x.low - peak) / turn) <= x.high, 1.0, high)
        low = np.where(valley + turn * np.ceil((x.low - valley) / turn) <= x.high, -1.0, low)
    is_far = np.maximum(-x.low, x.high) > LARGEST_ANGLE
    return Interval(np.where(is_far, -1.0, np.maximum(low, -1.0)), np.where(is_far, 1.0, np.minimum(high, 1.0)))
