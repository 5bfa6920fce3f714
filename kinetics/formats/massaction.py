"""Recognition of mass action and of weighted sums of counts in formulas."""

from __future__ import annotations

import ast
import math
from collections.abc import Mapping

import numpy as np

from kinetics.network.laws.expression import Expression, name_of
from kinetics.network.laws.program import evaluate, steps_of


def rate_constant(law: Expression, needed: Mapping[str, int]) -> tuple[float, dict[str, int]] | None:
    """k and the reactants of a law that is k times the sets of its reactants; None for any other law.

    needed : copies of each species that a firing takes

    k * A * B is one, and k * A * (A - 1) / 2, in any order, with any numbers as factors. A species that the law
    multiplies in but a firing does not take is a catalyst: a reactant that is given back. So the propensity is the same
    at every state, and below the copies that a firing takes it is 0 by itself.
    """
    try:
        factors: list[tuple[ast.expr, int]] = []
        flatten(law.tree, 1, factors)
    except RecursionError:
        return None
    constant = 1.0
    shifts: dict[str, list[int]] = {}
    for node, power in factors:
        stepped = shifted(node, law)
        if stepped is not None and power == 1:
            shifts.setdefault(stepped[0], []).append(stepped[1])
            continue
        value = _number(node, law)
        if value is None or (value == 0 and power < 0):
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


def linear_weights(formula: Expression, species: tuple[str, ...]) -> dict[str, float] | None:
    """Weights of a formula that is a weighted sum of counts; None for any other formula."""
    if formula.reads_time:
        return None
    place = {name: s for s, name in enumerate(species)}
    used = list(formula.species)
    steps = steps_of(formula, place)

    def values(states: np.ndarray) -> np.ndarray:
        return evaluate(steps, states, 0.0)

    units = np.zeros((len(used) + 1, len(species)), dtype=np.int64)
    units[np.arange(1, len(used) + 1), [place[name] for name in used]] = 1
    found = values(units)
    weights = found[1:]
    # Beyond the unit vectors, at states that no simple other formula would fit as well.
    tried = np.random.default_rng(0).integers(0, 10**6, (16, len(species)))
    expected = tried[:, [place[name] for name in used]] @ weights
    is_sum = found[0] == 0 and np.allclose(values(tried), expected, rtol=1e-12, atol=0)
    return dict(zip(used, weights.tolist(), strict=True)) if is_sum else None


def flatten(node: ast.expr, power: int, factors: list[tuple[ast.expr, int]]) -> None:
    """The factors of a product, each with 1, or -1 below a division."""
    if isinstance(node, ast.BinOp) and isinstance(node.op, ast.Mult | ast.Div):
        flatten(node.left, power, factors)
        flatten(node.right, power if isinstance(node.op, ast.Mult) else -power, factors)
    else:
        factors.append((node, power))


def shifted(node: ast.expr, law: Expression) -> tuple[str, int] | None:
    """Species and whole number i of a factor `A - i`; i is 0 for `A`."""
    if isinstance(node, ast.BinOp) and isinstance(node.op, ast.Sub):
        below = _number(node.right, law)
        inner = shifted(node.left, law) if below is not None and below == int(below) else None
        return None if inner is None or below is None else (inner[0], inner[1] + int(below))
    name = name_of(node)
    return (name, 0) if name is not None and name not in law.parameters else None


def _number(node: ast.expr, law: Expression) -> float | None:
    """The value of what depends neither on counts nor on time."""
    part = Expression(ast.unparse(node), law.parameters)
    if part.species or part.reads_time:
        return None
    value = float(evaluate(steps_of(part, {}), np.zeros(0, dtype=np.int64), 0.0))
    return value if math.isfinite(value) else None
