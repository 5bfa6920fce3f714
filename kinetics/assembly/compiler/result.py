"""The result of a compilation: a verified rule book, or the error that says why there is none."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, NamedTuple

from kinetics.assembly.compiler.yields import Yields
from kinetics.assembly.rules.conditions import Senses
from kinetics.assembly.rules.rule_book import RuleBook

Notify = Callable[[str], None]  # called with what is being done, a line at a time


class InfeasibleError(ValueError):
    """No rule book does what is asked; the message says why, and what it would take."""


class UndecidedError(ValueError):
    """Neither a rule book nor a proof that there is none was found in time."""


class RuledOut(NamedTuple):
    """A number of letters with which there is no book: all was tried, in so many steps."""

    letters: int
    steps: int


@dataclass(frozen=True)
class Ruled:
    """Senses with which there is no book, or none was found.

    is_proof : whether there is none
    situations : what cubes cannot tell apart, each the join that must form and the meeting that must not; as JSON
    exhausted : numbers of letters that are proven not to do
    """

    senses: Senses
    text: str
    is_proof: bool
    situations: tuple[Any, ...]
    exhausted: tuple[RuledOut, ...]

    def __str__(self) -> str:
        return f"{sensing(self.senses)}: {'infeasible' if self.is_proof else 'not decided'}"


@dataclass(frozen=True)
class Certificate:
    """What is claimed of a compiled book, for a checker that shares no code with the compiler.

    fingerprint : of the book
    is_fewest : whether fewer letters are claimed not to do
    any_joins : whether that holds for all sets of joins, or for the book's own alone
    exhausted : how many steps it took to try all with fewer letters
    weaker : senses that are claimed not to do
    """

    target: str
    fingerprint: str
    letters: int
    is_fewest: bool
    any_joins: bool
    joins: tuple[str, ...]
    exhausted: tuple[RuledOut, ...]
    weaker: tuple[Ruled, ...]

    def as_json(self) -> dict[str, Any]:
        """Plain lists and numbers."""
        return {
            "target": self.target,
            "fingerprint": self.fingerprint,
            "letters": self.letters,
            "is_fewest": self.is_fewest,
            "any_joins": self.any_joins,
            "joins": list(self.joins),
            "exhausted": [each._asdict() for each in self.exhausted],
            "weaker_senses": [
                {
                    "senses": each.senses.as_dict(),
                    "situations": list(each.situations),
                    "exhausted": [tried._asdict() for tried in each.exhausted],
                }
                for each in self.weaker
            ],
        }


@dataclass(frozen=True, eq=False)
class Compiled:
    """A rule book made from a target.

    minimal : whether no book of the kind that `searched` names has fewer letters; False: not proven
    joins : the joins it allows, as `2.a+1->3.b`; structures of one size are lettered in the order of their
        canonical forms. For a book that grows from a seed, empty
    searched : among which books, and how far, a sentence each
    verified : how the book was proven, a sentence each
    certificate : None for a book that grows from a seed
    yields : of the book; None for one that grows from a seed, where every seed becomes a target
    gain : how much a longer search could raise the mean yield, by the sets of joins that were compared; None where the
        joins were given, or the book grows from a seed
    """

    book: RuleBook
    minimal: bool
    joins: tuple[str, ...]
    searched: tuple[str, ...]
    verified: tuple[str, ...]
    certificate: Certificate | None
    yields: Yields | None = None
    gain: float | None = None

    @property
    def letters(self) -> int:
        """How many letters the book has, that of a free cube among them."""
        return len(self.book.letters)

    @property
    def capability(self) -> str:
        """The senses of the cubes, as text."""
        return sensing(self.book.senses)


def sensing(senses: Senses) -> str:
    """`two face types, roll, across`."""
    faces = {"one": "faces all alike", "two": "two face types", "six": "six face types"}.get(senses.faces, senses.faces)
    return ", ".join([faces, *(name for name in ("roll", "across", "touched") if getattr(senses, name))])
