"""The two directions of a net rate law: parts that are never below 0, the first minus the second.

Signs come from interval arithmetic over all counts of at least 0 and all times from 0 on, so "never" is proven; where
it cannot be, that is said. Moore (1966), Interval Analysis.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence

import numpy as np

from kinetics.formats.massaction import factors_of, shifted
from kinetics.network.laws.expression import Expression
from kinetics.network.laws.graph import TRUTHS, Code, Graph
from kinetics.network.laws.program import evaluate, known_numbers, steps_of
from kinetics.support.arrays import Floats

Bounds = tuple[float, float]
Parts = tuple[int | None, int | None]

EVERYTHING = (-math.inf, math.inf)
POSITIVE = (0.0, math.inf)
WAVE = (-1.0, 1.0)
MOST_FACTORS = 100  # of a product whose factors are looked at together
TRIED = 2000  # states, at each of these times
TIMES = (0.0, 0.7, 10.0, 1000.0)


def is_never_below_0(law: Expression, least: Mapping[str, int]) -> bool:
    """Whether a law is proven to be at least 0 wherever there are `least` copies of each species, at t >= 0."""
    return bounds_of(law, least)[-1][0] >= 0


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


def bounds_of(law: Expression, least: Mapping[str, int]) -> list[Bounds]:
    """Least and largest value of each node of a law, if there are `least` copies of each species."""
    formula, known = law.formula, known_numbers(law)
    bounds: list[Bounds] = []
    for place, (code, parts, value) in enumerate(formula):
        number, inner = known[place], [bounds[part] for part in parts]
        if number is not None:
            bounds.append((number, number))
        elif code == Code.COUNT:
            bounds.append((float(least.get(str(value), 0)), math.inf))
        elif code in (Code.MULTIPLY, Code.DIVIDE):
            factors = factors_of(formula, place, MOST_FACTORS)
            together = factors and _product(law, known, bounds, factors)
            bounds.append(together or _times(inner[0], inner[1] if code == Code.MULTIPLY else _inverse(inner[1])))
        else:
            bounds.append(_of_other(code, inner))
    return bounds


def directions_of(law: Expression) -> tuple[Expression | None, Expression | None] | None:
    """Two parts that are proven to be at least 0 and whose difference is the law; None if its form shows none.

    A part that is 0 everywhere is None. Sums are taken apart, also inside products, quotients and pieces:
    V * (kf * A - kr * B) / (1 + A) gives V * kf * A / (1 + A) and V * kr * B / (1 + A).
    """
    graph = Graph(most=20 * len(law.formula) + 100)
    found = _Directions(law, graph).whole()
    if found is None:
        return None
    made = [None if part is None else Expression.of(graph.formula(part), law.parameters) for part in found]
    return made[0], made[1]


class _Directions:
    """The two parts of every node of one law, as nodes of a graph."""

    def __init__(self, law: Expression, graph: Graph):
        self.formula, self.graph = law.formula, graph
        self.bounds = bounds_of(law, {})
        self.copies = graph.copied(law.formula)
        self.found: list[Parts | None] = []

    def whole(self) -> Parts | None:
        for place in range(len(self.formula)):
            self.found.append(self._parts(place))
        return self.found[-1]

    def _parts(self, place: int) -> Parts | None:
        """Two parts of at least 0 each whose difference is the node; None if there are none to be seen."""
        low, high = self.bounds[place]
        if low >= 0:
            return None if low == high == 0 else self.copies[place], None
        if high <= 0:
            return None, self._negative(place)
        code, parts, _ = self.formula[place]
        if code == Code.NEGATE:
            inner = self.found[parts[0]]
            return inner and (inner[1], inner[0])
        if code == Code.DIVIDE:
            return self._quotient(*parts)
        if code not in (Code.ADD, Code.SUBTRACT, Code.MULTIPLY, Code.SELECT):
            return None
        left, right = self.found[parts[0]], self.found[parts[2 if code == Code.SELECT else 1]]
        if left is None or right is None:
            return None
        if code == Code.MULTIPLY:
            return (
                self._sum(self._both(code, left[0], right[0]), self._both(code, left[1], right[1])),
                self._sum(self._both(code, left[0], right[1]), self._both(code, left[1], right[0])),
            )
        if code == Code.SELECT:
            condition = self.copies[parts[1]]
            return self._piece(left[0], condition, right[0]), self._piece(left[1], condition, right[1])
        more, less = right if code == Code.ADD else (right[1], right[0])
        return self._sum(left[0], more), self._sum(left[1], less)

    def _quotient(self, above: int, below: int) -> Parts | None:
        left, (low, high) = self.found[above], self.bounds[below]
        if left is None or low < 0 < high:
            return None
        more, less = left if low >= 0 else (left[1], left[0])
        divisor = self.copies[below] if low >= 0 else self._negative(below)
        return self._both(Code.DIVIDE, more, divisor), self._both(Code.DIVIDE, less, divisor)

    def _negative(self, place: int) -> int:
        """Minus a node, as a factor, so that mass action is still recognised."""
        return self.graph.add(Code.MULTIPLY, (self.graph.number(-1.0), self.copies[place]))

    def _both(self, code: Code, one: int | None, other: int | None) -> int | None:
        return None if one is None or other is None else self.graph.add(code, (one, other))

    def _sum(self, one: int | None, other: int | None) -> int | None:
        return other if one is None else one if other is None else self.graph.add(Code.ADD, (one, other))

    def _piece(self, value: int | None, condition: int, other: int | None) -> int | None:
        if value is None and other is None:
            return None
        value, other = (self.graph.number(0.0) if each is None else each for each in (value, other))
        return self.graph.add(Code.SELECT, (value, condition, other))


def _product(
    law: Expression, known: Sequence[float | None], bounds: Sequence[Bounds], factors: list[tuple[int, int]]
) -> Bounds:
    """Factors of one species, A (A - 1) (A - 2) say, are at least 0 together: counts are whole."""
    steps: dict[str, list[tuple[int, int]]] = {}
    found = (1.0, 1.0)
    for factor, power in factors:
        stepped = shifted(law.formula, known, factor) if power > 0 else None
        if stepped is not None:
            steps.setdefault(stepped[0], []).append((stepped[1], factor))
            continue
        found = _times(found, bounds[factor] if power > 0 else _inverse(bounds[factor]))
    for each in steps.values():
        if sorted(step for step, _ in each) == list(range(len(each))):
            found = _times(found, POSITIVE)
            continue
        for _, factor in each:
            found = _times(found, bounds[factor])
    return found


def _of_other(code: Code, inner: list[Bounds]) -> Bounds:
    if code in TRUTHS:
        return 0.0, 0.0 if code == Code.AND and (0.0, 0.0) in inner else 1.0
    match code, inner:
        case Code.CLOCK, _:
            return POSITIVE
        case Code.NEGATE, [(low, high)]:
            return -high, -low
        case Code.ADD, [(a, b), (c, d)]:
            return _known(a + c, b + d)
        case Code.SUBTRACT, [(a, b), (c, d)]:
            return _known(a - d, b - c)
        case Code.MODULO, [_, (c, d)]:
            return (0.0, d) if c > 0 else EVERYTHING  # with the sign of the divisor
        case Code.POWER, [(low, _), (c, d)]:
            is_even = c == d and c % 2 == 0
            return POSITIVE if low >= 0 or is_even else EVERYTHING
        case Code.SELECT, [one, (low, high), other] if low == high:
            return one if low else other
        case Code.SELECT, [(a, b), _, (c, d)]:
            return min(a, c), max(b, d)
        case Code.MINIMUM, [(a, b), (c, d)]:
            return min(a, c), min(b, d)
        case Code.MAXIMUM, [(a, b), (c, d)]:
            return max(a, c), max(b, d)
        case ((Code.EXP | Code.SQRT | Code.ABSOLUTE), _):
            return POSITIVE
        case ((Code.SINE | Code.COSINE), _):
            return WAVE
        case ((Code.FLOOR | Code.CEILING), [(low, high)]):
            return math.floor(low) if math.isfinite(low) else low, high + 1
        case Code.LOG, [(low, _)]:
            return math.log(low) if low > 0 else -math.inf, math.inf
    return EVERYTHING


def _times(one: Bounds, other: Bounds) -> Bounds:
    products = [0.0 if 0 in (a, b) else a * b for a in one for b in other]  # an infinite bound is of finite numbers
    return min(products), max(products)


def _inverse(bounds: Bounds) -> Bounds:
    """1 / x, if that is finite."""
    low, high = bounds
    if low < 0 < high:
        return EVERYTHING
    return (1 / high if high else -math.inf, 1 / low if low else math.inf)


def _known(low: float, high: float) -> Bounds:
    return (-math.inf if math.isnan(low) else low, math.inf if math.isnan(high) else high)
