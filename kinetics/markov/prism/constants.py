"""The constants of a model: as the text has them, or as they are given; calculated when they are first asked for."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from kinetics.markov.prism.syntax import ConstantText
from kinetics.markov.prism.terms import BOOL, DOUBLE, INT, LARGEST_INT, Scope, Term
from kinetics.markov.prism.tokens import Lexeme, ModelTextError
from kinetics.markov.prism.values import NOWHERE, bounds_of, values_of
from kinetics.network.checks import some_names


class Constants:
    """The constants of a model by name.

    given : values of those that have none in the text
    scope : what names in their values stand for, given later by `read_in`
    """

    def __init__(self, texts: list[ConstantText], given: Mapping[str, Any]) -> None:
        self._texts = {text.name.text: text for text in texts}
        self._given = given
        self._known: dict[str, Term] = {}
        self._open: list[str] = []  # constants that are being calculated
        self._scope: Scope | None = None
        missing = [name for name, text in self._texts.items() if text.value is None]
        for name in given:
            if name not in self._texts:
                raise ValueError(
                    f"there is no constant {name!r} to be set; those without a value are "
                    f"{some_names(missing) or 'none'}"
                )
            if name not in missing:
                token = self._texts[name].name
                raise ModelTextError(
                    f"the constant {name!r} has a value in the text, and another was given; leave out the value in the "
                    "text, or do not set it",
                    token,
                )
        for name in missing:
            if name not in given:
                raise ModelTextError(
                    f"the constant {name!r} has no value; give it one, as in --set {name}=1", self._texts[name].name
                )

    def read_in(self, scope: Scope) -> None:
        """Calculate all, in the order of the text; a ModelTextError for one that cannot be."""
        self._scope = scope
        for text in self._texts.values():
            self.term(text.name)

    def term(self, token: Lexeme, depth: int = 1) -> Term | None:
        """The value of a constant as a term; None if there is no constant of this name."""
        name = token.text
        text = self._texts.get(name)
        if text is None:
            return None
        if name in self._open:
            circle = [*self._open[self._open.index(name) :], name]
            raise ModelTextError(f"a constant depends on itself: {' -> '.join(circle)}", text.name)
        if name not in self._known:
            self._open.append(name)
            self._known[name] = self._given_value(text) if text.value is None else self._calculated(text, depth)
            self._open.pop()
        return self._known[name]

    def _calculated(self, text: ConstantText, depth: int) -> Term:
        assert self._scope is not None and text.value is not None  # noqa: S101, PT018 - for the type checker
        name = text.name.text
        written = self._scope.term(text.value, depth + 1)
        if not written.is_known:
            raise ModelTextError(f"the constant {name!r} depends on a variable", written.token)
        if written.kind != text.kind and (text.kind, written.kind) != (DOUBLE, INT):
            advice = "; round it by floor, ceil or round" if (text.kind, written.kind) == (INT, DOUBLE) else ""
            raise ModelTextError(
                f"the constant {name!r} is of the type {text.kind}, its value of the type {written.kind}{advice}",
                written.token,
            )
        value = values_of(written, NOWHERE)
        if text.kind == BOOL:
            return Term("constant", BOOL, (), text.name, bool(value))
        self._check_size(text, float(value))
        bounds = bounds_of(written, NOWHERE)
        is_exact = bool(bounds.low == bounds.high)
        return Term("constant", text.kind, (), text.name, float(value), None if is_exact else tuple(bounds))

    def _given_value(self, text: ConstantText) -> Term:
        name, value = text.name.text, self._given[text.name.text]
        is_truth = isinstance(value, bool | np.bool_)
        if not is_truth and not isinstance(value, int | float | np.integer | np.floating):
            raise ValueError(f"the constant {name!r} was given {value!r}; expected a number, or true or false")
        if text.kind == BOOL:
            if not is_truth and value not in (0, 1):
                raise ValueError(f"the constant {name!r} is of the type bool and was given {value!r}; expected 1 or 0")
            return Term("constant", BOOL, (), text.name, bool(value))
        if is_truth or (text.kind == INT and value != np.floor(value)):
            raise ValueError(f"the constant {name!r} is of the type {text.kind} and was given {value!r}")
        self._check_size(text, float(value))
        return Term("constant", text.kind, (), text.name, float(value))

    def _check_size(self, text: ConstantText, value: float) -> None:
        if not np.isfinite(value):
            raise ModelTextError(f"the constant {text.name.shown} is {value}; expected a finite number", text.name)
        if text.kind == INT and abs(value) > LARGEST_INT:
            raise ModelTextError(f"the constant {text.name.shown} is {value:g}, beyond {LARGEST_INT}", text.name)
