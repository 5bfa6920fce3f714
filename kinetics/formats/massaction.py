"""Recognition of mass action and of weighted sums of counts in formulas."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Mapping, Sequence, Set

import numpy as np

from kinetics.network.laws.expression import Expression
from kinetics.network.laws.graph import Code, Graph, Node
from kinetics.network.laws.program import evaluate, known_numbers, learn_numbers, steps_of

MOST_FACTORS = 1000  # of a product that is taken apart
MOST_NAMES = 30  # of a part that is tried out

Numbers = list[float | None]


def rate_constant(law: Expression, needed: Mapping[str, int]) -> tuple[float, dict[str, int]] | None:
    """k and the reactants of a law that is k times the sets of its reactants; None for any other law.

    needed : copies of each species that a firing takes

    k * A * B is one, and k * A * (A - 1) / 2, in any order, with any numbers as factors. A species that the law
    multiplies in but a firing does not take is a catalyst: a reactant that is given back. So the propensity is the same
    at every state, and below the copies that a firing takes it is 0 by itself.
    """
    known = known_numbers(law)
    factors = factors_of(law.formula, len(law.formula) - 1, MOST_FACTORS)
    constant = 1.0
    shifts: dict[str, list[int]] = {}
    for place, power in factors or [(0, 0)]:
        stepped = shifted(law.formula, known, place)
        if stepped is not None and power == 1:
            shifts.setdefault(stepped[0], []).append(stepped[1])
            continue
        value = known[place]
        if value is None or power == 0 or (value == 0 and power < 0):
            return None
        constant = constant * value if power > 0 else constant / value
    order = {name: len(found) for name, found in shifts.items()}
    if any(sorted(found) != list(range(len(found))) for found in shifts.values()):
        return None
    if any(order.get(name, 0) < copies for name, copies in needed.items()):
        return None
    try:
        k = constant * math.prod(math.factorial(copies) for copies in order.values())
    except OverflowError:
        return None  # of 171 copies and more: it stays a law
    return (k, order) if math.isfinite(k) and k >= 0 else None


def constant_formula(law: Expression) -> Expression:
    """The k of a law for which `rate_constant` finds one, as a formula of the law's parameters."""
    known = known_numbers(law)
    graph = Graph(most=20 * len(law.formula) + 100)
    copies = graph.copied(law.formula)
    whole = graph.number(1.0)
    order: Counter[str] = Counter()
    rest: list[tuple[int, int]] = []
    for place, power in factors_of(law.formula, len(law.formula) - 1, MOST_FACTORS) or []:
        stepped = shifted(law.formula, known, place)
        if stepped is not None and power == 1:
            order[stepped[0]] += 1
        else:
            rest.append((copies[place], power))
    sets = graph.number(float(math.prod(math.factorial(copies) for copies in order.values())))
    if (sets, -1) in rest:  # A (A - 1) / 2
        rest.remove((sets, -1))
        sets = graph.number(1.0)
    for place, power in (*rest, (sets, 1)):
        if power == -1 or not graph.is_known(place, 1.0):
            is_first = power == 1 and graph.is_known(whole, 1.0)
            code = Code.MULTIPLY if power == 1 else Code.DIVIDE
            whole = place if is_first else graph.add(code, (whole, place))
    formula = graph.formula(whole)
    read = {str(node.value) for node in formula if node.code == Code.COUNT}
    return Expression.of(formula, {name: value for name, value in law.parameters.items() if name in read})


def linear_weights(formula: Sequence[Node], species: Sequence[str]) -> dict[str, float] | None:
    """Weights of a formula that is a weighted sum of counts; None for any other formula.

    Sums and multiples are taken apart; a part that is neither is tried out at many states, if it reads few counts.
    """
    known: Numbers = []
    learn_numbers(formula, known)
    counted = set(species)
    weights: dict[str, float] = {}
    factors = [0.0] * len(formula)  # of each node in the whole
    factors[-1] = 1.0
    for place in range(len(factors) - 1, -1, -1):
        node, factor = formula[place], factors[place]
        if factor == 0.0 or known[place] == 0.0:
            continue
        if known[place] is None and str(node.value) in counted:
            weights[str(node.value)] = factor
            continue
        parts = _multiples(node, known) if known[place] is None else None
        if parts is None:
            names = [str(each.value) for each in formula if each.code == Code.COUNT]
            return _tried(Expression.of(formula), counted) if len(names) <= MOST_NAMES else None
        for part, times in parts:
            factors[part] += factor * times
    if not all(map(math.isfinite, weights.values())):
        return None
    return {name: weights[name] for name in (str(node.value) for node in formula) if name in weights}


def factors_of(formula: Sequence[Node], place: int, most: int) -> list[tuple[int, int]] | None:
    """The factors of a product, each with 1, or -1 below a division; None for over `most`."""
    factors: list[tuple[int, int]] = []
    waiting = [(place, 1)]
    while waiting:
        place, power = waiting.pop()
        code, parts, _ = formula[place]
        if code in (Code.MULTIPLY, Code.DIVIDE):
            waiting += [(parts[1], power if code == Code.MULTIPLY else -power), (parts[0], power)]
        else:
            factors.append((place, power))
        if len(factors) + len(waiting) > most:
            return None
    return factors


def shifted(formula: Sequence[Node], known: Sequence[float | None], place: int) -> tuple[str, int] | None:
    """Species and whole number i of a factor `A - i`; i is 0 for `A`."""
    total = 0
    while formula[place].code == Code.SUBTRACT:
        place, other = formula[place].parts
        less = known[other]
        if less is None or less != int(less):
            return None
        total += int(less)
    is_count = formula[place].code == Code.COUNT and known[place] is None
    return (str(formula[place].value), total) if is_count else None


def _multiples(node: Node, known: Numbers) -> list[tuple[int, float]] | None:
    """Parts whose multiples add up to a node; None if it is no such sum."""
    code, parts, _ = node
    if code in (Code.ADD, Code.SUBTRACT):
        return [(parts[0], 1.0), (parts[1], 1.0 if code == Code.ADD else -1.0)]
    if code == Code.NEGATE:
        return [(parts[0], -1.0)]
    if code in (Code.MULTIPLY, Code.DIVIDE):
        left, right = known[parts[0]], known[parts[1]]
        if right is not None and (code == Code.MULTIPLY or right != 0.0):
            return [(parts[0], right if code == Code.MULTIPLY else 1.0 / right)]
        if left is not None and code == Code.MULTIPLY:
            return [(parts[1], left)]
    return None


def _tried(formula: Expression, counted: Set[str]) -> dict[str, float] | None:
    """Weights that hold at many states, at which no simple other formula would have any."""
    if formula.reads_time or not counted >= set(formula.species):
        return None
    used = list(formula.species)
    steps = steps_of(formula, {name: s for s, name in enumerate(used)})
    units = np.concatenate([np.zeros((1, len(used)), dtype=np.int64), np.eye(len(used), dtype=np.int64)])
    found = evaluate(steps, units, 0.0)
    tried = np.random.default_rng(0).integers(0, 10**6, (16, len(used)))
    is_sum = found[0] == 0 and np.allclose(evaluate(steps, tried, 0.0), tried @ found[1:], rtol=1e-12, atol=0)
    return dict(zip(used, found[1:].tolist(), strict=True)) if is_sum else None
