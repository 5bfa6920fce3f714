"""Translation of SBML formulas into expressions, by a walk over libsbml's tree."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping
from typing import Any

from kinetics.network.laws.expression import LONGEST

AVOGADRO = "6.02214179e+23"  # as SBML Level 3 has it
ARGUMENT = re.compile("\0([0-9]+)\0")  # in the body of a function: no id can hold it


class TooLongError(ValueError):
    """A formula that grows beyond what is read."""


class Functions:
    """The functions that a model defines, each translated when it is first called."""

    def __init__(self, defined: Mapping[str, Any]):
        self.defined = defined
        self.bodies: dict[str, tuple[int, str]] = {}  # how many arguments it takes, and its text with places for them
        self.open: list[str] = []

    def call(self, name: str, inner: list[str]) -> str:
        """The text of a call with these arguments; a ValueError for a function that is not defined."""
        if name not in self.bodies:
            self.bodies[name] = self._translated(name)
        n, body = self.bodies[name]
        if len(inner) != n:
            raise ValueError(f"the function {name!r} takes {n} arguments; {len(inner)} came")
        return ARGUMENT.sub(lambda found: inner[int(found[1])], body)

    def _translated(self, name: str) -> tuple[int, str]:
        definition = self.defined.get(name)
        if definition is None or definition.getBody() is None:
            raise ValueError(f"the function {name!r} has no formula")
        if name in self.open:
            raise ValueError(f"functions call each other in a circle: {', '.join(self.open)}")
        n = definition.getNumArguments()
        places = {definition.getArgument(i).getName(): f"\0{i}\0" for i in range(n)}

        def argument(asked: str) -> str:
            if asked not in places:
                raise ValueError(f"the function {name!r} uses {asked!r}, which is no argument of it")
            return places[asked]

        self.open.append(name)
        body = text_of(definition.getBody(), argument, self)
        self.open.pop()
        return n, body


def text_of(node: Any, meaning: Callable[[str], str], functions: Functions) -> str:
    """The text of a formula in our own grammar.

    meaning : what stands for an id, in our own grammar; it raises a ValueError for an unknown one
    A ValueError for what has no counterpart here, and for a text beyond the longest that is read.
    """
    # Without recursion, since a sum of thousands of terms is thousands deep: parts before the whole.
    parts, waiting = [], [node]
    while waiting:
        part = waiting.pop()
        parts.append(part)
        waiting += [part.getChild(i) for i in range(part.getNumChildren())]
    texts: list[str] = []  # of the parts that no whole has taken in yet
    for part in reversed(parts):
        n = part.getNumChildren()
        inner = texts[len(texts) - n :]
        del texts[len(texts) - n :]
        texts.append(_text_of_part(part, inner, meaning, functions))
        if len(texts[-1]) > LONGEST:
            raise TooLongError(f"a formula of {len(texts[-1])} characters; at most {LONGEST} are read")
    return texts[0]


def _text_of_part(node: Any, inner: list[str], meaning: Callable[[str], str], functions: Functions) -> str:
    """The text of a formula whose parts have the texts `inner`."""
    import libsbml as sbml

    kind = node.getType()
    if kind in (sbml.AST_INTEGER, sbml.AST_REAL, sbml.AST_REAL_E, sbml.AST_RATIONAL):
        return number_text(node.getInteger() if kind == sbml.AST_INTEGER else node.getReal())
    if kind == sbml.AST_NAME:
        return meaning(node.getName())
    if kind == sbml.AST_FUNCTION:
        return functions.call(node.getName(), inner)
    symbols = {
        sbml.AST_NAME_TIME: "t",
        sbml.AST_NAME_AVOGADRO: AVOGADRO,
        sbml.AST_CONSTANT_PI: "pi",
        sbml.AST_CONSTANT_E: "exp(1)",
        sbml.AST_CONSTANT_TRUE: "(1 == 1)",
        sbml.AST_CONSTANT_FALSE: "(1 == 0)",
    }
    if kind in symbols:
        return symbols[kind]
    made = _call(kind, inner)
    if made is None:
        spelled = sbml.formulaToL3String(node) or node.getName() or "a formula"
        raise ValueError(f"{spelled[:80]!r} cannot be written as a rate law here")
    return made


def number_text(value: float) -> str:
    """A number as our own grammar has it; a ValueError for one that is not finite."""
    if not math.isfinite(value):
        raise ValueError(f"{value} in a formula; expected a finite number")
    return repr(value) if value >= 0 else f"({value!r})"


def is_sum(node: Any) -> bool:
    """Whether a formula is a sum of others."""
    import libsbml

    return bool(node.getType() == libsbml.AST_PLUS)


def _call(kind: int, inner: list[str]) -> str | None:
    """A function or an operator of `inner`; None for one that we do not have."""
    import libsbml as sbml

    joined = {
        sbml.AST_PLUS: (" + ", "0"),
        sbml.AST_TIMES: (" * ", "1"),
        sbml.AST_LOGICAL_AND: (" and ", "(1 == 1)"),
        sbml.AST_LOGICAL_OR: (" or ", "(1 == 0)"),
    }
    if kind in joined:
        sign, empty = joined[kind]
        return f"({sign.join(inner)})" if inner else empty
    compared = {
        sbml.AST_RELATIONAL_LT: "<",
        sbml.AST_RELATIONAL_LEQ: "<=",
        sbml.AST_RELATIONAL_GT: ">",
        sbml.AST_RELATIONAL_GEQ: ">=",
        sbml.AST_RELATIONAL_EQ: "==",
        sbml.AST_RELATIONAL_NEQ: "!=",
    }
    if kind in compared and len(inner) > 1:
        return f"({f' {compared[kind]} '.join(inner)})"
    functions = {
        sbml.AST_FUNCTION_EXP: "exp",
        sbml.AST_FUNCTION_LN: "log",
        sbml.AST_FUNCTION_ABS: "abs",
        sbml.AST_FUNCTION_SIN: "sin",
        sbml.AST_FUNCTION_COS: "cos",
        sbml.AST_FUNCTION_FLOOR: "floor",
        sbml.AST_FUNCTION_CEILING: "ceil",
    }
    if kind in functions and len(inner) == 1:
        return f"{functions[kind]}({inner[0]})"
    if kind == sbml.AST_FUNCTION_PIECEWISE and len(inner) % 2 == 1:
        return f"piecewise({', '.join(inner)})" if len(inner) > 1 else inner[0]
    if kind in (sbml.AST_FUNCTION_MIN, sbml.AST_FUNCTION_MAX) and inner:
        name = "min" if kind == sbml.AST_FUNCTION_MIN else "max"
        return f"{name}({', '.join(inner)})" if len(inner) > 1 else inner[0]
    return _of_one_or_two(kind, inner)


def _of_one_or_two(kind: int, inner: list[str]) -> str | None:
    import libsbml as sbml

    two: dict[int, Callable[[str, str], str]] = {
        sbml.AST_MINUS: lambda a, b: f"({a} - {b})",
        sbml.AST_DIVIDE: lambda a, b: f"({a} / {b})",
        sbml.AST_POWER: lambda a, b: f"({a} ** {b})",
        sbml.AST_FUNCTION_POWER: lambda a, b: f"({a} ** {b})",
        sbml.AST_FUNCTION_LOG: lambda a, b: f"(log({b}) / log({a}))",  # the base comes first
        sbml.AST_FUNCTION_ROOT: lambda a, b: f"({b} ** (1 / {a}))" if a != "2" else f"sqrt({b})",
        sbml.AST_FUNCTION_QUOTIENT: _quotient,
        sbml.AST_FUNCTION_REM: lambda a, b: f"({a} - {b} * {_quotient(a, b)})",  # with the sign of a; % has that of b
        sbml.AST_LOGICAL_IMPLIES: lambda a, b: f"(not {a} or {b})",
        sbml.AST_LOGICAL_XOR: lambda a, b: f"((not {a}) != (not {b}))",
    }
    one: dict[int, Callable[[str], str]] = {
        sbml.AST_MINUS: lambda a: f"(-{a})",
        sbml.AST_LOGICAL_NOT: lambda a: f"(not {a})",
        sbml.AST_FUNCTION_ROOT: lambda a: f"sqrt({a})",
        sbml.AST_FUNCTION_LOG: lambda a: f"(log({a}) / log(10))",
        sbml.AST_FUNCTION_TAN: lambda a: f"(sin({a}) / cos({a}))",
        sbml.AST_FUNCTION_COT: lambda a: f"(cos({a}) / sin({a}))",
        sbml.AST_FUNCTION_SEC: lambda a: f"(1 / cos({a}))",
        sbml.AST_FUNCTION_CSC: lambda a: f"(1 / sin({a}))",
    }
    if len(inner) == 2 and kind in two:
        return two[kind](*inner)
    if len(inner) == 1 and kind in one:
        return one[kind](*inner)
    return None


def _quotient(a: str, b: str) -> str:
    """a / b without its fraction."""
    return f"piecewise(floor({a} / {b}), {a} / {b} >= 0, ceil({a} / {b}))"
