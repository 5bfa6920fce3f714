"""A condition on counts as the kernels read it, which end a run where it first holds."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from fractions import Fraction
from math import ceil, floor, inf, lcm
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from kinetics.kernels.ensemble_work import FAILS, HOLDS, Stop
from kinetics.network import Model, Network
from kinetics.network.laws.expression import Expression
from kinetics.network.laws.graph import Code, Graph, Node
from kinetics.network.laws.program import steps_of
from kinetics.network.predicates import Condition
from kinetics.support.arrays import Ints

Sum = dict[str, Fraction]  # weights by name; that of "" stands alone
LARGEST, LARGEST_LIMIT = 2**31, 2**53  # whole weight, and number that a sum is compared with: beyond, a program


def stop_at(until: str | Condition, network: Network, start: Ints) -> tuple[Stop, bool]:
    """The stop condition as kernels read it, and whether it holds at the start; a ValueError if it is no condition."""
    condition = until if isinstance(until, Condition) else Condition(until, Model(network, start))
    is_there = bool(condition.holds(start[None])[0])
    return _table(condition, network), is_there


def _table(condition: Condition, network: Network) -> Stop:
    """The table for kernels whose channels are those of the network.

    Comparisons of sums of counts, joined by and, or and not, become the table; any other condition becomes a program,
    which takes some 0.1 us where the table takes a few ns. A weight counts as the decimal number that it is written as.
    """
    formula, names = condition.formula(), condition.weights()
    rows = _compared(formula, names)
    if rows is None:
        return _with_program(condition, network)
    begins = np.cumsum([0, *(5 + 2 * len(row.weights) for row in rows)])
    table: list[float] = []
    for row in rows:
        leads = (float(begins[each]) if each >= 0 else each for each in (row.yes, row.no))
        terms = (number for term in row.weights.items() for number in term)
        table += [row.low, row.high, *leads, len(row.weights), *terms]
    species = np.array([s for row in rows for s in row.weights], dtype=np.int64)
    empty = (np.empty(0, kind) for kind in (np.int32, np.int32, float))
    return Stop._make([_changes_any(network, species), np.array(table, dtype=float), *empty])


class _Comparison(NamedTuple):
    """One comparison: whole weights by species, the range for their sum, and the places to go on at."""

    weights: dict[int, int]
    low: float
    high: float
    yes: int
    no: int


def _compared(formula: Sequence[Node], names: Mapping[str, dict[int, int]]) -> list[_Comparison] | None:
    """Comparisons in the order of the text; None if one is not of sums of counts.

    Each leads on as in an evaluation that ends where it is decided: the left part of an `and` to the right one if it
    holds, and beyond both if it does not.
    """
    sums = _sums(formula)
    sizes: list[int] = []  # comparisons in each node
    for code, parts, _ in formula:
        sizes.append(sum(sizes[part] for part in parts) if code in (Code.AND, Code.OR, Code.NOT) else 1)
    rows: dict[int, _Comparison] = {}
    waiting = [(len(formula) - 1, 0, HOLDS, FAILS)]
    while waiting:
        place, at, yes, no = waiting.pop()
        code, parts, _ = formula[place]
        if code == Code.NOT:
            waiting.append((parts[0], at, no, yes))
        elif code in (Code.AND, Code.OR):
            left, right = parts
            beyond = at + sizes[left]
            waiting.append((right, beyond, yes, no))
            waiting.append((left, at, beyond, no) if code == Code.AND else (left, at, yes, beyond))
        else:
            one, other = (sums[part] for part in parts)
            row = None if one is None or other is None else _row(code, _added(one, other, -1), names, yes, no)
            if row is None:
                return None
            rows[at] = row
    return [rows[at] for at in range(len(rows))]


def _row(code: Code, sum_: Sum, names: Mapping[str, dict[int, int]], yes: int, no: int) -> _Comparison | None:
    """The comparison of a sum with 0; None if whole weights would be too large."""
    weights: dict[int, Fraction] = {}
    for name, weight in sum_.items():
        for s, many in names[name].items() if name else ():
            weights[s] = weights.get(s, Fraction(0)) + weight * many
    scale = lcm(*(weight.denominator for weight in weights.values()))
    whole = {s: int(weight * scale) for s, weight in weights.items() if weight}
    limit = -sum_.get("", Fraction(0)) * scale
    if max(map(abs, whole.values()), default=0) > LARGEST or abs(limit) > LARGEST_LIMIT:
        return None
    if code == Code.LESS:
        return _Comparison(whole, -inf, ceil(limit) - 1, yes, no)
    if code == Code.LESS_EQUAL:
        return _Comparison(whole, -inf, floor(limit), yes, no)
    return _Comparison(whole, ceil(limit), floor(limit), *((yes, no) if code == Code.EQUAL else (no, yes)))


def _sums(formula: Sequence[Node]) -> list[Sum | None]:
    """Each node as a sum of counts with weights, and a number; None if it is none."""
    found: list[Sum | None] = []
    for code, parts, value in formula:
        made: Sum | None = None
        inner = [found[part] for part in parts]
        if code == Code.CONSTANT:
            made = {"": Fraction(repr(float(value)))}
        elif code == Code.COUNT:
            made = {str(value): Fraction(1)}
        elif None not in inner and code in (Code.ADD, Code.SUBTRACT, Code.NEGATE, Code.MULTIPLY, Code.DIVIDE):
            made = _combined(code, [part for part in inner if part is not None])
        found.append(made)
    return found


def _combined(code: Code, parts: Sequence[Sum]) -> Sum | None:
    if code == Code.NEGATE:
        return _scaled(parts[0], Fraction(-1))
    one, other = parts
    if code in (Code.ADD, Code.SUBTRACT):
        return _added(one, other, 1 if code == Code.ADD else -1)
    if code == Code.MULTIPLY and not other.keys() - {""}:
        return _scaled(one, other[""])
    if code == Code.MULTIPLY and not one.keys() - {""}:
        return _scaled(other, one[""])
    if code == Code.DIVIDE and not other.keys() - {""} and other[""]:
        return _scaled(one, 1 / other[""])
    return None


def _scaled(sum_: Sum, by: Fraction) -> Sum:
    return {name: by * weight for name, weight in sum_.items()}


def _added(one: Sum, other: Sum, sign: int) -> Sum:
    return {name: one.get(name, Fraction(0)) + sign * other.get(name, Fraction(0)) for name in {**one, **other}}


def _with_program(condition: Condition, network: Network) -> Stop:
    """A condition on other things than sums of counts, as a program; sums with names are written out in it."""
    graph = Graph()
    names = condition.weights()
    terms = {
        name: graph.all_of(
            Code.ADD,
            [
                graph.add(Code.MULTIPLY, (graph.number(weight), graph.name(network.species[s])))
                for s, weight in weights.items()
            ]
            or [graph.number(0.0)],
        )
        for name, weights in names.items()
        if name not in network.species_places
    }
    whole = graph.copied(condition.formula(), terms)[-1]
    expression = Expression.of(graph.formula(whole))
    steps = steps_of(expression, network.species_places)
    species = np.array([network.index(name) for name in expression.species], dtype=np.int64)
    columns = zip(*steps, strict=True)
    return Stop._make(
        [
            _changes_any(network, species),
            np.empty(0),
            *(np.array(column, kind) for column, kind in zip(columns, (np.int32, np.int32, float), strict=True)),
        ]
    )


def _changes_any(network: Network, species: Ints) -> NDArray[np.bool_]:
    """(R,) whether a firing changes the count of any of these species."""
    change = network.sparse_stoichiometry
    return np.bincount(change.rows, np.isin(change.columns, species), len(network.channels)) > 0
