"""The operators, functions and constants of SBML formulas, each as nodes of a graph."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from functools import cache
from itertools import pairwise

from kinetics.formats.functions import MADE_OF_OTHERS
from kinetics.network.laws.graph import Code, Graph
from kinetics.network.laws.reading import written
from kinetics.support.packages import libsbml

MADE = {
    **{f"AST_FUNCTION_{name.upper()}": name for name in ("tan", "cot", "sec", "csc", "sinh", "cosh", "tanh")},
    **{f"AST_FUNCTION_{name.upper()}": name for name in ("coth", "sech", "csch")},
    **{f"AST_FUNCTION_ARC{name.upper()}": f"a{name}" for name in ("sinh", "cosh", "tanh")},
}
QUOTIENT = "piecewise(floor(a / b), 0 <= a / b, ceil(a / b))"  # without its fraction
AVOGADRO = 6.02214179e23  # as SBML Level 3 has it

Build = Callable[[Graph, Sequence[int]], int | None]


@cache
def builders() -> dict[int, Build]:
    """Kind of libsbml -> what makes its node of those of its parts; None if there are too many or too few."""
    return {
        libsbml.AST_NAME_AVOGADRO: lambda graph, _: graph.number(AVOGADRO),
        libsbml.AST_CONSTANT_PI: lambda graph, _: graph.number(math.pi),
        libsbml.AST_CONSTANT_E: lambda graph, _: graph.add(Code.EXP, (graph.number(1.0),)),
        libsbml.AST_CONSTANT_TRUE: lambda graph, _: truth(graph, True),
        libsbml.AST_CONSTANT_FALSE: lambda graph, _: truth(graph, False),
        libsbml.AST_PLUS: lambda graph, inner: graph.all_of(Code.ADD, inner or [graph.number(0.0)]),
        libsbml.AST_TIMES: lambda graph, inner: graph.all_of(Code.MULTIPLY, inner or [graph.number(1.0)]),
        libsbml.AST_LOGICAL_AND: lambda graph, inner: graph.all_of(Code.AND, inner or [truth(graph, True)]),
        libsbml.AST_LOGICAL_OR: lambda graph, inner: graph.all_of(Code.OR, inner or [truth(graph, False)]),
        libsbml.AST_RELATIONAL_LT: _compared(Code.LESS),
        libsbml.AST_RELATIONAL_LEQ: _compared(Code.LESS_EQUAL),
        libsbml.AST_RELATIONAL_GT: _compared(Code.LESS, is_mirrored=True),
        libsbml.AST_RELATIONAL_GEQ: _compared(Code.LESS_EQUAL, is_mirrored=True),
        libsbml.AST_RELATIONAL_EQ: _compared(Code.EQUAL),
        libsbml.AST_RELATIONAL_NEQ: _compared(Code.NOT_EQUAL),
        libsbml.AST_FUNCTION_EXP: _of_one(Code.EXP),
        libsbml.AST_FUNCTION_LN: _of_one(Code.LOG),
        libsbml.AST_FUNCTION_ABS: _of_one(Code.ABSOLUTE),
        libsbml.AST_FUNCTION_SIN: _of_one(Code.SINE),
        libsbml.AST_FUNCTION_COS: _of_one(Code.COSINE),
        libsbml.AST_FUNCTION_FLOOR: _of_one(Code.FLOOR),
        libsbml.AST_FUNCTION_CEILING: _of_one(Code.CEILING),
        libsbml.AST_LOGICAL_NOT: _of_one(Code.NOT),
        libsbml.AST_FUNCTION_MIN: lambda graph, inner: graph.all_of(Code.MINIMUM, inner) if inner else None,
        libsbml.AST_FUNCTION_MAX: lambda graph, inner: graph.all_of(Code.MAXIMUM, inner) if inner else None,
        libsbml.AST_FUNCTION_PIECEWISE: _piecewise,
        libsbml.AST_MINUS: _minus,
        libsbml.AST_DIVIDE: _of_two(Code.DIVIDE),
        libsbml.AST_POWER: _of_two(Code.POWER),
        libsbml.AST_FUNCTION_POWER: _of_two(Code.POWER),
        libsbml.AST_FUNCTION_LOG: _log,
        libsbml.AST_FUNCTION_ROOT: _root,
        libsbml.AST_FUNCTION_QUOTIENT: _of_a_and_b(QUOTIENT),
        libsbml.AST_FUNCTION_REM: _of_a_and_b(f"a - b * {QUOTIENT}"),  # its sign is that of a, and of a % b that of b
        libsbml.AST_LOGICAL_IMPLIES: _of_a_and_b("not a or b"),
        libsbml.AST_LOGICAL_XOR: _of_a_and_b("(not a) != (not b)"),
        **{getattr(libsbml, kind): _made(name) for kind, name in MADE.items()},
    }


def truth(graph: Graph, holds: bool) -> int:
    """What is always true, or never."""
    return graph.add(Code.EQUAL, (graph.number(1.0), graph.number(float(holds))))


def _of_one(code: Code) -> Build:
    return lambda graph, inner: graph.add(code, inner) if len(inner) == 1 else None


def _of_two(code: Code) -> Build:
    return lambda graph, inner: graph.add(code, inner) if len(inner) == 2 else None


def _compared(code: Code, is_mirrored: bool = False) -> Build:
    """Each part with the next."""

    def build(graph: Graph, inner: Sequence[int]) -> int | None:
        if len(inner) < 2:
            return None
        pairs = [pair[::-1] if is_mirrored else pair for pair in pairwise(inner)]
        return graph.all_of(Code.AND, [graph.add(code, pair) for pair in pairs])

    return build


def _made(name: str) -> Build:
    return lambda graph, inner: written(MADE_OF_OTHERS[name], graph, x=inner[0]) if len(inner) == 1 else None


def _of_a_and_b(text: str) -> Build:
    return lambda graph, inner: written(text, graph, a=inner[0], b=inner[1]) if len(inner) == 2 else None


def _piecewise(graph: Graph, inner: Sequence[int]) -> int | None:
    """Value, condition, ..., and a value otherwise."""
    if len(inner) % 2 == 0:
        return None
    whole = inner[-1]
    for value, condition in zip(inner[-3::-2], inner[-2::-2], strict=True):
        whole = graph.add(Code.SELECT, (value, condition, whole))
    return whole


def _minus(graph: Graph, inner: Sequence[int]) -> int | None:
    if len(inner) > 2 or not inner:
        return None
    return graph.add(Code.SUBTRACT if len(inner) == 2 else Code.NEGATE, inner)


def _log(graph: Graph, inner: Sequence[int]) -> int | None:
    """To base 10, or to the base that comes first."""
    if len(inner) > 2 or not inner:
        return None
    return written("log(x) / log(base)", graph, x=inner[-1], base=inner[0] if len(inner) == 2 else graph.number(10.0))


def _root(graph: Graph, inner: Sequence[int]) -> int | None:
    """Square, or of the degree that comes first."""
    if len(inner) == 1 or (len(inner) == 2 and graph.is_known(inner[0], 2.0)):
        return graph.add(Code.SQRT, inner[-1:])
    if len(inner) != 2:
        return None
    return written("x ** (1 / degree)", graph, degree=inner[0], x=inner[1])
