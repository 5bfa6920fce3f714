"""The probability that a chain stays in given states: `P=? [ G<=100 A >= 1 ]`."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from kinetics.markov.chain import Chain
from kinetics.markov.derivatives import Derivatives
from kinetics.markov.questions.base import Along, Decided, Question, Settled
from kinetics.markov.questions.reader import Bounded, Framed
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

    states: str
    by: float | None = None
    after: float = 0.0

    @classmethod
    def read(cls, asked: Framed) -> AlwaysQuestion | None:
        """Read a text that begins with G."""
        if asked.letter != "P" or not asked.begins_with("G"):
            return None
        after, by, states = Bounded.of(asked.inner[1:])
        return cls(states, by, after)

    def value(self, chain: Chain) -> Answer:
        """The probability, as `Chain.always` gives it."""
        return chain.always(self.states, self.by, after=self.after)

    def derivatives(self, sensitivity: Sensitivity) -> Derivatives:
        """The derivatives, as `Sensitivity.always` gives them."""
        return sensitivity.always(self.states, self.by, self.after)

    @property
    def conditions(self) -> tuple[str, ...]:
        """The states that must not be left."""
        return (self.states,)

    @property
    def settled(self) -> Settled | None:
        """The answer is decided outside of the states, if these count from the start."""
        return None if self.after else Settled(None, self.states)

    @property
    def sampling(self) -> Decided | Along | None:
        """A run ends where it leaves the states, and counts if it does not."""
        if self.by is None:
            return None
        if self.after:
            return Along(self.by, None, self._stays)
        return Decided(self.by, f"!({self.states})", lambda _, stopped, __: (~stopped).astype(float))

    def _stays(self, model: Model, _: Floats, left: Floats, states: Ints) -> float:
        """1 if a run is in the states all the interval long."""
        return float((Condition(self.states, model).holds(states) | (left < self.after)).all())
