"""The probability that the next jump leads to given states: `P=? [ X A >= 1 ]`."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from kinetics.markov.by_state import StateAnswers, next_by_state
from kinetics.markov.chain import Chain
from kinetics.markov.derivatives import Derivatives
from kinetics.markov.questions.base import Question
from kinetics.markov.questions.formula import Mask, StateFormula
from kinetics.markov.questions.reader import Cursor
from kinetics.markov.sensitivity import Sensitivity
from kinetics.support.answer import Answer


@dataclass(frozen=True)
class NextQuestion(Question):
    """P=? [ X states ]; a state that no rate leads from is its own next one, as in PRISM and Storm.

    >>> from kinetics.markov.questions import parse
    >>> parse("P=? [ X A > 0 ]")
    NextQuestion(states='A > 0')
    """

    forms: ClassVar = ("P=? [ X phi ]",)
    examples: ClassVar = ("P=? [ X B >= 1 ]", "P=? [ X P>0.9 [ X B = 1 | B = 2 ] & B = 1 ]")

    states: StateFormula

    @classmethod
    def read(cls, text: Cursor) -> NextQuestion | None:
        """Read a P with X."""
        path = text.path() if text.operator("P") else None
        if path is None or path.word != "X" or text.sees("||"):
            return None
        text.expect("]")
        return cls(path.target)

    def value(self, chain: Chain) -> Answer:
        """The probability, by the rates of the states at the start."""
        return self._by_state(chain).mean(chain.initial)

    def by_state(self, chain: Chain, _: Mask) -> StateAnswers:
        """The probability from every state."""
        return self._by_state(chain)

    def _by_state(self, chain: Chain) -> StateAnswers:
        return next_by_state(chain, self.states.states(chain))

    def derivatives(self, sensitivity: Sensitivity) -> Derivatives:
        """The derivatives, as `Sensitivity.next_jump` gives them."""
        return sensitivity.next_jump(self.states.states(sensitivity.chain))

    @property
    def conditions(self) -> tuple[StateFormula, ...]:
        """The states."""
        return (self.states,)

    @property
    def unsampled(self) -> str:
        """What decides is the first jump, which the rates give."""
        return "one jump is solved, not sampled; allow more states"
