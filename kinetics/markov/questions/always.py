"""The probability that a chain stays in given states: `P=? [ G<=100 A >= 1 ]`."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from kinetics.markov.by_state import StateAnswers, always_by_state
from kinetics.markov.chain import Chain
from kinetics.markov.derivatives import Derivatives
from kinetics.markov.questions.base import Along, Decided, Question, Settled, settled_by, time_in_words
from kinetics.markov.questions.formula import Mask, StateFormula
from kinetics.markov.questions.reader import Cursor
from kinetics.markov.sensitivity import Sensitivity
from kinetics.network import Model
from kinetics.network.predicates import Condition
from kinetics.support.answer import Answer
from kinetics.support.arrays import Floats, Ints


@dataclass(frozen=True)
class AlwaysQuestion(Question):
    """P=? [ G[after,by] states ]; for ever without `by`.

    >>> from kinetics.markov.questions import parse
    >>> parse("P=? [ G<=2 A > 0 ]")
    AlwaysQuestion(states='A > 0', by=2.0, after=0.0)
    """

    forms: ClassVar = ("P=? [ G phi ]",)
    examples: ClassVar = ("P=? [ G[0.1,0.2] A >= 2 ]", "P=? [ G<=0.2 A >= 2 ]", "P=? [ G both = 3 ]")

    states: StateFormula
    by: float | None = None
    after: float = 0.0

    @classmethod
    def read(cls, text: Cursor) -> AlwaysQuestion | None:
        """Read a P with G."""
        path = text.path() if text.operator("P") else None
        if path is None or path.word != "G" or text.sees("||"):
            return None
        text.expect("]")
        return cls(path.target, path.by, path.after)

    def value(self, chain: Chain) -> Answer:
        """The probability, as `Chain.always` gives it."""
        return chain.always(self.states.states(chain), self.by, after=self.after)

    def by_state(self, chain: Chain, _: Mask) -> StateAnswers:
        """The probability from every state."""
        return always_by_state(chain, self.states.states(chain), self.by, self.after)

    def derivatives(self, sensitivity: Sensitivity) -> Derivatives:
        """The derivatives, as `Sensitivity.always` gives them."""
        return sensitivity.always(self.states.states(sensitivity.chain), self.by, self.after)

    def title(self, asked: str, unit: str) -> str:
        """The probability of staying in the states."""
        if self.after:
            return super().title(asked, unit)
        by = "for ever" if self.by is None else f"up to {time_in_words(self.by, unit)}"
        return f"probability of {self.states.text} {by}"

    @property
    def conditions(self) -> tuple[StateFormula, ...]:
        """The states that must not be left."""
        return (self.states,)

    @property
    def settled(self) -> Settled | None:
        """The answer is decided outside of the states, if these count from the start."""
        return None if self.after else settled_by(None, self.states)

    @property
    def sampling(self) -> Decided | Along | None:
        """A run ends where it leaves the states, and counts if it does not."""
        if self.by is None or self.states.nested:
            return None
        if self.after:
            return Along(self.by, None, self._stays)
        return Decided(self.by, f"!({self.states.text})", lambda _, stopped, __: (~stopped).astype(float))

    def _stays(self, model: Model, _: Floats, left: Floats, states: Ints) -> float:
        """1 if a run is in the states all the interval long."""
        return float((Condition(self.states.text, model).holds(states) | (left < self.after)).all())
