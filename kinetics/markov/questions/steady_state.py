"""The probability of given states after infinite time: `S=? [ A >= 1 ]`."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from kinetics.markov.by_state import StateAnswers, steady_by_state
from kinetics.markov.chain import Chain
from kinetics.markov.derivatives import Derivatives
from kinetics.markov.questions.base import Question
from kinetics.markov.questions.formula import Mask, StateFormula
from kinetics.markov.questions.reader import Cursor
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

    states: StateFormula

    @classmethod
    def read(cls, text: Cursor) -> SteadyStateQuestion | None:
        """Read an S; any condition may follow."""
        if not text.operator("S"):
            return None
        states = text.states()
        text.expect("]")
        return cls(states)

    def value(self, chain: Chain) -> Answer:
        """The probability, as `Chain.steady_state` gives it."""
        return chain.steady_state(self.states.states(chain))

    def by_state(self, chain: Chain, _: Mask) -> StateAnswers:
        """The probability from every state, which differ if several closed classes can be reached."""
        return steady_by_state(chain, chain.states(self.states.states(chain)).astype(float))

    def derivatives(self, sensitivity: Sensitivity) -> Derivatives:
        """The derivatives, as `Sensitivity.steady_state` gives them."""
        return sensitivity.steady_state(self.states.states(sensitivity.chain))

    def title(self, asked: str, unit: str) -> str:  # noqa: ARG002 - the notation is not needed
        """The probability of the states."""
        return f"probability of {self.states.text} in the steady state"

    @property
    def conditions(self) -> tuple[StateFormula, ...]:
        """The states."""
        return (self.states,)
