"""Whether an answer lies on one side of a limit: `P>=0.9 [ F<=10 A = 0 ]`, also inside of a condition."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar, NamedTuple

import numpy as np

from kinetics.markov.by_state import StateAnswers
from kinetics.markov.chain import Chain
from kinetics.markov.passage.until import InfiniteMeanError
from kinetics.markov.questions.base import Along, AtTime, Decided, Question, Settled
from kinetics.markov.questions.formula import StateFormula, Truths
from kinetics.markov.questions.reader import LIMITS, Cursor
from kinetics.network import Model
from kinetics.support.answer import Answer, TruthValue, beyond
from kinetics.support.arrays import Floats
from kinetics.support.estimates import SampleEstimate


class ComparedBounds(NamedTuple):
    """The answers from every state, and the limit that they are compared with."""

    answers: StateAnswers
    sign: str
    limit: str

    def in_words(self, row: int) -> str:
        """The bounds in one state."""
        low, high = self.answers.low[row], self.answers.high[row]
        return f"the answer lies between {low:.17g} and {high:.17g}, which does not decide {self.sign} {self.limit}"


@dataclass(frozen=True)
class ComparisonQuestion(Question):
    """P>=p [ ... ], and likewise R and S, with <, <=, > and >=: true, false, or not decided within the bound.

    asked : the question with =? for the limit; limit : a number as text, taken exactly
    From a start spread over several states, the mean of the answer is compared.

    >>> from kinetics.markov.questions import parse
    >>> parse("P>=0.5 [ F<=2 A = 0 ]")
    ComparisonQuestion(asked=UntilQuestion(target='A = 0', through=None, by=2.0, after=0.0), sign='>=', limit='0.5')
    """

    forms: ClassVar = ("P>=p [ ... ]", "S>=p [ ... ]", 'R{"name"}>=x [ ... ]')
    examples: ClassVar = (
        "P>=0.5 [ F<=0.4 B >= 2 ]",
        "S<0.3 [ A >= 2 ]",
        'R{"B"}>1 [ I=0.3 ]',
        "P<=0.7 [ G<=0.2 P>0.1 [ F<=0.1 B >= 2 ] ]",
    )

    asked: Question
    sign: str
    limit: str

    @classmethod
    def read(cls, text: Cursor) -> ComparisonQuestion | None:
        """Read an operator with a limit, of a question that another kind reads."""
        head = text.head()
        if head is None or head.sign not in LIMITS:
            return None
        if not math.isfinite(float(head.limit)):
            text.fail("a limit beyond 1e308")
        inner = text.value_of(head)
        asked = inner.question()
        if asked is None:
            text.fail(f"what is asked of {head.letter} cannot be read")
        text.place = inner.place
        return cls(asked, head.sign, head.limit)

    def value(self, chain: Chain) -> Answer:
        """Whether the answer from the start lies on that side of the limit."""
        try:
            answer = self.asked.value(chain)
        except InfiniteMeanError:
            answer = Answer(math.inf, math.inf, math.inf, method="linear equations")
        return TruthValue.of(answer, self.sign, self.limit)

    def truths(self, chain: Chain) -> Truths:
        """The states from which the answer certainly lies on that side of the limit, and those from which it may.

        ValueError: the bounds are not proven
        """
        answers = self.asked.by_state(chain, np.ones(len(chain), dtype=bool))
        if not answers.is_bound:
            raise ValueError(
                f"the bounds of an answer ({answers.method}) are not proven, so that no state is certain to be in a "
                f"condition; ask for it alone"
            )
        above, below = beyond(answers.low, answers.high, self.sign, self.limit)
        doubts = ~above & ~below
        why = ((doubts, ComparedBounds(answers, self.sign, self.limit)),) if doubts.any() else ()
        return Truths(above, ~below, why)

    @property
    def is_truth(self) -> bool:
        """Whether the answer is true or false: yes."""
        return True

    @property
    def counts_as(self) -> str:
        """The kind of what is compared."""
        return self.asked.counts_as

    @property
    def conditions(self) -> tuple[StateFormula, ...]:
        """The conditions of the question that is compared."""
        return self.asked.conditions

    @property
    def settled(self) -> Settled | None:
        """As of what is compared."""
        return self.asked.settled

    @property
    def sampling(self) -> AtTime | Decided | Along | None:
        """As of what is compared."""
        return self.asked.sampling

    @property
    def unsampled(self) -> str:
        """As of what is compared."""
        return self.asked.unsampled

    def estimate(self, values: Floats, level: float) -> SampleEstimate:
        """As of what is compared."""
        return self.asked.estimate(values, level)

    def concluded(self, answer: Answer) -> Answer:
        """Whether the interval of the runs lies on that side of the limit."""
        return TruthValue.of(answer, self.sign, self.limit)

    def check(self, model: Model) -> None:
        """As of what is compared."""
        self.asked.check(model)
