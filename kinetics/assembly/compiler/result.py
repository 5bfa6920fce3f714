"""The result of a compilation: a verified rule book, or the error that says why there is none."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from kinetics.assembly.rules.conditions import Senses
from kinetics.assembly.rules.rule_book import RuleBook

Notify = Callable[[str], None]  # called with what is being done, a line at a time


class InfeasibleError(ValueError):
    """No rule book does what is asked; the message says why, and what it would take."""


class UndecidedError(ValueError):
    """Neither a rule book nor a proof that there is none was found in time."""


@dataclass(frozen=True, eq=False)
class Compiled:
    """A rule book made from a target.

    minimal : whether no book with these joins has fewer letters, of those in which both cubes need a rule to bond and
        all structures of one shape have the same letters; False: not proven
    joins : the joins it allows, as `2.a+1->3.b`; structures of one size are lettered in the order of their
        canonical forms. For a book that grows from a seed, empty
    seconds : wall time of search and proof
    verified : how the book was proven, a sentence each
    """

    book: RuleBook
    minimal: bool
    joins: tuple[str, ...]
    seconds: float
    verified: tuple[str, ...]

    @property
    def letters(self) -> int:
        """How many letters the book has, that of a free cube among them."""
        return len(self.book.letters)

    @property
    def capability(self) -> str:
        """What the cubes sense, in words."""
        return sensing(self.book.senses)


def sensing(senses: Senses) -> str:
    """`two face types, roll, across`."""
    faces = {"one": "faces all alike", "two": "two face types", "six": "six face types"}.get(senses.faces, senses.faces)
    return ", ".join([faces, *(name for name in ("roll", "across", "touched") if getattr(senses, name))])
