"""The two directions of a net rate law: parts that are never below 0, the first minus the second.

Signs come from interval arithmetic over all counts of at least 0 and all times from 0 on, so "never" is proven; where
it cannot be, that is said. Moore (1966), Interval Analysis.
"""

from __future__ import annotations

import ast
import math
from collections.abc import Collection, Iterable, Iterator, Mapping

import numpy as np

from kinetics.formats.massaction import flatten, shifted
from kinetics.network.laws.expression import PI, TIME, Expression, is_condition, name_of
from kinetics.network.laws.program import evaluate, steps_of
from kinetics.support.arrays import Floats

Bounds = tuple[float, float]
Parts = tuple[ast.expr | None, ast.expr | None]

EVERYTHING = (-math.inf, math.inf)
POSITIVE = (0.0, math.inf)
WAVE = (-1.0, 1.0)
TRIED = 2000  # states, at each of these times
TIMES = (0.0, 0.7, 10.0, 1000.0)


def is_never_below_0(law: Expression, least: Mapping[str, int]) -> bool:
    """Whether a law is proven to be at least 0 wherever there are `least` copies of each species, at t >= 0."""
    return _Signs(law, least).of(law.tree)[0] >= 0


def is_seen_below_0(law: Expression) -> bool:
    """Whether a law is below 0 at one of many states, with counts up to a million, some of them 0."""
    return any(bool(np.any(values < 0)) for values in _tried(law, ()))


def is_0_without(law: Expression, species: Iterable[str]) -> bool:
    """Whether a law is 0 at many states in which one of these species, each in turn, is missing."""
    return all(bool(np.all(values == 0)) for name in species for values in _tried(law, (name,)))


def _tried(law: Expression, missing: Collection[str]) -> Iterator[Floats]:
    """Values at many states, some species missing, at some times."""
    rng = np.random.default_rng(0)
    places = {name: s for s, name in enumerate(law.species)}
    states = np.floor(10.0 ** rng.uniform(-1, 6, (TRIED, len(places)))).astype(np.int64)
    states[:, [places[name] for name in missing if name in places]] = 0
    steps = steps_of(law, places)
    for time in TIMES if law.reads_time else TIMES[:1]:
        yield evaluate(steps, states, time)


def directions_of(law: Expression) -> tuple[Expression | None, Expression | None] | None:
    """Two parts that are proven to be at least 0 and whose difference is the law; None where its form shows none.

    A part that is 0 everywhere is None. Sums are taken apart, also inside products, quotients and pieces:
    V * (kf * A - kr * B) / (1 + A) gives V * kf * A / (1 + A) and V * kr * B / (1 + A).
    """
    found = _Signs(law, {}).parts(law.tree)
    if found is None:
        return None
    made = [None if part is None else Expression(ast.unparse(part), law.parameters) for part in found]
    return made[0], made[1]


class _Signs:
    """Bounds of the parts of one law, where there are `least` copies of each species."""

    def __init__(self, law: Expression, least: Mapping[str, int]):
        self.law, self.least = law, least

    def of(self, node: ast.expr) -> Bounds:
        """Least and largest value."""
        name = name_of(node)
        if name is not None:
            value = self.law.parameters.get(name)
            return (float(self.least.get(name, 0)), math.inf) if value is None else (value, value)
        match node:
            case ast.Constant(value=number):
                return float(number), float(number)  # type: ignore[arg-type]  # names were dealt with
            case ast.Name(id=reserved):
                return POSITIVE if reserved == TIME else {PI: (math.pi, math.pi)}[reserved]
            case ast.BinOp(op=ast.Mult() | ast.Div()):
                return self._product(node)
            case ast.BinOp(left=left, op=op, right=right):
                return self._sum_or_power(op, left, right)
            case ast.UnaryOp(op=ast.USub(), operand=operand):
                low, high = self.of(operand)
                return -high, -low
            case ast.UnaryOp(op=ast.UAdd(), operand=operand):
                return self.of(operand)
            case ast.Call(func=ast.Name(id=function), args=arguments):
                return self._call(function, arguments)
        return (0.0, 1.0) if is_condition(node) else EVERYTHING

    def parts(self, node: ast.expr) -> Parts | None:
        """Two parts of at least 0 each whose difference is the node; None where there are none to be seen."""
        low, high = self.of(node)
        if low >= 0:
            return None if low == high == 0 else node, None
        if high <= 0:
            return None, _negative(node)
        match node:
            case ast.UnaryOp(op=ast.USub(), operand=operand):
                inner = self.parts(operand)
                return inner and (inner[1], inner[0])
            case ast.UnaryOp(op=ast.UAdd(), operand=operand):
                return self.parts(operand)
            case ast.BinOp(op=ast.Add() | ast.Sub() | ast.Mult() | ast.Div()):
                return self._parts_of_two(node)
            case ast.Call(func=ast.Name(id="piecewise"), args=arguments):
                found = [self.parts(value) for value in arguments[::2]]
                sides = [[each[i] for each in found if each is not None] for i in (0, 1)]
                if any(each is None for each in found):
                    return None
                return _pieces(sides[0], arguments[1::2]), _pieces(sides[1], arguments[1::2])
        return None

    def _parts_of_two(self, node: ast.BinOp) -> Parts | None:
        left = self.parts(node.left)
        if isinstance(node.op, ast.Div):
            low, high = self.of(node.right)
            if left is None or low < 0 < high:
                return None
            more, less = left if low >= 0 else (left[1], left[0])
            below = node.right if low >= 0 else _negative(node.right)
            return _both(ast.Div(), more, below), _both(ast.Div(), less, below)
        right = self.parts(node.right)
        if left is None or right is None:
            return None
        if isinstance(node.op, ast.Mult):
            return (
                _sum(_both(ast.Mult(), left[0], right[0]), _both(ast.Mult(), left[1], right[1])),
                _sum(_both(ast.Mult(), left[0], right[1]), _both(ast.Mult(), left[1], right[0])),
            )
        more, less = right if isinstance(node.op, ast.Add) else (right[1], right[0])
        return _sum(left[0], more), _sum(left[1], less)

    def _product(self, node: ast.expr) -> Bounds:
        """Factors of one species, A (A - 1) (A - 2) say, are at least 0 together: counts are whole."""
        factors: list[tuple[ast.expr, int]] = []
        flatten(node, 1, factors)
        steps: dict[str, list[tuple[int, ast.expr]]] = {}
        bounds = (1.0, 1.0)
        for factor, power in factors:
            stepped = shifted(factor, self.law) if power > 0 else None
            if stepped is not None:
                steps.setdefault(stepped[0], []).append((stepped[1], factor))
                continue
            bounds = _times(bounds, self.of(factor) if power > 0 else _inverse(self.of(factor)))
        for found in steps.values():
            if sorted(step for step, _ in found) == list(range(len(found))):
                bounds = _times(bounds, POSITIVE)
                continue
            for _, factor in found:
                bounds = _times(bounds, self.of(factor))
        return bounds

    def _sum_or_power(self, op: ast.operator, left: ast.expr, right: ast.expr) -> Bounds:
        (a, b), (c, d) = self.of(left), self.of(right)
        if isinstance(op, ast.Add):
            return _known(a + c, b + d)
        if isinstance(op, ast.Sub):
            return _known(a - d, b - c)
        if isinstance(op, ast.Mod):
            return (0.0, d) if c > 0 else EVERYTHING  # with the sign of the divisor
        return _power(a, c, d)

    def _call(self, function: str, arguments: list[ast.expr]) -> Bounds:
        if function == "piecewise":
            lows, highs = zip(*(self.of(value) for value in arguments[::2]), strict=True)
            return min(lows), max(highs)
        bounds = [self.of(argument) for argument in arguments]
        low, high = bounds[0]
        match function:
            case "exp" | "sqrt" | "abs":
                return POSITIVE
            case "sin" | "cos":
                return WAVE
            case "floor" | "ceil":
                return math.floor(low) if low > -math.inf else low, high + 1
            case "log":
                return math.log(low) if low > 0 else -math.inf, math.inf
            case "min":
                return min(each[0] for each in bounds), min(each[1] for each in bounds)
            case "max":
                return max(each[0] for each in bounds), max(each[1] for each in bounds)
        return _power(low, *bounds[1])


def _power(least: float, c: float, d: float) -> Bounds:
    """x ** y for x of at least `least`, y from c to d."""
    is_even = c == d and c % 2 == 0
    return POSITIVE if least >= 0 or is_even else EVERYTHING


def _times(one: Bounds, other: Bounds) -> Bounds:
    products = [0.0 if 0 in (a, b) else a * b for a in one for b in other]  # an infinite bound is of finite numbers
    return min(products), max(products)


def _inverse(bounds: Bounds) -> Bounds:
    """1 / x, where that is finite."""
    low, high = bounds
    if low < 0 < high:
        return EVERYTHING
    return (1 / high if high else -math.inf, 1 / low if low else math.inf)


def _known(low: float, high: float) -> Bounds:
    return (-math.inf if math.isnan(low) else low, math.inf if math.isnan(high) else high)


def _negative(node: ast.expr) -> ast.expr:
    """As a factor, so that mass action is still seen."""
    return ast.BinOp(ast.UnaryOp(ast.USub(), ast.Constant(1.0)), ast.Mult(), node)


def _both(op: ast.operator, one: ast.expr | None, other: ast.expr | None) -> ast.expr | None:
    return None if one is None or other is None else ast.BinOp(one, op, other)


def _sum(one: ast.expr | None, other: ast.expr | None) -> ast.expr | None:
    return other if one is None else one if other is None else ast.BinOp(one, ast.Add(), other)


def _pieces(values: list[ast.expr | None], conditions: list[ast.expr]) -> ast.expr | None:
    if all(value is None for value in values):
        return None
    arguments = [ast.Constant(0.0) if value is None else value for value in values]
    for place, condition in enumerate(conditions):
        arguments.insert(2 * place + 1, condition)
    return ast.Call(ast.Name("piecewise"), arguments, [])
