"""Expressions of PRISM's language with their types, and every name in its place: a variable, or a number.

https://www.prismmodelchecker.org/manual/ThePRISMLanguage/Expressions. A number of the type int may stand wherever a
double is expected, never the other way round; / always gives a double. Formulas are replaced by what they stand for
before the names of a copied module are (section "Formulas And Labels"), so that what a formula names is replaced too.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping
from typing import Any, NamedTuple

from kinetics.markov.prism.expressions import Written
from kinetics.markov.prism.tokens import Lexeme, ModelTextError
from kinetics.network.checks import nearest

INT, DOUBLE, BOOL = "int", "double", "bool"
MOST_DEPTH = 150  # of terms in each other, formulas included
MOST_TERMS = 100_000  # in one expression, formulas included
LARGEST_INT = 2**53  # up to which every whole number is a double
COMPARISONS = ("<", "<=", ">", ">=")
FAILING = ("/", "mod", "pow", "log")  # these have no value for some arguments


class Term(NamedTuple):
    """A node of an expression.

    operation : that of `Written`, or `constant`, of a value, or `variable`, of the place of one
    kind : int, double or bool
    value : of a constant, or the place of a variable
    bounds : on the real value of a constant that was calculated, as an interval; None if it is the value
    can_fail : whether it has no value in some states
    depth, size : largest number of terms in each other, number of terms
    """

    operation: str
    kind: str
    parts: tuple[Term, ...]
    token: Lexeme
    value: Any = None
    bounds: Any = None
    can_fail: bool = False
    depth: int = 1
    size: int = 1

    @property
    def is_known(self) -> bool:
        """Whether it names no variable."""
        return self.operation == "constant" or (
            self.operation != "variable" and all(part.is_known for part in self.parts)
        )


class Scope:
    """What names stand for in a part of a model.

    variables : name -> place and kind
    constants : function that gives the term of a constant, or None for another name
    formulas : name -> what it stands for, as written
    renamings : names that are replaced, one step after another; of a module that is a copy of a copy there are two
    constant_names : for errors, which suggest them
    """

    def __init__(
        self,
        variables: Mapping[str, tuple[int, str]],
        constants: Callable[[Lexeme, int], Term | None],
        formulas: Mapping[str, tuple[Lexeme, Written]],
        renamings: tuple[Mapping[str, str], ...] = (),
        constant_names: Collection[str] = (),
    ) -> None:
        self._variables, self._constants, self._formulas = variables, constants, formulas
        self._renamings, self._constant_names = renamings, constant_names
        self._known: dict[str, Term] = {}  # formulas here
        self._open: list[str] = []  # formulas that are being read

    def renamed(self, name: str) -> str:
        """What a name of the module that is copied is here."""
        for renaming in self._renamings:
            name = renaming.get(name, name)
        return name

    def number(self, written: Written, what: str) -> Term:
        """An expression that must be a number."""
        found = self.term(written)
        if found.kind == BOOL:
            raise ModelTextError(f"{what} is true or false; expected a number", found.token)
        return found

    def of_kind(self, written: Written, kind: str, what: str) -> Term:
        """An expression that must be an int, a double, which an int is too, or a bool."""
        found = self.term(written)
        if found.kind != kind and (kind, found.kind) != (DOUBLE, INT):
            advice = "; round it by floor, ceil or round" if (kind, found.kind) == (INT, DOUBLE) else ""
            raise ModelTextError(f"{what} is of the type {found.kind}; expected {kind}{advice}", found.token)
        return found

    def term(self, written: Written, depth: int = 1) -> Term:
        """An expression with types; a ModelTextError for an unknown name or a wrong type."""
        token = written.token
        if depth > MOST_DEPTH:
            raise ModelTextError(f"over {MOST_DEPTH} terms stand inside each other, formulas included", token)
        match written.operation:
            case "number":
                return _number(token)
            case "truth":
                return Term("constant", BOOL, (), token, token.text == "true")
            case "name":
                return self._named(token, depth)
        parts = tuple(self.term(part, depth + 1) for part in written.parts)
        kind = _kind(written.operation, parts, token)
        return _checked(Term(written.operation, kind, parts, token, can_fail=_can_fail(written.operation, parts)))

    def _named(self, token: Lexeme, depth: int) -> Term:
        if token.text in self._formulas:
            return self._formula(token, depth)
        name = self.renamed(token.text)
        if name in self._variables:
            place, kind = self._variables[name]
            return Term("variable", kind, (), token, place)
        constant = self._constants(token._replace(text=name), depth)
        if constant is not None:
            return constant._replace(token=token)
        shown = repr(token.text) + (f", which is {name!r} in this module" if name != token.text else "")
        known = [*self._variables, *self._formulas, *self._constant_names]
        raise ModelTextError(f"unknown name {shown}{f'; {nearest(name, known)}' if known else ''}", token)

    def _formula(self, token: Lexeme, depth: int) -> Term:
        name = token.text
        if name in self._open:
            circle = [*self._open[self._open.index(name) :], name]
            raise ModelTextError(f"a formula stands for itself: {' -> '.join(circle)}", self._formulas[name][0])
        if name not in self._known:
            self._open.append(name)
            self._known[name] = self.term(self._formulas[name][1], depth + 1)
            self._open.pop()
        return self._known[name]


def _number(token: Lexeme) -> Term:
    is_whole = token.text.isdigit()
    if is_whole and len(token.text) > 16:
        raise ModelTextError(f"the whole number {token.shown} is above {LARGEST_INT}; write it as a double", token)
    value = float(token.text)
    if value == float("inf") or (is_whole and int(token.text) > LARGEST_INT):
        raise ModelTextError(f"the number {token.shown} is too large", token)
    return Term("constant", INT if is_whole else DOUBLE, (), token, value)


def _kind(operation: str, parts: tuple[Term, ...], token: Lexeme) -> str:
    """The type of an operation on parts with types."""
    kinds = [part.kind for part in parts]
    are_numbers = BOOL not in kinds
    if operation in ("&", "|", "=>", "<=>", "!"):
        _check(all(kind == BOOL for kind in kinds), operation, kinds, "true or false", token)
        return BOOL
    if operation in ("=", "!="):
        _check(are_numbers or kinds == [BOOL, BOOL], operation, kinds, "two numbers, or two of the type bool", token)
        return BOOL
    if operation == "?":
        _check(kinds[0] == BOOL, "?", kinds[:1], "true or false", token)
        kinds = kinds[1:]
        _check(BOOL not in kinds or kinds == [BOOL, BOOL], "?", kinds, "two numbers, or two of the type bool", token)
        return kinds[0] if kinds[0] == kinds[1] else DOUBLE
    _check(are_numbers, operation, kinds, "numbers", token)
    if operation in COMPARISONS:
        return BOOL
    if operation in ("floor", "ceil", "round"):
        return INT
    if operation == "mod":
        _check(kinds == [INT, INT], operation, kinds, "two of the type int", token)
        return INT
    if operation in ("/", "log"):
        return DOUBLE
    return INT if all(kind == INT for kind in kinds) else DOUBLE


def _check(is_right: bool, operation: str, kinds: list[str], expected: str, token: Lexeme) -> None:
    if not is_right:
        shown = "a minus" if operation == "negate" else repr(operation)
        raise ModelTextError(f"{shown} of the types {' and '.join(dict.fromkeys(kinds))}; expected {expected}", token)


def _can_fail(operation: str, parts: tuple[Term, ...]) -> bool:
    is_safe = operation == "/" and parts[1].operation == "constant" and parts[1].value
    return (operation in FAILING and not is_safe) or any(part.can_fail for part in parts)


def _checked(term: Term) -> Term:
    """The term with its depth and size, which have bounds."""
    depth = 1 + max((part.depth for part in term.parts), default=0)
    size = 1 + sum(part.size for part in term.parts)
    if depth > MOST_DEPTH:
        raise ModelTextError(f"over {MOST_DEPTH} terms stand inside each other, formulas included", term.token)
    if size > MOST_TERMS:
        raise ModelTextError(f"an expression of over {MOST_TERMS} terms, formulas included", term.token)
    return term._replace(depth=depth, size=size)
