"""Families: tuples of the classes that a file imports, so that adding a member takes one line."""

from __future__ import annotations

from collections.abc import Mapping
from inspect import isabstract
from typing import Any


def members(namespace: Mapping[str, Any], base: type) -> tuple[Any, ...]:
    """The classes that follow `base`, in the order in which a file imported them.

    namespace : `globals()` of that file

    >>> from fractions import Fraction
    >>> from numbers import Rational
    >>> members({"Rational": Rational, "Fraction": Fraction, "pi": 3.14}, Rational)
    (<class 'fractions.Fraction'>,)
    """
    found = dict.fromkeys(each for each in namespace.values() if isinstance(each, type))
    return tuple(each for each in found if issubclass(each, base) and each is not base and not isabstract(each))
