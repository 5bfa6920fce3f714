"""Rate laws compiled for a stack machine: an operation code, an operand and a number for each step.

One machine in `kernels.general` runs them event by event and over stretches of time; `evaluate` runs them here, over
arrays of states.
"""

from __future__ import annotations

import ast
import math
from collections.abc import Iterable, Mapping
from enum import IntEnum
from functools import reduce
from typing import NamedTuple

import numpy as np

from kinetics.network.laws.expression import PI, TIME, Expression, is_condition, name_of
from kinetics.support.arrays import Floats, Ints

MOST_STEPS = 50_000  # of a program with comparisons


class Code(IntEnum):
    """What a step does to the stack. `kernels.general` has the same numbers."""

    CONSTANT = 0  # push the number
    COUNT = 1  # push the count of species number `operand`
    CLOCK = 2  # push the time
    TIMES = 3  # multiply by that count less the number: the factor of mass action
    GUARD = 4  # end with 0 where there are fewer copies than the number
    REFUSE = 5  # what is above 0 becomes nan where there are fewer copies than the number
    ADD = 6
    SUBTRACT = 7
    MULTIPLY = 8
    DIVIDE = 9
    MODULO = 10
    POWER = 11
    LESS = 12
    LESS_EQUAL = 13
    EQUAL = 14
    NOT_EQUAL = 15
    AND = 16
    OR = 17
    MINIMUM = 18
    MAXIMUM = 19
    NEGATE = 20
    NOT = 21
    EXP = 22
    LOG = 23
    SQRT = 24
    ABSOLUTE = 25
    SINE = 26
    COSINE = 27
    FLOOR = 28
    CEILING = 29
    SELECT = 30  # of value, condition and other value


class Step(NamedTuple):
    """One step of a program."""

    code: Code
    operand: int = 0
    number: float = 0.0


BINARY = {
    ast.Add: Code.ADD,
    ast.Sub: Code.SUBTRACT,
    ast.Mult: Code.MULTIPLY,
    ast.Div: Code.DIVIDE,
    ast.Mod: Code.MODULO,
    ast.Pow: Code.POWER,
}
# The other two are these with their sides exchanged.
COMPARE = {ast.Lt: Code.LESS, ast.LtE: Code.LESS_EQUAL, ast.Eq: Code.EQUAL, ast.NotEq: Code.NOT_EQUAL}
MIRRORED = {ast.Gt: Code.LESS, ast.GtE: Code.LESS_EQUAL}
CALLS = {
    "exp": Code.EXP,
    "log": Code.LOG,
    "sqrt": Code.SQRT,
    "abs": Code.ABSOLUTE,
    "sin": Code.SINE,
    "cos": Code.COSINE,
    "floor": Code.FLOOR,
    "ceil": Code.CEILING,
    "pow": Code.POWER,
    "min": Code.MINIMUM,
    "max": Code.MAXIMUM,
}
UFUNCS = {
    Code.ADD: np.add,
    Code.SUBTRACT: np.subtract,
    Code.MULTIPLY: np.multiply,
    Code.DIVIDE: np.divide,
    Code.MODULO: np.mod,
    Code.POWER: np.power,
    Code.LESS: np.less,
    Code.LESS_EQUAL: np.less_equal,
    Code.EQUAL: np.equal,
    Code.NOT_EQUAL: np.not_equal,
    Code.AND: np.logical_and,
    Code.OR: np.logical_or,
    Code.MINIMUM: np.minimum,
    Code.MAXIMUM: np.maximum,
    Code.NEGATE: np.negative,
    Code.NOT: np.logical_not,
    Code.EXP: np.exp,
    Code.LOG: np.log,
    Code.SQRT: np.sqrt,
    Code.ABSOLUTE: np.abs,
    Code.SINE: np.sin,
    Code.COSINE: np.cos,
    Code.FLOOR: np.floor,
    Code.CEILING: np.ceil,
}


def steps_of(expression: Expression, places: Mapping[str, int], folds: bool = True) -> list[Step]:
    """The program of an expression.

    places : number of each species
    folds : whether what depends on nothing is the number that it is found to be, rounded
    """
    expression.check_names("expression", places)
    try:
        return _steps(expression.tree, expression.parameters, places, folds)
    except RecursionError:
        raise ValueError(f"{expression.text[:80]!r}... is nested too deeply; write it with fewer terms") from None


def _steps(node: ast.expr, parameters: Mapping[str, float], places: Mapping[str, int], folds: bool) -> list[Step]:
    def inner(child: ast.expr) -> list[Step]:
        return _steps(child, parameters, places, folds)

    def whole(steps: list[Step]) -> list[Step]:
        return _folded(steps) if folds else steps

    def binary(code: Code, one: list[Step], other: list[Step]) -> list[Step]:
        return _times(code, one, other) or whole([*one, *other, Step(code)])

    def truth(child: ast.expr) -> list[Step]:
        steps = inner(child)
        return steps if is_condition(child) else [*steps, Step(Code.CONSTANT), Step(Code.NOT_EQUAL)]

    name = name_of(node)
    if name is not None:
        is_number = name in parameters
        return [Step(Code.CONSTANT, 0, parameters[name]) if is_number else Step(Code.COUNT, places[name])]
    match node:
        case ast.Constant(value=value):
            return [Step(Code.CONSTANT, 0, float(value))]  # type: ignore[arg-type]  # names were dealt with
        case ast.Name(id=reserved):
            return [Step(Code.CLOCK) if reserved == TIME else Step(Code.CONSTANT, 0, {PI: math.pi}[reserved])]
        case ast.BinOp(left=left, op=op, right=right):
            return binary(BINARY[type(op)], inner(left), inner(right))
        case ast.UnaryOp(op=ast.Not(), operand=operand):
            return [*truth(operand), Step(Code.NOT)]
        case ast.UnaryOp(op=ast.UAdd(), operand=operand):
            return inner(operand)
        case ast.UnaryOp(operand=operand):
            return whole([*inner(operand), Step(Code.NEGATE)])
        case ast.BoolOp(op=op, values=values):
            code = Code.AND if isinstance(op, ast.And) else Code.OR
            return reduce(lambda one, other: [*one, *other, Step(code)], map(truth, values))
        case ast.Compare(left=left, ops=ops, comparators=others):
            sides = [inner(side) for side in (left, *others)]
            if sum(map(len, sides)) > MOST_STEPS:
                raise ValueError(
                    f"comparisons within each other grow to over {MOST_STEPS} steps, as the middle of a < b < c counts "
                    f"twice; write them with `and`"
                )
            pairs = [
                [*a, *b, Step(COMPARE[type(op)])] if type(op) in COMPARE else [*b, *a, Step(MIRRORED[type(op)])]
                for a, b, op in zip(sides[:-1], sides[1:], ops, strict=True)
            ]
            return reduce(lambda one, other: [*one, *other, Step(Code.AND)], pairs)
        case ast.Call(func=ast.Name(id="piecewise"), args=arguments):
            steps = inner(arguments[-1])
            for chosen, condition in zip(arguments[-3::-2], arguments[-2::-2], strict=True):
                steps = [*inner(chosen), *truth(condition), *steps, Step(Code.SELECT)]
            return steps
        case ast.Call(func=ast.Name(id=function), args=arguments):
            code = CALLS[function]
            if len(arguments) == 1:
                return whole([*inner(arguments[0]), Step(code)])
            return reduce(lambda one, other: binary(code, one, other), map(inner, arguments))
    raise AssertionError(f"an expression let through {node!r}")


def _times(code: Code, left: list[Step], right: list[Step]) -> list[Step]:
    """A product with a count, or a count less a number, in one step; empty where it is none."""
    if code == Code.MULTIPLY and right[0].code == Code.COUNT:
        species = right[0].operand
        if len(right) == 1:
            return [*left, Step(Code.TIMES, species)]
        if len(right) == 3 and right[1].code == Code.CONSTANT and right[2].code == Code.SUBTRACT:
            return [*left, Step(Code.TIMES, species, right[1].number)]
    return []


def _folded(steps: list[Step]) -> list[Step]:
    """What depends on nothing, as the number it is, where it is one."""
    if any(step.code != Code.CONSTANT for step in steps[:-1]):
        return steps
    number = float(evaluate(steps, np.zeros(0, dtype=np.int64), 0.0))
    return [Step(Code.CONSTANT, 0, number)] if math.isfinite(number) else steps


def evaluate(steps: Iterable[Step], states: Ints, time: float) -> Floats:
    """Values (...) of a program at states (..., S) and a time. What is undefined is nan or inf."""
    shape = states.shape[:-1]
    stack: list[Floats] = []
    ends = np.zeros(shape, dtype=bool)  # where a guard found too few copies
    with np.errstate(all="ignore"):
        for code, operand, number in steps:
            if code == Code.CONSTANT:
                stack.append(np.full(shape, number))
            elif code == Code.CLOCK:
                stack.append(np.full(shape, time))
            elif code == Code.COUNT:
                stack.append(states[..., operand].astype(np.float64))
            elif code == Code.TIMES:
                stack[-1] = stack[-1] * (states[..., operand].astype(np.float64) - number)
            elif code == Code.GUARD:
                ends |= states[..., operand] < number
            elif code == Code.REFUSE:
                stack[-1] = np.where((states[..., operand] < number) & (stack[-1] > 0), np.nan, stack[-1])
            elif code == Code.SELECT:
                other, condition, value = stack.pop(), stack.pop(), stack.pop()
                stack.append(np.where(condition != 0, value, other))
            elif code >= Code.NEGATE:
                stack.append(UFUNCS[code](stack.pop()).astype(np.float64))
            else:
                right, left = stack.pop(), stack.pop()
                stack.append(UFUNCS[code](left, right).astype(np.float64))
    return np.where(ends, 0.0, stack[-1])


def depth(steps: Iterable[Step]) -> int:
    """Most numbers that a program has on the stack."""
    height = deepest = 0
    for step in steps:
        if step.code in (Code.CONSTANT, Code.COUNT, Code.CLOCK):
            height += 1
        elif step.code == Code.SELECT:
            height -= 2
        elif Code.ADD <= step.code <= Code.MAXIMUM:
            height -= 1
        deepest = max(deepest, height)
    return deepest
