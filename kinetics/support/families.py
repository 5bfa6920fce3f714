"""Families: tuples of the classes that a file imports, so that adding a member takes one line."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from inspect import isabstract
from typing import Any, Protocol, TypeVar


class Named(Protocol):
    """What has a name."""

    @property
    def name(self) -> str:
        """By which users ask for it."""


Member = TypeVar("Member", bound=Named)


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


def member_named(name: str, family: Iterable[Member], what: str) -> Member:
    """The member of this `name`. ValueError: there is none; `what` the family holds, in the singular.

    >>> from kinetics.rates.breaks import BREAK_MODELS
    >>> member_named("hit", BREAK_MODELS, "break model")
    Traceback (most recent call last):
    ValueError: unknown break model 'hit'; expected one of first-order, collision, collision-wall, collision-species
    """
    known = {member.name: member for member in family}
    if name not in known:
        raise ValueError(f"unknown {what} {name!r}; expected one of {', '.join(known)}")
    return known[name]
