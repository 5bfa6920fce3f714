"""The formulas of .net files: their spellings and functions, read into a graph."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping, Sequence

import numpy as np

from kinetics.formats.functions import MADE_OF_OTHERS
from kinetics.network.laws.expression import Expression
from kinetics.network.laws.graph import Code, Graph
from kinetics.network.laws.program import evaluate, steps_of
from kinetics.network.laws.reading import NUMBER, SHOWN, Dialect, called, node_of, written

SPELLINGS = {"^": "**", "&&": "and", "||": "or", "!": "not"}
CONSTANTS = {"_pi": math.pi, "_e": math.e}
UNREAD = ("asin", "acos", "atan", "atan2", "mratio", "tfun", "TFUN")
BASES = {"log10": 10.0, "log2": 2.0}


def node_in_file(text: str, graph: Graph, meaning: Callable[[str], int | None]) -> int:
    """The node of a formula; a ValueError for what is no formula.

    meaning : the node that a name stands for; None for an unknown one, which is a mistake
    """

    def named(name: str) -> int:
        known = meaning(name)
        if known is None and name not in CONSTANTS:
            raise ValueError(f"{name!r} is not known here")
        return graph.number(CONSTANTS[name]) if known is None else known

    def call(graph: Graph, name: str, arguments: Sequence[int]) -> int:
        if name == "time" and not arguments:
            return graph.time()
        return _called(graph, name, arguments) if arguments else named(name)

    return node_of(text, graph, named, Dialect(SPELLINGS, {}, call))


def number(text: str, known: Mapping[str, float]) -> float:
    """The number that a formula of known names comes to; ValueError if it comes to none."""
    if text in known:
        return known[text]
    if re.fullmatch(NUMBER, text):
        found = float(text)
    else:
        graph = Graph()
        place = node_in_file(text, graph, lambda name: graph.number(known[name]) if name in known else None)
        formula = Expression.of(graph.formula(place))
        if formula.reads_time:
            raise ValueError(f"{text[:SHOWN]!r} depends on time; expected a number")
        found = float(evaluate(steps_of(formula, {}), np.zeros(0, dtype=np.int64), 0.0))
    if not np.isfinite(found):
        raise ValueError(f"{text[:SHOWN]!r} comes to {found}; expected a finite number")
    return found


def _called(graph: Graph, name: str, arguments: Sequence[int]) -> int:
    """A function with arguments, by muParser's list and BioNetGen's own."""
    if name == "log":
        raise ValueError("log means different things to different programs; write ln or log10")
    if name == "if" and len(arguments) == 3:
        condition, value, other = arguments
        return graph.add(Code.SELECT, (value, condition, other))
    if name == "rint" and len(arguments) == 1:
        return written("floor(x + 0.5)", graph, x=arguments[0])
    if name in ("sum", "avg") and arguments:
        whole = graph.all_of(Code.ADD, arguments)
        return whole if name == "sum" else graph.add(Code.DIVIDE, (whole, graph.number(len(arguments))))
    if name in MADE_OF_OTHERS and len(arguments) == 1:
        return written(MADE_OF_OTHERS[name], graph, x=arguments[0])
    if name in UNREAD:
        raise ValueError(f"the function {name!r} is not read here: rate laws have no such operation")
    if name in BASES and len(arguments) == 1:
        return written(f"log(x) / log({BASES[name]})", graph, x=arguments[0])
    return called(graph, "log" if name == "ln" else name, arguments)
