"""A stack machine for rate laws, conditions and new counts: it runs the programs of `network.laws.program`."""

from typing import NamedTuple

import numpy as np

from kinetics.kernels.compiled import compiled

# As in `network.laws.program.Code`
CONSTANT, COUNT, CLOCK, TIMES, GUARD, REFUSE, ADD, SUBTRACT, MULTIPLY, DIVIDE, MODULO, POWER = range(12)
LESS, LESS_EQUAL, EQUAL, NOT_EQUAL, AND, OR, MINIMUM, MAXIMUM = range(12, 20)
NEGATE, NOT, EXP, LOG, SQRT, ABSOLUTE, SINE, COSINE, FLOOR, CEILING, SELECT, KEEP, RECALL = range(20, 33)


class Programs(NamedTuple):
    """Programs one after the other: those of R channels, E conditions, A new counts.

    codes, operands (n,) int32, numbers (n,) : of each step, see `laws.program.Code`
    starts (R + E + A + 1,) : program p has the steps starts[p] to starts[p + 1]
    """

    codes: np.ndarray
    operands: np.ndarray
    numbers: np.ndarray
    starts: np.ndarray


@compiled
def of_one(code, x):
    """Apply one of the functions of one number, by its code."""
    if code == NEGATE:
        return -x
    if code == NOT:
        return 1.0 if x == 0.0 else 0.0
    if code == EXP:
        return np.exp(x)
    if code == LOG:
        return np.log(x)
    if code == SQRT:
        return np.sqrt(x)
    if code == ABSOLUTE:
        return abs(x)
    if code == SINE:
        return np.sin(x)
    if code == COSINE:
        return np.cos(x)
    return np.floor(x) if code == FLOOR else np.ceil(x)


@compiled
def of_two(code, x, y):
    """A function of two numbers; what is undefined stays so in the smaller and the larger of two."""
    if code == ADD:
        return x + y
    if code == SUBTRACT:
        return x - y
    if code == MULTIPLY:
        return x * y
    if code == DIVIDE:
        return x / y
    if code == MODULO:
        return np.mod(x, y)
    if code == POWER:
        return np.power(x, y)
    if code == MINIMUM:
        return x if x < y or np.isnan(x) else y
    if code == MAXIMUM:
        return x if x > y or np.isnan(x) else y
    if code == LESS:
        holds = x < y
    elif code == LESS_EQUAL:
        holds = x <= y
    elif code == EQUAL:
        holds = x == y
    elif code == NOT_EQUAL:
        holds = x != y
    elif code == AND:
        holds = x != 0.0 and y != 0.0
    else:
        holds = x != 0.0 or y != 0.0
    return 1.0 if holds else 0.0


@compiled
def values(programs, which, begin, end, counts, t, stack, results):
    """Write the results of the programs which[begin:end] at a moment."""
    codes, operands, numbers, starts = programs.codes, programs.operands, programs.numbers, programs.starts
    for i in range(begin, end):
        p = which[i]
        top = 0.0  # the last number of the stack; the others wait in stack[0]
        height = 0
        for step in range(starts[p], starts[p + 1]):
            code = codes[step]
            if code == TIMES:
                top *= counts[operands[step]] - numbers[step]
            elif code <= CLOCK:
                stack[0, height] = top
                height += 1
                top = t if code == CLOCK else numbers[step]
                if code == COUNT:
                    top = float(counts[operands[step]])
            elif code == GUARD:
                if counts[operands[step]] < numbers[step]:
                    top = 0.0
                    break
            elif code == REFUSE:
                if top > 0.0 and counts[operands[step]] < numbers[step]:
                    top = np.nan
            elif code == SELECT:
                height -= 2
                if stack[0, height + 1] != 0.0:
                    top = stack[0, height]
            elif code >= NEGATE:
                if code < SELECT:
                    top = of_one(code, top)
                elif code == KEEP:  # from the far end of the stack on
                    stack[0, -1 - operands[step]] = top
                else:
                    stack[0, height] = top
                    height += 1
                    top = stack[0, -1 - operands[step]]
            else:
                height -= 1
                top = of_two(code, stack[0, height], top)
        results[p] = top
