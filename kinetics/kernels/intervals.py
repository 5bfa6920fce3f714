"""Interval arithmetic for the stack machine: bounds over a stretch of time with the counts fixed, rounded outwards.

What a bound encloses is enclosed for certain; single numbers stay single. Moore (1966), Interval Analysis.
"""

import math

import numpy as np

from kinetics.kernels import programs as op
from kinetics.kernels.compiled import compiled
from kinetics.kernels.programs import of_one, of_two

LARGEST_ANGLE = 1e7  # beyond it, rounding takes too much of an angle
TINY = 5e-324


@compiled
def inflated(low, high, ulps):
    """The interval, larger by some units in the last place on both sides; all numbers where it is undefined."""
    if np.isnan(low) or np.isnan(high):
        return -np.inf, np.inf
    if abs(low) < np.inf:
        low -= abs(low) * (ulps * 2.0**-52) + TINY
    if abs(high) < np.inf:
        high += abs(high) * (ulps * 2.0**-52) + TINY
    return low, high


@compiled
def hull(a, b, c, d):
    """The smallest interval that holds four numbers; undefined where one is not finite."""
    odd = 0.0 * (a + b + c + d)
    return min(a, b, c, d) + odd, max(a, b, c, d) + odd


@compiled
def range_of_wave(code, low, high):
    """Sines or cosines of an interval."""
    if high - low >= 2.0 * math.pi or max(-low, high) > LARGEST_ANGLE:
        return -1.0, 1.0
    one, other = of_one(code, low), of_one(code, high)
    least, most = min(one, other), max(one, other)
    peak = 0.5 * math.pi if code == op.SINE else 0.0
    valley = peak + math.pi
    # Where rounding moves a peak just out of the interval, the ends are as high as it within what `inflated` adds.
    if peak + 2.0 * math.pi * np.ceil((low - peak) / (2.0 * math.pi)) <= high:
        most = 1.0
    if valley + 2.0 * math.pi * np.ceil((low - valley) / (2.0 * math.pi)) <= high:
        least = -1.0
    return inflated(least, most, 8.0)


@compiled
def range_of_one(code, low, high):
    """A function of the numbers between two. Single numbers stay single: what the machine finds there."""
    if low == high:
        value = of_one(code, low)
        return (-np.inf, np.inf) if np.isnan(value) else (value, value)
    if code == op.NEGATE:
        return -high, -low
    if code == op.NOT:
        return (1.0 if low == high == 0.0 else 0.0), (1.0 if low <= 0.0 <= high else 0.0)
    if code == op.ABSOLUTE:
        return max(low, -high, 0.0), max(-low, high)
    if code in (op.SINE, op.COSINE):
        return range_of_wave(code, low, high)
    if code in (op.LOG, op.SQRT) and low < 0.0:
        return -np.inf, np.inf
    least, most = of_one(code, low), of_one(code, high)  # these rise
    return (least, most) if code in (op.FLOOR, op.CEILING) else inflated(least, most, 8.0)


@compiled
def range_of_power(a, b, c, d):
    """x**y for x from a to b, y from c to d: monotonic in each, where x is not below 0 or y is one whole number."""
    if a >= 0.0:
        least, most = hull(np.power(a, c), np.power(a, d), np.power(b, c), np.power(b, d))
        return inflated(least, most, 8.0)
    if c != d or c != np.floor(c) or (c < 0.0 <= b):
        return -np.inf, np.inf
    one, other = np.power(a, c), np.power(b, c)
    is_even = np.mod(c, 2.0) == 0.0
    return inflated(0.0 if is_even and b > 0.0 and c > 0.0 else min(one, other), max(one, other), 8.0)


@compiled
def range_of_two(code, a, b, c, d):
    """A function of x from a to b and y from c to d. Single numbers stay single: what the machine finds there."""
    if a == b and c == d:
        value = of_two(code, a, c)
        return (-np.inf, np.inf) if np.isnan(value) else (value, value)
    if code == op.ADD:
        return inflated(a + c, b + d, 1.0)
    if code == op.SUBTRACT:
        return inflated(a - d, b - c, 1.0)
    if code == op.MULTIPLY:
        least, most = hull(a * c, a * d, b * c, b * d)
        return inflated(least, most, 1.0)
    if code == op.DIVIDE:
        if c <= 0.0 <= d:
            return -np.inf, np.inf
        least, most = hull(a / c, a / d, b / c, b / d)
        return inflated(least, most, 1.0)
    if code == op.MODULO:
        if not (c > 0.0 and d < np.inf):
            return -np.inf, np.inf
        first, last = np.mod(a, c), np.mod(b, c)
        return (first, last) if c == d and b - a < 0.5 * c and first <= last else (0.0, d)
    if code == op.POWER:
        return range_of_power(a, b, c, d)
    if code == op.MINIMUM:
        return min(a, c), min(b, d)
    if code == op.MAXIMUM:
        return max(a, c), max(b, d)
    if code == op.LESS:
        return (1.0 if b < c else 0.0), (1.0 if a < d else 0.0)
    if code == op.LESS_EQUAL:
        return (1.0 if b <= c else 0.0), (1.0 if a <= d else 0.0)
    if code == op.EQUAL:
        return 0.0, (1.0 if a <= d and c <= b else 0.0)
    if code == op.NOT_EQUAL:
        return (1.0 if b < c or d < a else 0.0), 1.0
    return (min(a, c), min(b, d)) if code == op.AND else (max(a, c), max(b, d))


@compiled
def ranges(programs, which, begin, end, counts, since, until, stack, lows, highs):
    """Write bounds of the results of the programs which[begin:end] at all moments of a stretch of time."""
    codes, operands, numbers, starts = programs.codes, programs.operands, programs.numbers, programs.starts
    for i in range(begin, end):
        p = which[i]
        low = high = 0.0  # the last interval of the stack, as in `values`
        height = 0
        for step in range(starts[p], starts[p + 1]):
            code = codes[step]
            if code <= op.CLOCK:
                stack[0, height], stack[1, height] = low, high
                height += 1
                if code == op.CLOCK:
                    low, high = since, until
                else:
                    low = numbers[step] if code == op.CONSTANT else float(counts[operands[step]])
                    high = low
            elif code == op.TIMES:
                factor = counts[operands[step]] - numbers[step]
                low, high = range_of_two(op.MULTIPLY, low, high, factor, factor)
            elif code == op.GUARD:
                if counts[operands[step]] < numbers[step]:
                    low = high = 0.0
                    break
            elif code == op.SELECT:
                height -= 2
                if stack[0, height + 1] == 1.0:
                    low, high = stack[0, height], stack[1, height]
                elif stack[1, height + 1] != 0.0:
                    low, high = min(low, stack[0, height]), max(high, stack[1, height])
            elif code >= op.NEGATE:
                if code < op.SELECT:
                    low, high = range_of_one(code, low, high)
                elif code == op.KEEP:
                    stack[0, -1 - operands[step]], stack[1, -1 - operands[step]] = low, high
                else:
                    stack[0, height], stack[1, height] = low, high
                    height += 1
                    low, high = stack[0, -1 - operands[step]], stack[1, -1 - operands[step]]
            elif code != op.REFUSE:  # which shows at a moment
                height -= 1
                low, high = range_of_two(code, stack[0, height], stack[1, height], low, high)
        lows[p], highs[p] = low, high
