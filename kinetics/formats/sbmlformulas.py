"""Formulas of ours as trees of libsbml, in what Level 3 Version 1 has."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from kinetics.network.laws.expression import Expression
from kinetics.network.laws.graph import TRUTHS, Code, Graph, Node
from kinetics.network.laws.reading import written
from kinetics.support.packages import libsbml

MOST_PARTS = 10_000  # of a tree, which libsbml walks by recursion
LOGIC = (Code.AND, Code.OR, Code.NOT)
KINDS = {  # names in libsbml
    Code.ADD: "PLUS",
    Code.SUBTRACT: "MINUS",
    Code.NEGATE: "MINUS",
    Code.MULTIPLY: "TIMES",
    Code.DIVIDE: "DIVIDE",
    Code.POWER: "POWER",
    Code.LESS: "RELATIONAL_LT",
    Code.LESS_EQUAL: "RELATIONAL_LEQ",
    Code.EQUAL: "RELATIONAL_EQ",
    Code.NOT_EQUAL: "RELATIONAL_NEQ",
    Code.AND: "LOGICAL_AND",
    Code.OR: "LOGICAL_OR",
    Code.NOT: "LOGICAL_NOT",
    Code.EXP: "FUNCTION_EXP",
    Code.LOG: "FUNCTION_LN",
    Code.SQRT: "FUNCTION_ROOT",
    Code.ABSOLUTE: "FUNCTION_ABS",
    Code.SINE: "FUNCTION_SIN",
    Code.COSINE: "FUNCTION_COS",
    Code.FLOOR: "FUNCTION_FLOOR",
    Code.CEILING: "FUNCTION_CEILING",
    Code.SELECT: "FUNCTION_PIECEWISE",
}
IN_PLACE = {  # of operations that Level 3 Version 1 does not have
    Code.MINIMUM: "piecewise(a, a <= b, b)",
    Code.MAXIMUM: "piecewise(a, b <= a, b)",
    Code.MODULO: "a - b * floor(a / b)",
}


def tree_of(formula: Expression, ids: Mapping[str, str], is_condition: bool = False) -> Any:
    """The tree of a formula, with numbers in place of parameters that have no id.

    ids : species or parameter -> its id in the file
    is_condition : whether it is to be true or false, not a number
    ValueError: the tree has over `MOST_PARTS` parts, since it repeats what the formula shares

    >>> import libsbml
    >>> from kinetics.network.laws import Expression
    >>> libsbml.formulaToL3String(tree_of(Expression("min(k * A, 5)", {"k": 2.0}), {"A": "A_1"}))
    'piecewise(2 * A_1, (2 * A_1) <= 5, 5)'
    """
    nodes = _in_sbml(formula.with_numbers(ids).formula, is_condition)
    sizes: list[int] = []
    made: list[Any] = []
    for node in nodes:
        sizes.append(1 + sum(sizes[part] for part in node.parts))
        if sizes[-1] > MOST_PARTS:
            raise ValueError(f"the formula {formula} has over {MOST_PARTS} parts in SBML; write it with fewer")
        made.append(_tree(node, ids))
        for part in node.parts:
            made[-1].addChild(made[part].deepCopy())
    return made[-1]


def _tree(node: Node, ids: Mapping[str, str]) -> Any:
    """The root of a tree, without its parts."""
    if node.code == Code.CONSTANT:
        tree = libsbml.ASTNode(libsbml.AST_REAL)
        tree.setValue(float(node.value))
    elif node.code == Code.COUNT:
        tree = libsbml.ASTNode(libsbml.AST_NAME)
        tree.setName(ids[str(node.value)])
    elif node.code == Code.CLOCK:
        tree = libsbml.ASTNode(libsbml.AST_NAME_TIME)
        tree.setName("time")
    else:
        tree = libsbml.ASTNode(getattr(libsbml, f"AST_{KINDS[node.code]}"))
    return tree


def _in_sbml(nodes: Sequence[Node], is_condition: bool) -> tuple[Node, ...]:
    """A formula by the operations that there are, with truths where SBML has truths and numbers where numbers."""
    graph = Graph(most=20 * len(nodes) + 100)
    places: list[int] = []
    for node in nodes:
        wanted = [node.code in LOGIC or (node.code == Code.SELECT and i == 1) for i in range(len(node.parts))]
        parts = [_as(graph, places[part], truth) for part, truth in zip(node.parts, wanted, strict=True)]
        if node.code in IN_PLACE:
            a, b = parts
            places.append(written(IN_PLACE[node.code], graph, a=a, b=b))
        else:
            places.append(graph.add(node.code, parts, node.value))
    return graph.formula(_as(graph, places[-1], is_condition))


def _as(graph: Graph, place: int, is_truth: bool) -> int:
    """A node as a truth, or as a number."""
    if (graph.nodes[place].code in TRUTHS) == is_truth:
        return place
    if is_truth:
        return graph.add(Code.NOT_EQUAL, (place, graph.number(0.0)))
    return graph.add(Code.SELECT, (graph.number(1.0), place, graph.number(0.0)))
