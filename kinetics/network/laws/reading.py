"""Formulas as text, read into nodes of a graph by operator precedence, without recursion.

Dijkstra (1961), the shunting-yard algorithm. The grammar is that of Python's arithmetic; a `Dialect` says what else
other programs spell, and what their functions mean.
"""

from __future__ import annotations

import ast
import keyword
import math
import re
import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

from kinetics.network.laws.graph import Code, Graph

TIME, PI = "t", "pi"
LONGEST = 100_000  # characters of a formula
SHOWN, MOST_SHOWN = 80, 200  # characters of it in a message
NUMBER = r"(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][-+]?[0-9]+)?"
WORD = re.compile(r"[^\W\d]\w*")
TOKEN = re.compile(
    rf"\s*(?:(?P<number>{NUMBER})|(?P<word>{WORD.pattern})|(?P<quoted>'(?:[^'\\]|\\.)*'|\"(?:[^\"\\]|\\.)*\")"
    r"|(?P<sign>\*\*|//|<=|>=|==|!=|=>|&&|\|\||[-+*/%<>()=,&|!^]))"
)
TWO = {
    "or": (1, Code.OR),
    "and": (2, Code.AND),
    "<": (4, Code.LESS),
    "<=": (4, Code.LESS_EQUAL),
    ">": (4, Code.LESS),  # these two with their sides exchanged
    ">=": (4, Code.LESS_EQUAL),
    "==": (4, Code.EQUAL),
    "!=": (4, Code.NOT_EQUAL),
    "+": (5, Code.ADD),
    "-": (5, Code.SUBTRACT),
    "*": (6, Code.MULTIPLY),
    "/": (6, Code.DIVIDE),
    "%": (6, Code.MODULO),
    "**": (8, Code.POWER),
}
COMPARING, RAISING = 4, 8
IMPLIES, LOOSEST = "=>", 0.5  # read where a dialect has it: a => b is not a or b, and binds least of all
BEFORE = {"not": (3, Code.NOT), "-": (7, Code.NEGATE), "+": (7, None)}
HINTS = {"^": "^ is no power here; write **", IMPLIES: "=> is not read here; write not a or b for a => b"}
CALLS = {
    "exp": Code.EXP,
    "log": Code.LOG,
    "sqrt": Code.SQRT,
    "abs": Code.ABSOLUTE,
    "sin": Code.SINE,
    "cos": Code.COSINE,
    "floor": Code.FLOOR,
    "ceil": Code.CEILING,
    "pow": Code.POWER,
    "min": Code.MINIMUM,
    "max": Code.MAXIMUM,
}
# How many arguments; None for two and more. piecewise takes an odd number: value, condition, ..., value otherwise.
FUNCTIONS = {name: None if name in ("min", "max") else 2 if name == "pow" else 1 for name in CALLS} | {
    "piecewise": None
}
RESERVED = (TIME, PI)

Call = Callable[[Graph, str, Sequence[int]], int]


@dataclass(frozen=True)
class Dialect:
    """What a program spells otherwise, and what its names and functions mean.

    spellings : sign or word -> the one of ours
    constants : word -> its node
    call : the node of a function's name and arguments; a ValueError for one that there is not
    implies : whether `=>` is an operator
    """

    spellings: Mapping[str, str] = field(default_factory=dict)
    constants: Mapping[str, Callable[[Graph], int]] = field(
        default_factory=lambda: {TIME: Graph.time, PI: lambda graph: graph.number(math.pi)}
    )
    call: Call = field(default_factory=lambda: called)
    implies: bool = False


class FormulaError(ValueError):
    """A text that is not a formula. fault : what is wrong; place : where in the text, from 0"""

    def __init__(self, told: str, fault: str, place: int) -> None:
        super().__init__(told)
        self.fault, self.place = fault, place


class Token(NamedTuple):
    """A piece of a formula: its kind, its text, and where it begins."""

    kind: str
    text: str
    column: int


def tokens_of(text: str) -> Iterator[Token]:
    """The tokens of a text. ValueError if it is too long, or holds characters that no formula has."""
    check_length(text)
    place, end = 0, len(text.rstrip())
    while place < end:
        found = TOKEN.match(text, place)
        if found is None:
            blanks = re.compile(r"\s*").match(text, place)
            place = blanks.end() if blanks else place
            raise unreadable(text, place, f"{text[place]!r} means nothing")
        kind = str(found.lastgroup)
        yield Token(kind, found[kind], found.start(kind))
        place = found.end()


def check_length(text: str) -> None:
    """A ValueError for a text that is too long."""
    if len(text) > LONGEST:
        raise ValueError(f"a formula of {len(text)} characters; at most {LONGEST} are read")


def unreadable(text: str, place: int, why: str) -> FormulaError:
    """The error of a text that cannot be read at some place."""
    return FormulaError(f"cannot read {around(text, place)!r}: {why} at column {place + 1}", why, place)


def around(text: str, place: int) -> str:
    """The text, or an excerpt around a place if it is long."""
    start = max(0, place - SHOWN // 2) if len(text) > SHOWN else 0
    return text[start : start + SHOWN]


def node_of(text: str, graph: Graph, name: Callable[[str], int] | None = None, dialect: Dialect | None = None) -> int:
    """The node of a formula.

    name : the node of any other name, by default the name itself
    A ValueError, with the place, for what is no formula.
    """
    return _Reading(text, graph, name, dialect or OURS).whole()


def written(text: str, graph: Graph, **parts: int) -> int:
    """The node of a formula of ours, the names in which stand for these nodes.

    >>> graph = Graph()
    >>> graph.formula(written("sqrt(x * x + 1)", graph, x=graph.name("A")))[-1].code.name
    'SQRT'
    """
    return node_of(text, graph, parts.__getitem__)


class _Open(NamedTuple):
    """An operator, a bracket or a call that waits for what follows. level : 0 for brackets, which nothing passes."""

    level: float
    sign: str
    column: int
    height: int = 0  # of the values below it
    is_before: bool = False  # an operator of one value, which follows


class _Reading:
    """One text while it is read."""

    def __init__(self, text: str, graph: Graph, name: Callable[[str], int] | None, dialect: Dialect):
        self.text, self.graph, self.name, self.dialect = text, graph, name, dialect
        self.values: list[int] = []
        self.middles: list[int | None] = []  # of a value that is a comparison: its right side, which the next may take
        self.waiting: list[_Open] = []

    def whole(self) -> int:
        tokens = [*tokens_of(self.text), Token("end", "", len(self.text))]
        wants_value, i = True, 0
        while tokens[i].kind != "end":
            token, i = tokens[i], i + 1
            if not wants_value:
                wants_value = self._operator(token)
            elif self._is_name(token) and tokens[i].text == "(":
                self.waiting.append(_Open(0, token.text, token.column, len(self.values)))
                i += 1
                if tokens[i].text == ")":
                    self._close(tokens[i])
                    wants_value, i = False, i + 1
            else:
                wants_value = self._value(token)
        if wants_value:
            raise unreadable(self.text, len(self.text), "a value is missing")
        self._pass(LOOSEST)
        if self.waiting:
            raise unreadable(self.text, self.waiting[-1].column, "this bracket is never closed")
        return self.values[0]

    def _spelled(self, token: Token) -> str:
        return self.dialect.spellings.get(token.text, token.text) if token.kind in ("sign", "word") else ""

    def _is_name(self, token: Token) -> bool:
        return token.kind == "word" and self._spelled(token) not in (*TWO, *BEFORE)

    def _value(self, token: Token) -> bool:
        """Read on where a value is expected; whether one is still expected then."""
        spelled = self._spelled(token)
        if spelled in BEFORE:
            level = BEFORE[spelled][0]
            if self.waiting and level == BEFORE["not"][0] < self.waiting[-1].level:
                raise unreadable(self.text, token.column, f"{token.text!r} needs brackets here")
            self.waiting.append(_Open(level, spelled, token.column, is_before=True))
            return True
        if spelled == "(":
            self.waiting.append(_Open(0, "(", token.column, len(self.values)))
            return True
        if token.kind == "number":
            value = float(token.text)
            if not math.isfinite(value):
                raise self._wrong(token.column, "a number beyond 1e308")
            self._push(self.graph.number(value))
        elif token.kind == "quoted":
            self._push((self.name or self.graph.name)(self._unquoted(token)))
        elif self._is_name(token):
            self._push(self._named(token))
        else:
            raise unreadable(self.text, token.column, HINTS.get(token.text, "a value is missing"))
        return False

    def _named(self, token: Token) -> int:
        constant = self.dialect.constants.get(token.text)
        try:
            if constant is not None:
                return constant(self.graph)
            return plain_name(self.graph, token.text) if self.name is None else self.name(token.text)
        except ValueError as error:
            raise self._wrong(token.column, str(error)) from None

    def _operator(self, token: Token) -> bool:
        """Read on after a value; whether one is expected then."""
        sign = self._spelled(token)
        if sign == ")":
            self._close(token)
            return False
        if sign == ",":
            self._pass(LOOSEST)
            if not self.waiting or self.waiting[-1].sign == "(":
                raise unreadable(self.text, token.column, "a comma outside of a function's arguments")
            return True
        if sign == IMPLIES and self.dialect.implies:
            self._pass(1)
            if self.waiting and self.waiting[-1].sign == IMPLIES:
                raise unreadable(self.text, token.column, "a => b => c is read in two ways by programs; write brackets")
            self.waiting.append(_Open(LOOSEST, sign, token.column))
            return True
        if sign not in TWO:
            raise unreadable(self.text, token.column, HINTS.get(token.text, "an operator is missing"))
        level = TWO[sign][0]
        self._pass(level + (level == RAISING))  # a power takes its right side first
        self.waiting.append(_Open(level, sign, token.column))
        return True

    def _close(self, token: Token) -> None:
        self._pass(LOOSEST)
        if not self.waiting:
            raise unreadable(self.text, token.column, "a bracket closes that was never opened")
        opened = self.waiting.pop()
        if opened.sign == "(":
            self.middles[-1] = None
            return
        arguments = self.values[opened.height :]
        del self.values[opened.height :], self.middles[opened.height :]
        try:
            self._push(self.dialect.call(self.graph, opened.sign, arguments))
        except ValueError as error:
            raise self._wrong(opened.column, str(error)) from None

    def _pass(self, level: float) -> None:
        """Apply what waits and binds at least so strongly."""
        while self.waiting and self.waiting[-1].level >= level:
            operator = self.waiting.pop()
            right, _ = self.values.pop(), self.middles.pop()
            if operator.is_before:
                code = BEFORE[operator.sign][1]
                self._push(right if code is None else self.graph.add(code, (right,)))
                continue
            left, middle = self.values.pop(), self.middles.pop()
            if operator.sign == IMPLIES:
                self._push(self.graph.add(Code.OR, (self.graph.add(Code.NOT, (left,)), right)))
                continue
            code = TWO[operator.sign][1]
            if operator.level != COMPARING:
                self._push(self.graph.add(code, (left, right)))
                continue
            one = left if middle is None else middle  # a < b < c is a < b and b < c
            made = self.graph.add(code, (right, one) if operator.sign in (">", ">=") else (one, right))
            self._push(made if middle is None else self.graph.add(Code.AND, (left, made)), right)

    def _push(self, value: int, middle: int | None = None) -> None:
        self.values.append(value)
        self.middles.append(middle)

    def _unquoted(self, token: Token) -> str:
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("error")  # of dubious escapes
                name = str(ast.literal_eval(token.text))
        except (SyntaxError, SyntaxWarning, DeprecationWarning, ValueError):
            raise unreadable(self.text, token.column, "these quotes hold no name") from None
        if not name:
            raise self._wrong(token.column, "an empty name")
        return name

    def _wrong(self, column: int, fault: str) -> FormulaError:
        return FormulaError(f"{fault} at column {column + 1} of {shortened(self.text)!r}", fault, column)


def called(graph: Graph, name: str, arguments: Sequence[int]) -> int:
    """A call of one of `FUNCTIONS`."""
    if name not in FUNCTIONS:
        raise ValueError(f"unknown function {name!r}; there are {', '.join(FUNCTIONS)}")
    n, expected = len(arguments), FUNCTIONS[name]
    if name == "piecewise":
        if n < 3 or n % 2 == 0:
            raise ValueError(f"piecewise has {n} arguments; expected value, condition, ..., and a value otherwise")
        whole = arguments[-1]
        for value, condition in zip(arguments[-3::-2], arguments[-2::-2], strict=True):
            whole = graph.add(Code.SELECT, (value, condition, whole))
        return whole
    if n != expected if expected else n < 2:
        raise ValueError(f"{name} has {n} arguments; expected {expected or 'two or more'}")
    return graph.add(CALLS[name], arguments) if expected == 1 else graph.all_of(CALLS[name], arguments)


def plain_name(graph: Graph, name: str) -> int:
    """A name that is written without quotes."""
    if name in FUNCTIONS:
        raise ValueError(f"{name!r} is a function; expected arguments after it")
    if keyword.iskeyword(name):
        raise ValueError(f"{name!r} is not a name here; quote it if it is a species")
    return graph.name(name)


def shortened(text: str) -> str:
    """The text, or the beginning of a long one."""
    return text if len(text) <= MOST_SHOWN else f"{text[:SHOWN]}..."


OURS = Dialect()
