"""The probability that a chain stays in given states: `P=? [ G<=100 A >= 1 ]`."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from kinetics.markov.chain import Chain
from kinetics.markov.derivatives import Derivatives
from kinetics.markov.questions.base import Decided, Question, Settled
from kinetics.markov.questions.reader import Framed, bounded
from kinetics.markov.sensitivity import Sensitivity
from kinetics.support.answer import Answer


@dataclass(frozen=True)
class AlwaysQuestion(Question):
    """P=? [ G<=by states ]; for ever without `by`.

    >>> from kinetics.markov.questions import parse
    >>> parse("P=? [ G<=2 A > 0 ]")
    AlwaysQuestion(states='A > 0', by=2.0)
    """

    forms: ClassVar = ("P=? [ G phi ]",)
    examples: ClassVar = ("P=? [ G<=0.2 A >= 2 ]", "P=? [ G both = 3 ]")

    states: str
    by: float | None = None

    @classmethod
    def read(cls, asked: Framed) -> AlwaysQuestion | None:
        """G at the beginning."""
        if asked.letter != "P" or not asked.begins_with("G"):
            return None
        by, states = bounded(asked.inner[1:])
        return cls(states, by)

    def value(self, chain: Chain) -> Answer:
        """As `Chain.always` has it."""
        return chain.always(self.states, self.by)

    def derivatives(self, sensitivity: Sensitivity) -> Derivatives:
        """As `Sensitivity.always` has them."""
        return sensitivity.always(self.states, self.by)

    @property
    def conditions(self) -> tuple[str, ...]:
        """The states that must not be left."""
        return (self.states,)

    @property
    def settled(self) -> Settled | None:
        """It is settled outside of the states."""
        return Settled(None, self.states)

    @property
    def sampling(self) -> Decided | None:
        """A run ends where it leaves the states, and counts if it does not."""
        if self.by is None:
            return None
        return Decided(self.by, f"!({self.states})", lambda _, stopped, __: (~stopped).astype(float))
