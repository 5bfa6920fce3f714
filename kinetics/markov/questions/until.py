"""The probability that a target is reached, through given states: `P=? [ F<=100 B >= 1 ]`, `P=? [ A U[2,5] B ]`."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from kinetics.markov.by_state import StateAnswers, until_by_state
from kinetics.markov.chain import Chain, Target
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
class UntilQuestion(Question):
    """P=? [ through U[after,by] target ]; F if there is no `through`; without `by`, time is unbounded.

    >>> from kinetics.markov.questions import parse
    >>> parse("P=? [ A > 0 U<=2 B = 3 ]")
    UntilQuestion(target='B = 3', through='A > 0', by=2.0, after=0.0)
    """

    forms: ClassVar = ("P=? [ F phi ]", "P=? [ phi U psi ]")
    examples: ClassVar = (
        "P=? [ F[0.1,0.3] B >= 2 ]",
        "P=? [ A >= 1 U[0.1,0.3] B >= 2 ]",
        "P=? [ F<=0.2 B >= 2 ]",
        "P=? [ A >= 2 U<=0.3 B >= 2 ]",
        "P=? [ both = 3 & B < 2 U A = 0 ]",
    )

    target: StateFormula
    through: StateFormula | None = None
    by: float | None = None
    after: float = 0.0

    @classmethod
    def read(cls, text: Cursor) -> UntilQuestion | None:
        """Read a P with F, or with U between two conditions."""
        path = text.path() if text.operator("P") else None
        if path is None or path.word not in ("F", "U") or text.sees("||"):
            return None
        text.expect("]")
        return cls(path.target, path.through, path.by, path.after)

    def value(self, chain: Chain) -> Answer:
        """The probability, as `Chain.until` gives it."""
        return chain.until(*self._states(chain), self.by, after=self.after)

    def by_state(self, chain: Chain, _: Mask) -> StateAnswers:
        """The probability from every state."""
        return until_by_state(chain, *self._states(chain), self.by, self.after)

    def derivatives(self, sensitivity: Sensitivity) -> Derivatives:
        """The derivatives, as `Sensitivity.until` gives them."""
        return sensitivity.until(*self._states(sensitivity.chain), self.by, self.after)

    def _states(self, chain: Chain) -> tuple[Target, Target | None]:
        return self.target.states(chain), None if self.through is None else self.through.states(chain)

    def title(self, asked: str, unit: str) -> str:
        """The probability of reaching the target."""
        if self.after:
            return super().title(asked, unit)
        way = "" if self.through is None else f" through {self.through.text}"
        by = "" if self.by is None else f" by {time_in_words(self.by, unit)}"
        return f"probability of reaching {self.target.text}{way}{by}"

    @property
    def conditions(self) -> tuple[StateFormula, ...]:
        """The target, and the states on the way to it."""
        return (self.target,) if self.through is None else (self.target, self.through)

    @property
    def settled(self) -> Settled | None:
        """The answer is decided outside of the states on the way, and in the target if that counts from the start."""
        if self.after:
            return settled_by(None, self.through) if self.through is not None else None
        return settled_by(self.target, self.through)

    @property
    def sampling(self) -> Decided | Along | None:
        """A run ends where it is settled, and counts if that is the target."""
        if self.by is None or any(formula.nested for formula in self.conditions):
            return None
        if self.after:
            return Along(self.by, None if self.through is None else f"!({self.through.text})", self._reaches)
        stop = f"({self.target.text})" + (f" | !({self.through.text})" if self.through is not None else "")

        def fulfils(model: Model, stopped: NDArray[np.bool_], counts: Ints) -> Floats:
            return (stopped & Condition(self.target.text, model).holds(counts)).astype(float)

        return Decided(self.by, stop, fulfils)

    def _reaches(self, model: Model, entered: Floats, left: Floats, states: Ints) -> float:
        """1 if a run is in the target in the interval, and was on the way until then."""
        there = Condition(self.target.text, model).holds(states) & (left >= self.after)
        if self.through is not None:
            astray = ~Condition(self.through.text, model).holds(states)
            lost = np.cumsum(astray)
            there &= (lost == 0) | ((lost == 1) & astray & (entered >= self.after))
        return float(there.any())
