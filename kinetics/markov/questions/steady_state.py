"""The probability of given states after infinite time: `S=? [ A >= 1 ]`."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from kinetics.markov.chain import Chain
from kinetics.markov.derivatives import Derivatives
from kinetics.markov.questions.base import Question
from kinetics.markov.questions.reader import Framed
from kinetics.markov.sensitivity import Sensitivity
from kinetics.support.answer import Answer


@dataclass(frozen=True)
class SteadyStateQuestion(Question):
    """S=? [ states ].

    >>> from kinetics.markov.questions import parse
    >>> parse("S=? [ A > 0 ]")
    SteadyStateQuestion(states='A > 0')
    """

    forms: ClassVar = ("S=? [ phi ]",)
    examples: ClassVar = ("S=? [ A >= 2 ]",)

    states: str

    @classmethod
    def read(cls, asked: Framed) -> SteadyStateQuestion | None:
        """Read a text that begins with S; any condition may follow."""
        return cls(asked.inner) if asked.letter == "S" else None

    def value(self, chain: Chain) -> Answer:
        """The probability, as `Chain.steady_state` gives it."""
        return chain.steady_state(self.states)

    def derivatives(self, sensitivity: Sensitivity) -> Derivatives:
        """The derivatives, as `Sensitivity.steady_state` gives them."""
        return sensitivity.steady_state(self.states)

    @property
    def conditions(self) -> tuple[str, ...]:
        """The states."""
        return (self.states,)
