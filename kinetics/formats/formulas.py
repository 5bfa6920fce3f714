"""Translation of the formulas of .net files into expressions, with names replaced by what they stand for."""

from __future__ import annotations

import ast
import re
import warnings
from collections.abc import Mapping

import numpy as np

from kinetics.network.laws.expression import LONGEST, Expression
from kinetics.network.laws.program import evaluate, steps_of

NUMBER = r"(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][-+]?[0-9]+)?"
MOST_BRACKETS = 50  # within each other
# Other programs' spellings.
RENAMED = {"ln": "log", "rint": "floor", "if_": "piecewise"}
CONSTANTS = {"_pi": "pi", "_e": "exp(1)", "_time_": "t"}
SPELLINGS = (
    (re.compile(r"\^"), "**"),
    (re.compile(r"&&"), " and "),
    (re.compile(r"\|\|"), " or "),
    (re.compile(r"!(?!=)"), " not "),
    (re.compile(r"\bif\s*\("), "if_("),
    (re.compile(r"\btime\s*\(\s*\)"), "_time_"),
)


def number(text: str, known: Mapping[str, float]) -> float:
    """The number that a formula of known names comes to; a ValueError where it comes to none."""
    if text in known:
        return known[text]
    if re.fullmatch(NUMBER, text):
        found = float(text)
    else:
        formula = Expression(replaced(text, {name: repr(value) for name, value in known.items()}))
        if formula.reads_time:
            raise ValueError(f"{text[:80]!r} depends on time; expected a number")
        found = float(evaluate(steps_of(formula, {}), np.zeros(0, dtype=np.int64), 0.0))
    if not np.isfinite(found):
        raise ValueError(f"{text[:80]!r} comes to {found}; expected a finite number")
    return found


def replaced(text: str, meanings: Mapping[str, str]) -> str:
    """The text of a formula in our own grammar.

    meanings : name -> what stands for it, in our own grammar; a name without a meaning is a mistake
    """
    tree = _Replacing(meanings).visit(_tree(_spelled(text)))
    made = ast.unparse(ast.fix_missing_locations(tree))
    if len(made) > LONGEST:
        raise ValueError(f"{text[:80]!r} grows to {len(made)} characters; at most {LONGEST} are read")
    return made


class _Replacing(ast.NodeTransformer):
    """Puts in what names stand for, and calls functions by our names."""

    def __init__(self, meanings: Mapping[str, str]):
        self.meanings = meanings

    def visit_Name(self, node: ast.Name) -> ast.expr:  # as `ast` calls it
        """What it stands for."""
        meaning = self.meanings.get(node.id, CONSTANTS.get(node.id))
        if meaning is None:
            raise ValueError(f"{node.id!r} is not known here")
        return _tree(meaning)

    def visit_Call(self, node: ast.Call) -> ast.expr:
        """A function without arguments is a name; if(condition, a, b) puts its condition first."""
        name = node.func.id if isinstance(node.func, ast.Name) else ""
        if not node.args and not node.keywords and isinstance(node.func, ast.Name):
            return self.visit_Name(node.func)
        if name == "log":
            raise ValueError("log means different things to different programs; write ln or log10")
        arguments = [self.visit(argument) for argument in node.args]
        if name == "rint" and len(arguments) == 1:
            arguments = [ast.BinOp(arguments[0], ast.Add(), ast.Constant(0.5))]
        if name == "if_" and len(arguments) == 3:
            arguments = [arguments[1], arguments[0], arguments[2]]
        if name in ("log10", "log2") and len(arguments) == 1:
            return ast.BinOp(_call("log", arguments), ast.Div(), _call("log", [ast.Constant(float(name[3:]))]))
        return ast.Call(ast.Name(RENAMED.get(name, name)), arguments, node.keywords) if name else node


def _call(name: str, arguments: list[ast.expr]) -> ast.Call:
    return ast.Call(ast.Name(name), arguments, [])


def _spelled(text: str) -> str:
    if len(text) > LONGEST:
        raise ValueError(f"a formula of {len(text)} characters; at most {LONGEST} are read")
    depth = deepest = 0
    for character in text:
        depth += (character == "(") - (character == ")")
        deepest = max(deepest, depth)
    if deepest > MOST_BRACKETS:
        raise ValueError(f"a formula with {deepest} brackets within each other; at most {MOST_BRACKETS} are read")
    for pattern, ours in SPELLINGS:
        text = pattern.sub(ours, text)
    return text


def _tree(text: str) -> ast.expr:
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error")  # of dubious literals, which are mistakes here
            return ast.parse(text.strip(), mode="eval").body
    except (SyntaxError, SyntaxWarning, DeprecationWarning, ValueError, RecursionError, MemoryError):
        raise ValueError(f"{text[:80]!r} is not a formula") from None
