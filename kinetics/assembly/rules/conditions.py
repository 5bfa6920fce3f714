"""Rules and their conditions: when a rule fits a cube, and when two rules contradict each other."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from functools import cached_property
from typing import TYPE_CHECKING, Annotated, Any, Literal, TypeAlias

from msgspec import Meta
from msgspec.structs import asdict, force_setattr

from kinetics.assembly.faces import turned
from kinetics.assembly.structure import Structure
from kinetics.support.settings import Settings

Direction = Literal["x", "-x", "y", "-y", "z", "-z"]
DIRECTIONS: tuple[Direction, ...] = ("x", "-x", "y", "-y", "z", "-z")  # as faces are numbered


if TYPE_CHECKING:  # None: any
    OneOf: TypeAlias = tuple[str, ...] | None
    Multiset: TypeAlias = OneOf
    Rolls: TypeAlias = OneOf
else:  # as they may be written: one without brackets, angles as numbers
    OneOf = str | Annotated[tuple[str, ...], Meta(min_length=1)] | None
    Multiset = str | tuple[str, ...] | None
    Rolls = str | int | Annotated[tuple[str | int, ...], Meta(min_length=1)] | None
NO_CONDITIONS = ("rule", "becomes")  # what a rule holds besides
EXACT = ("neighbours", "touched")  # multisets that must be met exactly; all others but `has` are one-of
MULTISETS = (*EXACT, "has")


class Senses(Settings):
    """The senses of a cube. It always knows its own letter and those of the cubes bonded to it.

    faces : the face scheme: `one` (all alike), `two` (f1: top and bottom, f2: the sides) or `six` (f1 to f6)
    roll : the twist at which another cube docks
    across : the letter of the cube at the face opposite the docking one
    touched : the letters of all cubes that it touches once docked, not the partner's alone
    """

    faces: str
    roll: bool = False
    across: bool = False
    touched: bool = False


class Rule(Settings, dict=True):
    """What all rules share. A condition that is left out holds always.

    rule : its name, for people
    letter : the cube's own letter, one of these
    neighbours : the letters of the cubes bonded to it, exactly these in any order; for a cube that is
        about to bond or that loses a bond, without the partner
    has : the letters of cubes bonded to it, at least these
    becomes : its letter afterwards
    """

    rule: str
    letter: OneOf = None
    neighbours: Multiset = None
    has: Multiset = None
    becomes: str

    def __post_init__(self) -> None:
        """Conditions as they are read: tuples of texts, those of multisets in order."""
        for name, value in self.conditions.items():
            if value is not None:
                texts = map(str, value if isinstance(value, tuple) else (value,))
                force_setattr(self, name, tuple(sorted(texts) if name in MULTISETS else texts))

    @property
    def conditions(self) -> dict[str, tuple[str, ...] | None]:
        """Condition -> what it admits; None admits everything."""
        return {name: value for name, value in asdict(self).items() if name not in NO_CONDITIONS}

    @cached_property
    def stated(self) -> tuple[tuple[str, tuple[str, ...]], ...]:
        """The conditions that do not admit everything."""
        return tuple((name, value) for name, value in self.conditions.items() if value is not None)


class Combination(Rule):
    """A bond forms: face types and the partner's letter are read as well.

    The other conditions need the sense of that name (see Senses).
    roll : the twist between the two cubes, one of these
    across : the letter of the cube at the face opposite the docking one, one of these; "" is for none there
    touched : the letters of all cubes of the other structure that this one touches once docked, the partner's
        among them; exactly these in any order
    """

    face: OneOf = None
    partner: OneOf = None
    partner_face: OneOf = None
    roll: Rolls = None
    across: OneOf = None
    touched: Multiset = None


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
    """How rules are read where the paper's tables leave it open.

    gate : a bond forms if both cubes have a rule for it, or if any one has (the other keeps its letter)
    conflict : of several rules that fit, the first in the file or the most specific one applies, or it is an error
    update : both cubes read before either writes, or the first-named cube writes before the other reads
    bonds : whether bonds break or hold for ever
    finished : cubes that accept no more
    """

    gate: Literal["mutual", "any"] = "mutual"
    conflict: Literal["first", "most-specific", "error"] = "error"
    update: Literal["synchronous", "sequential"] = "synchronous"
    bonds: Literal["break", "hold"] = "break"
    finished: tuple[Finished, ...] = ()


class BookTarget(Settings):
    """The finished structure: cubes at these places.

    tops : direction of each cube's own top (f1 of scheme `two`); upright if left out
    fronts : direction of its own +x side, for schemes that can tell
    """

    cubes: tuple[tuple[int, int, int], ...]
    letters: tuple[str, ...]
    tops: tuple[Direction, ...] | None = None
    fronts: tuple[Direction, ...] | None = None

    def structure(self) -> Structure:
        """These cubes as a `Structure`."""
        n = len(self.cubes)
        for name, given in (("tops", self.tops), ("fronts", self.fronts)):
            if given is not None and len(given) != n:
                raise ValueError(f"target.{name} has {len(given)} directions for {n} cubes; give one for each cube")
        tops = self.tops or ("z",) * n
        fronts: tuple[str | None, ...] = self.fronts or (None,) * n
        turns = tuple(_turn(top, front) for top, front in zip(tops, fronts, strict=True))
        return Structure(self.cubes, turns, self.letters)


def _turn(top: str, front: str | None) -> int:
    """The first rotation that makes a cube's top, and its front if given, look where they should."""
    for rotation, directions in enumerate(turned.tolist()):
        if DIRECTIONS[directions[4]] == top and front in {None, DIRECTIONS[directions[0]]}:
            return rotation
    raise ValueError(f"target: a cube's top looks to {top!r} and its front to {front!r}; they must be at right angles")


class BookFile(Settings):
    """A rule book as it is written down.

    initial : the letter of a free cube
    seed : the letter of the one cube from which the assembly grows, if it needs one
    """

    letters: tuple[str, ...]
    initial: str
    seed: str | None = None
    senses: Senses
    target: BookTarget | None = None
    semantics: Semantics = Semantics()
    combine: tuple[Combination, ...] = ()
    dissociate: tuple[Dissociation, ...] = ()
    internal: tuple[Internal, ...] = ()


def first_that_fits(rules: Sequence[Rule], reading: dict[str, Any]) -> Rule | None:
    """The first rule that fits a cube's reading (condition -> what it reads; None: not known yet, may be anything)."""
    for rule in rules:
        if _fits(rule, reading):
            return rule
    return None


def _fits(rule: Rule, reading: dict[str, Any]) -> bool:
    for name, admitted in rule.stated:
        if name == "has":
            if not _holds(reading["neighbours"], admitted):
                return False
            continue
        value = reading[name]
        if value is not None and ((value != admitted) if name in EXACT else (value not in admitted)):
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
        if mine is not None and other is not None and name != "has":
            apart = mine != other if name in EXACT else set(mine).isdisjoint(other)
            if apart:
                return False
    around = a.neighbours if a.neighbours is not None else b.neighbours
    return around is None or all(_holds(around, rule.has or ()) for rule in (a, b))


def _within(inner: Rule, outer: Rule) -> bool:
    """Whether every cube that fits `inner` fits `outer` too."""
    mine = inner.conditions
    for name, theirs in outer.conditions.items():
        own = mine[name]
        if theirs is None:
            continue
        if name == "has":
            around = inner.has if inner.neighbours is None else inner.neighbours
            if not _holds(around or (), theirs):
                return False
        elif own is None or ((own != theirs) if name in EXACT else not set(own) <= set(theirs)):
            return False
    return True


def _holds(letters: Sequence[str], some: Sequence[str]) -> bool:
    """Whether a multiset holds another one."""
    return Counter(some) <= Counter(letters)
