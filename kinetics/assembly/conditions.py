"""Rules as lists of conditions: when a rule fits a cube, and when two rules contradict each other."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from typing import Annotated, Any, Literal

from pydantic import BeforeValidator, Field

from kinetics.config import Settings


def _as_list(value: Any) -> Any:
    """A single letter or face may be written without brackets."""
    return (value,) if isinstance(value, str) else value


def _as_multiset(value: Any) -> Any:
    value = _as_list(value)
    is_letters = isinstance(value, list | tuple) and all(isinstance(v, str) for v in value)
    return tuple(sorted(value)) if is_letters else value


OneOf = Annotated[Annotated[tuple[str, ...], Field(min_length=1)] | None, BeforeValidator(_as_list)]  # None: any
Multiset = Annotated[tuple[str, ...] | None, BeforeValidator(_as_multiset)]  # None: any


class Rule(Settings):
    """What all rules share. A condition that is left out holds always.

    rule : its name, for people
    letter : the cube's own letter, one of these
    neighbours : the letters of the cubes bonded to it, exactly these in any order; for a cube that is
        about to bond or that loses a bond, without the partner
    becomes : its letter afterwards
    """

    rule: str
    letter: OneOf = None
    neighbours: Multiset = None
    becomes: str

    @cached_property
    def conditions(self) -> dict[str, tuple[str, ...] | None]:
        """Condition -> what it admits; None admits everything."""
        skip = {"rule", "becomes"}
        return {name: getattr(self, name) for name in type(self).model_fields if name not in skip}


class Combination(Rule):
    """A bond forms: face types and the partner's letter are read as well."""

    face: OneOf = None
    partner: OneOf = None
    partner_face: OneOf = None


class Dissociation(Rule):
    """A bond breaks: `lost` is the letter of the cube that goes."""

    lost: OneOf = None


class Internal(Rule):
    """A change without an event of the cube's own: it follows its neighbours."""


class Finished(Settings):
    """A cube with this letter and this neighbour accepts no more cubes (the paper's dark LEDs)."""

    letter: str
    neighbour: str


class Semantics(Settings):
    """What the paper's tables leave open.

    gate : a bond forms when both cubes have a rule for it, or when any one has (the other keeps its letter)
    conflict : of several rules that fit, the first in the file or the most specific one counts; or
        such rules are an error
    update : both cubes read before either writes, or the first-named cube writes before the other reads
    finished : cubes that accept no more
    """

    gate: Literal["mutual", "any"] = "mutual"
    conflict: Literal["first", "most-specific", "error"] = "error"
    update: Literal["synchronous", "sequential"] = "synchronous"
    finished: tuple[Finished, ...] = ()


class Target(Settings):
    """The finished structure: cubes at these places, all in their own frame's orientation."""

    cubes: tuple[tuple[int, int, int], ...]
    letters: tuple[str, ...]


class BookFile(Settings):
    """A rule book as it is written down."""

    letters: tuple[str, ...]
    initial: str
    scheme: str
    target: Target | None = None
    semantics: Semantics = Semantics()
    combine: tuple[Combination, ...] = ()
    dissociate: tuple[Dissociation, ...] = ()
    internal: tuple[Internal, ...] = ()


def first_that_fits(rules: Sequence[Rule], reading: dict[str, Any]) -> str | None:
    """What the first rule that fits a cube's reading (condition -> what it reads) makes of it."""
    for rule in rules:
        if _fits(rule, reading):
            return rule.becomes
    return None


def _fits(rule: Rule, reading: dict[str, Any]) -> bool:
    for name, admitted in rule.conditions.items():
        if admitted is not None:
            value = reading[name]
            if (value != admitted) if name == "neighbours" else (value not in admitted):
                return False
    return True


def in_order(rules: tuple[Rule, ...], conflict: str) -> tuple[Rule, ...]:
    """The rules in the order in which they are tried; contradictory ones are refused."""
    if conflict == "first":
        return rules
    for number, rule in enumerate(rules):
        for other in rules[:number]:
            if rule.becomes == other.becomes or not _overlap(rule, other):
                continue
            if conflict == "error" or _within(rule, other) == _within(other, rule):
                raise ValueError(
                    f"rules {other.rule} and {rule.rule} contradict each other: both fit the same cube, one "
                    f"makes it {other.becomes!r}, the other {rule.becomes!r}; add a condition to one of them, or set "
                    "semantics.conflict (most-specific needs one rule to fit only where the other does)"
                )
    if conflict == "most-specific":  # a rule lies within more rules than any of those that it lies within
        return tuple(sorted(rules, key=lambda rule: -sum(_within(rule, other) for other in rules)))
    return rules


def _overlap(a: Rule, b: Rule) -> bool:
    """Whether some cube fits both rules."""
    theirs = b.conditions
    for name, mine in a.conditions.items():
        other = theirs[name]
        if mine is not None and other is not None:
            apart = mine != other if name == "neighbours" else set(mine).isdisjoint(other)
            if apart:
                return False
    return True


def _within(inner: Rule, outer: Rule) -> bool:
    """Whether every cube that fits `inner` fits `outer` too."""
    mine = inner.conditions
    for name, theirs in outer.conditions.items():
        own = mine[name]
        if theirs is not None:
            if own is None:
                return False
            if (own != theirs) if name == "neighbours" else not set(own) <= set(theirs):
                return False
    return True
