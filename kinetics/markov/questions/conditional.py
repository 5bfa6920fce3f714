"""The probability that a target is reached, given that another is: `P=? [ F<=5 a || F b ]`."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from kinetics.markov.chain import Chain
from kinetics.markov.conditional import conditional
from kinetics.markov.questions.base import Question
from kinetics.markov.questions.formula import StateFormula
from kinetics.markov.questions.reader import Cursor
from kinetics.support.answer import Answer


@dataclass(frozen=True)
class ConditionalQuestion(Question):
    """P=? [ F<=by target || F<=given_by given ]; without a time, for ever. The notation is Storm's.

    >>> from kinetics.markov.questions import parse
    >>> parse("P=? [ F<=2 A = 0 || F B = 3 ]")
    ConditionalQuestion(target='A = 0', given='B = 3', by=2.0, given_by=None)
    """

    forms: ClassVar = ("P=? [ F phi || F psi ]",)
    examples: ClassVar = (
        "P=? [ F<=0.3 A = 1 || F<=0.5 B >= 1 ]",
        "P=? [ F<=0.3 B = 3 || F<=0.3 B >= 1 ]",
        "P=? [ F B = 3 || F<=0.2 B >= 2 ]",
    )

    target: StateFormula
    given: StateFormula
    by: float | None = None
    given_by: float | None = None

    @classmethod
    def read(cls, text: Cursor) -> ConditionalQuestion | None:
        """Read a P with two paths that || keeps apart."""
        begin = text.place
        one = text.path() if text.operator("P") else None
        if one is None or not text.takes("||"):
            return None
        other = text.path()
        if other is None or {one.word, other.word} != {"F"} or one.after or other.after:
            text.fail("only F phi and F<=t phi are answered on both sides of ||", begin)
        text.expect("]")
        return cls(one.target, other.target, one.by, other.by)

    def value(self, chain: Chain) -> Answer:
        """The quotient of two probabilities."""
        return conditional(chain, self.target.states(chain), self.given.states(chain), self.by, self.given_by)

    @property
    def conditions(self) -> tuple[StateFormula, ...]:
        """Both targets."""
        return self.target, self.given

    @property
    def unsampled(self) -> str:
        """Few runs may do what is given."""
        return "a conditional probability has no answer by runs; allow more states, or ask for two probabilities"
