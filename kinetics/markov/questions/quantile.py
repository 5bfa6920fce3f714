"""A quantile of a passage time: `quantile(min T, P>=0.9 [ F<=T B >= 1 ])`."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from kinetics.markov.chain import Chain
from kinetics.markov.derivatives import Derivatives
from kinetics.markov.questions.base import TIME, Question, Settled, settled_by
from kinetics.markov.questions.formula import StateFormula
from kinetics.markov.questions.reader import Cursor
from kinetics.markov.sensitivity import Sensitivity
from kinetics.support.answer import Answer
from kinetics.support.tables import of_unit

EXPECTED = "expected quantile(min T, P>=p [ F<=T phi ])"


@dataclass(frozen=True)
class QuantileQuestion(Question):
    """quantile(min T, P>=q [ F<=T target ]): the time by which a target is reached with probability q; inf if never.

    The notation is Storm's.

    >>> from kinetics.markov.questions import parse
    >>> parse("quantile(min T, P>=0.9 [ F<=T A = 0 ])")
    QuantileQuestion(target='A = 0', q=0.9)
    """

    forms: ClassVar = ("quantile(min T, P>=p [ F<=T phi ])",)
    examples: ClassVar = ("quantile(min T, P>=0.9 [ F<=T B >= 2 ])",)

    target: StateFormula
    q: float

    @classmethod
    def read(cls, text: Cursor) -> QuantileQuestion | None:
        """Read the word quantile, and what follows it."""
        if not text.takes("quantile", "("):
            return None
        text.expect("min", EXPECTED)
        variable = text.here.text
        if text.here.kind != "word":
            text.fail(EXPECTED)
        text.place += 1
        text.expect(",", EXPECTED)
        head = text.head()
        if head is None or head.letter != "P" or head.sign not in (">=", ">"):
            text.fail(EXPECTED)
        q, begin = float(head.limit), text.place
        if not 0.0 < q < 1.0:
            text.fail(f"p = {head.limit}; expected a probability between 0 and 1", begin)
        text.place = head.inside
        for word in ("F", "<=", variable):
            text.expect(word, EXPECTED)
        target = text.states()
        text.expect("]")
        text.expect(")")
        return cls(target, q)

    def value(self, chain: Chain) -> Answer:
        """The quantile, as `Chain.passage` gives it."""
        return chain.passage(self.target.states(chain)).answer(self.q)

    def derivatives(self, sensitivity: Sensitivity) -> Derivatives:
        """The derivatives, as `Sensitivity.passage_quantile` gives them."""
        return sensitivity.passage_quantile(self.target.states(sensitivity.chain), self.q)

    @property
    def counts_as(self) -> str:
        """The kind of the answer: a time."""
        return TIME

    def title(self, asked: str, unit: str) -> str:  # noqa: ARG002 - the notation is not needed
        """The quantile of a time."""
        return of_unit(f"{self.q:g}-quantile of the time until {self.target.text}", unit)

    @property
    def conditions(self) -> tuple[StateFormula, ...]:
        """The target."""
        return (self.target,)

    @property
    def settled(self) -> Settled | None:
        """The time is that at which the target is entered."""
        return settled_by(self.target, None)

    @property
    def unsampled(self) -> str:
        """Runs that have not arrived at their end would have to count."""
        return "a quantile has no answer here by runs; use `wellmixed passage --method ssa`"
