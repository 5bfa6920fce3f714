"""Numbers with units, such as `5 nM`, `1e6 /M/s` and `1 fL`, and what they are in copies and the model's unit of time.

A concentration c is c * N_A * V copies in the volume V, so 1 /M/s is 1 / (N_A * V) per copy and second.
`per_combination` says what that means for a reaction among like copies.
"""

from __future__ import annotations

import re
from collections.abc import Collection, Iterator, Mapping, Sequence
from itertools import pairwise
from math import factorial, prod
from typing import NamedTuple

from kinetics.network.laws.graph import TRUTHS, Code, Node
from kinetics.network.laws.reading import FUNCTIONS, NUMBER, FormulaError, Token, tokens_of, unreadable
from kinetics.network.parameters import meant

AVOGADRO = 6.02214076e23  # copies in a mole, exact since 2019
MOST_POWER = 3
LARGEST = 1e100  # of a unit, and one over it the smallest


class Unit(NamedTuple):
    """A unit as a number times powers of M, s and dm; a litre is dm^3."""

    scale: float = 1.0
    amount: int = 0
    time: int = 0
    length: int = 0

    @property
    def kind(self) -> tuple[int, int, int]:
        """The powers, without the number."""
        return self[1:]

    def power(self, n: int) -> Unit:
        """The unit to the power n."""
        return Unit(self.scale**n, self.amount * n, self.time * n, self.length * n)

    def times(self, other: Unit) -> Unit:
        """The product of two units."""
        return Unit(self.scale * other.scale, *(a + b for a, b in zip(self.kind, other.kind, strict=True)))


TIMES = {"ms": 1e-3, "s": 1.0, "min": 60.0, "h": 3600.0, "d": 86400.0}
MICRO = ("u", "\u00b5", "\u03bc")  # two characters look like micro
UNITS = {
    **{name: Unit(scale, time=1) for name, scale in TIMES.items()},
    **{name: Unit(scale, amount=1) for name, scale in {"M": 1.0, "mM": 1e-3, "nM": 1e-9, "pM": 1e-12}.items()},
    **{f"{micro}M": Unit(1e-6, amount=1) for micro in MICRO},
    **{name: Unit(scale, length=3) for name, scale in {"L": 1.0, "mL": 1e-3, "nL": 1e-9, "pL": 1e-12}.items()},
    **{f"{micro}L": Unit(1e-6, length=3) for micro in MICRO},
    "fL": Unit(1e-15, length=3),
    **{f"{micro}m": Unit(1e-5, length=1) for micro in MICRO},
}
OPENING = re.compile(rf"\s*(?>{NUMBER})\s*(?:[*/(]|[^\W\d])")  # of a number with a unit
NUMBER_KIND, CONCENTRATION, TIME, VOLUME = (0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 3)
LOGIC = frozenset({Code.AND, Code.OR, Code.NOT})
Kind = tuple[int, int, int]


class Measured(NamedTuple):
    """A number with a unit. times : the units of time in it"""

    value: float
    unit: Unit
    times: tuple[str, ...]


def quantity_in(text: str, known: Collection[str] = ()) -> Measured | None:
    """The number with a unit that a text is; None for any other text, such as a formula.

    known : names of the model: `0.1 / s` is a formula if the model has an `s`
    FormulaError: an unknown unit behind a number, or a unit that is none

    >>> quantity_in("1e6 /(M s)").unit
    Unit(scale=1.0, amount=-1, time=-1, length=0)
    >>> quantity_in("2 * k") is None
    True
    """
    if not OPENING.match(text):
        return None
    try:
        tokens = list(tokens_of(text))
    except FormulaError:
        return None  # what reads it as a formula says why
    if len(tokens) < 2:
        return None
    words = [token.text for token in tokens if token.kind == "word"]
    is_beside = tokens[1].kind == "word" and words[0] not in ("and", "or")
    called = {one.text for one, other in pairwise(tokens) if other.text == "("} & FUNCTIONS.keys()
    is_formula = not all(word in UNITS for word in words) or all(word in known or word in called for word in words)
    if not words or (is_formula and not is_beside):
        return None
    reading = _UnitReading(text, tokens[1:])
    return Measured(float(tokens[0].text), reading.product(), tuple(word for word in words if word in TIMES))


class _UnitReading:
    """A unit while it is read: units side by side, * and /, one level of brackets, whole powers."""

    def __init__(self, text: str, tokens: Sequence[Token]):
        self.text = text
        self.tokens: Iterator[Token] = iter([*tokens, Token("end", "", len(text))])
        self.token = next(self.tokens)

    def product(self, within: bool = False) -> Unit:
        unit, is_first = Unit(), True
        while self.token.kind != "end" and not (within and self.token.text == ")"):
            sign = self.token.text if self.token.text in ("*", "/") else ""
            if sign == "*" and is_first:
                break
            if sign:
                self._next()
            factor = self._factor(within)
            unit, is_first = self._sound(unit.times(factor.power(-1 if sign == "/" else 1))), False
        if is_first or (not within and self.token.kind != "end"):
            raise self._wrong("a unit was expected, such as /M/s, nM or min")
        return unit

    def _factor(self, within: bool) -> Unit:
        token = self.token
        if token.text == "(" and not within:
            self._next()
            unit = self.product(within=True)
            if self.token.text != ")":
                raise unreadable(self.text, token.column, "this bracket is never closed")
        elif token.kind == "word":
            if token.text not in UNITS:
                some = "s, min, h, M, nM, fL or um"
                raise self._wrong(f"unknown unit {token.text!r}{meant(token.text, UNITS)}; expected one such as {some}")
            unit = UNITS[token.text]
        else:
            raise self._wrong("a unit was expected, such as /M/s, nM or min")
        self._next()
        return self._sound(unit.power(self._power())) if self.token.text in ("^", "**") else unit

    def _power(self) -> int:
        self._next()
        is_negative = self.token.text == "-"
        if is_negative:
            self._next()
        if not (self.token.kind == "number" and self.token.text.isdigit() and 1 <= int(self.token.text) <= MOST_POWER):
            raise self._wrong(f"a power from 1 to {MOST_POWER} was expected")
        n = int(self.token.text)
        self._next()
        return -n if is_negative else n

    def _sound(self, unit: Unit) -> Unit:
        if not 1 / LARGEST <= unit.scale <= LARGEST:
            raise self._wrong(f"a unit beyond {LARGEST:g}")
        return unit

    def _next(self) -> None:
        self.token = next(self.tokens)

    def _wrong(self, why: str) -> FormulaError:
        return unreadable(self.text, self.token.column, why)


def kind_text(kind: Kind, time: str = "s") -> str:
    """A kind of unit as text: `/M/s` for (-1, -1, 0)."""
    names = dict(zip(("M", time, "dm"), kind, strict=True))
    above = [name if n == 1 else f"{name}^{n}" for name, n in names.items() if n > 0]
    below = [f"/{name}" if n == -1 else f"/{name}^{-n}" for name, n in names.items() if n < 0]
    return " ".join(above) + "".join(below) or "no unit"


def kinds_of_order(n: int) -> list[Kind]:
    """The kinds of unit that the rate constant of a reaction of n reactants may have.

    Its rate is a concentration per time, so 1/time for one reactant; for none also copies per time.
    """
    return [(1 - n, -1, 0), *([(0, -1, 0)] if n == 0 else [])]


def per_combination(reactants: Mapping[str, int], combinations: str) -> float:
    """What turns a rate constant with units, per copy and time unit, into that of a network: m! for m like reactants.

    For 2 A -> D the rate k [A]^2 is k A^2 / (N_A V) copies per time; a network of `distinct` combinations has
    A (A - 1) / 2 in place of A^2, so its rate constant is 2 k / (N_A V). With `ordered` or `product` it is k / (N_A V).

    >>> per_combination({"A": 2}, "distinct"), per_combination({"A": 1, "B": 1}, "distinct")
    (2.0, 1.0)
    """
    return float(prod(factorial(m) for m in reactants.values())) if combinations == "distinct" else 1.0


def kind_of(formula: Sequence[Node], kinds: Mapping[str, Kind], species: Collection[str]) -> Kind | None:
    """The kind of unit that a formula has; None if nothing in it has a unit, or its unit cannot be said.

    kinds : parameter -> its kind, of those with units; numbers and other parameters go with any
    ValueError: a sum, a difference or a comparison of different kinds
    """
    found: list[Kind | None] = []
    for code, parts, value in formula:
        inner = [found[part] for part in parts]
        stated = [kind for kind in inner if kind is not None]
        kind: Kind | None = None
        if code == Code.COUNT:
            kind = kinds.get(str(value), CONCENTRATION if value in species else None)
        elif code in (Code.MULTIPLY, Code.DIVIDE) and stated:
            sign = -1 if code == Code.DIVIDE else 1
            left, right = (NUMBER_KIND if each is None else each for each in inner)
            kind = (left[0] + sign * right[0], left[1] + sign * right[1], left[2] + sign * right[2])
        elif code in (Code.ADD, Code.SUBTRACT, Code.MINIMUM, Code.MAXIMUM) or code in TRUTHS - LOGIC:
            if len(set(stated)) > 1:
                raise ValueError(f"{kind_text(stated[0])} and {kind_text(stated[1])} in one sum or comparison")
            kind = stated[0] if stated and code not in TRUTHS else None
        elif code in (Code.NEGATE, Code.ABSOLUTE):
            kind = inner[0]
        found.append(kind)
    return found[-1]
