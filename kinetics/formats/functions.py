"""Functions of one argument that rate laws have no operation for, made of the operations that they have.

Their values are those of the operations: where a function is near 0, a difference of larger terms leaves it an absolute
error of some 1e-16.
"""

from __future__ import annotations

from collections.abc import Callable

from kinetics.network.laws.graph import Code, Graph

Made = Callable[[Graph, int], int]


def _quotient(above: Code | None, below: Code) -> Made:
    """A quotient of sines and cosines; of 1 if there is none above."""

    def made(graph: Graph, x: int) -> int:
        top = graph.number(1.0) if above is None else graph.add(above, (x,))
        return graph.add(Code.DIVIDE, (top, graph.add(below, (x,))))

    return made


def _inverse(of: Made) -> Made:
    return lambda graph, x: graph.add(Code.DIVIDE, (graph.number(1.0), of(graph, x)))


def _sinh(graph: Graph, x: int) -> int:
    """(exp(x) - exp(-x)) / 2"""
    return _half(graph, Code.SUBTRACT, graph.add(Code.EXP, (x,)), _exp_of_minus(graph, x))


def _cosh(graph: Graph, x: int) -> int:
    """(exp(x) + exp(-x)) / 2"""
    return _half(graph, Code.ADD, graph.add(Code.EXP, (x,)), _exp_of_minus(graph, x))


def _tanh(graph: Graph, x: int) -> int:
    """1 - 2 / (exp(2 x) + 1), which is 1 and -1 if the exponential is beyond all floats."""
    grown = graph.add(Code.EXP, (graph.add(Code.MULTIPLY, (graph.number(2.0), x)),))
    below = graph.add(Code.ADD, (grown, graph.number(1.0)))
    return graph.add(Code.SUBTRACT, (graph.number(1.0), graph.add(Code.DIVIDE, (graph.number(2.0), below))))


def _asinh(graph: Graph, x: int) -> int:
    """sign(x) log(|x| + sqrt(x x + 1)): without |x| the two terms would cancel below 0."""
    size = graph.add(Code.ABSOLUTE, (x,))
    root = graph.add(Code.SQRT, (graph.add(Code.ADD, (graph.add(Code.MULTIPLY, (x, x)), graph.number(1.0))),))
    grown = graph.add(Code.LOG, (graph.add(Code.ADD, (size, root)),))
    return graph.add(Code.MULTIPLY, (_sign(graph, x), grown))


def _acosh(graph: Graph, x: int) -> int:
    """log(x + sqrt(x x - 1))"""
    square = graph.add(Code.SUBTRACT, (graph.add(Code.MULTIPLY, (x, x)), graph.number(1.0)))
    return graph.add(Code.LOG, (graph.add(Code.ADD, (x, graph.add(Code.SQRT, (square,)))),))


def _atanh(graph: Graph, x: int) -> int:
    """log((1 + x) / (1 - x)) / 2"""
    one = graph.number(1.0)
    share = graph.add(Code.DIVIDE, (graph.add(Code.ADD, (one, x)), graph.add(Code.SUBTRACT, (one, x))))
    return graph.add(Code.DIVIDE, (graph.add(Code.LOG, (share,)), graph.number(2.0)))


def _sign(graph: Graph, x: int) -> int:
    """1 above 0, -1 below it, and 0 there."""
    zero, one = graph.number(0.0), graph.number(1.0)
    below = graph.add(Code.SELECT, (graph.number(-1.0), graph.add(Code.LESS, (x, zero)), zero))
    return graph.add(Code.SELECT, (one, graph.add(Code.LESS, (zero, x)), below))


def _exp_of_minus(graph: Graph, x: int) -> int:
    return graph.add(Code.EXP, (graph.add(Code.NEGATE, (x,)),))


def _half(graph: Graph, code: Code, one: int, other: int) -> int:
    return graph.add(Code.DIVIDE, (graph.add(code, (one, other)), graph.number(2.0)))


MADE_OF_OTHERS: dict[str, Made] = {
    "tan": _quotient(Code.SINE, Code.COSINE),
    "cot": _quotient(Code.COSINE, Code.SINE),
    "sec": _quotient(None, Code.COSINE),
    "csc": _quotient(None, Code.SINE),
    "sinh": _sinh,
    "cosh": _cosh,
    "tanh": _tanh,
    "coth": _inverse(_tanh),
    "sech": _inverse(_cosh),
    "csch": _inverse(_sinh),
    "asinh": _asinh,
    "acosh": _acosh,
    "atanh": _atanh,
    "sign": _sign,
}
