"""What the answers from given states are together: `filter(max, P=? [ F<=10 A = 0 ], A > 2)`."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from kinetics.markov.by_state import StateAnswers
from kinetics.markov.chain import Chain
from kinetics.markov.questions.base import MEAN, Question
from kinetics.markov.questions.formula import Mask, StateFormula, Truths, state_name
from kinetics.markov.questions.reader import Cursor
from kinetics.markov.transient.poisson import ROUNDOFF
from kinetics.network import Model
from kinetics.support.answer import Answer, TruthValue, kind_of
from kinetics.support.arrays import Floats
from kinetics.support.tables import counted

OF_NUMBERS = ("min", "max", "avg", "sum", "argmin", "argmax")
OF_TRUTHS = ("count", "forall", "exists")
OF_BOTH = ("state", "first")
OPERATIONS = (*OF_NUMBERS, *OF_TRUTHS, *OF_BOTH)


@dataclass(frozen=True)
class FilterQuestion(Question):
    """filter(op, asked, states), as in PRISM: an operation on the answers from the states in which a condition holds.

    op : of numbers min, max, avg, sum, argmin, argmax (the number of the state); of truths count, forall, exists; of
        both state (of the only one) and first
    asked : a question, or a condition, which may hold questions
    states : all of them if None

    >>> from kinetics.markov.questions import parse
    >>> parse("filter(max, S=? [ A = 0 ], B > 1)")
    FilterQuestion(op='max', asked=SteadyStateQuestion(states='A = 0'), states='B > 1')
    """

    forms: ClassVar = ("filter(op, question, states)",)
    examples: ClassVar = (
        "filter(max, P=? [ F<=0.2 B >= 2 ], A >= 2)",
        "filter(min, P=? [ A >= 1 U[0.1,0.2] B >= 2 ], A >= 1)",
        'filter(avg, R{"B"}=? [ C<=0.3 ], A >= 1)',
        'filter(sum, R{"time"}=? [ F B >= 2 ], A >= 1)',
        "filter(count, P>0.5 [ F<=0.2 B >= 2 ] & A >= 1)",
        "filter(forall, S>0.1 [ B >= 2 ])",
        "filter(exists, P>0.5 [ X B >= 2 ], A = 2)",
        "filter(first, quantile(min T, P>=0.5 [ F<=T B >= 2 ]), A = 2)",
        "filter(state, P=? [ G<=0.2 A >= 2 ], A = 2)",
        "filter(argmax, P=? [ F<=0.2 B = 0 ], A <= 2)",
    )

    op: str
    asked: Question | StateFormula
    states: StateFormula | None = None

    @classmethod
    def read(cls, text: Cursor) -> FilterQuestion | None:
        """Read the word filter, and what follows it."""
        if not text.takes("filter", "("):
            return None
        op = text.here.text
        if op not in OPERATIONS:
            text.fail(f"unknown operation {op!r} of a filter; there are {', '.join(OPERATIONS)}")
        text.place += 1
        text.expect(",")
        begin, asked = text.place, text.question()
        goes_on = asked is not None and asked.is_truth and not (text.sees(",") or text.sees(")"))
        if asked is None or goes_on:  # a condition, which may begin with a question
            text.place = begin
            asked = text.states(",")
        if op not in OF_BOTH and asked.is_truth != (op in OF_TRUTHS):
            wanted = "what is true or false, as P>0.5 [ ... ]" if op in OF_TRUTHS else "numbers, as P=? [ ... ]"
            text.fail(f"filter({op}, ...) is of {wanted}", begin)
        states = text.states() if text.takes(",") else None
        text.expect(")")
        return cls(op, asked, states)

    def value(self, chain: Chain) -> Answer:
        """The operation on the answers from all states at once, where one solution gives them."""
        among = np.ones(len(chain), dtype=bool) if self.states is None else chain.states(self.states.states(chain))
        if not among.any():
            raise ValueError("the states of the filter are none; expected a condition that holds somewhere")
        if self.op == "state" and among.sum() != 1:
            raise ValueError(f"filter(state, ...) is of one state, and its condition holds in {among.sum()}; use first")
        if self.op in OF_BOTH:
            among = np.arange(among.size) == np.argmax(among)
        if isinstance(self.asked, StateFormula) or self.asked.is_truth:
            return self._of_truths(chain, among, self.asked.truths(chain))
        return self._of_numbers(chain, among, self.asked.by_state(chain, among))

    @property
    def is_truth(self) -> bool:
        """Whether the answer is true or false."""
        return self.op in ("forall", "exists") or (self.op in OF_BOTH and self.asked.is_truth)

    def _of_truths(self, chain: Chain, among: Mask, truths: Truths) -> Answer:
        sure, possible, why = truths
        low, high, n = int((sure & among).sum()), int((possible & among).sum()), int(among.sum())
        answer = Answer(float(low), float(low), float(high), method="all states", why=counted(n, "state"))
        if self.op == "count":
            return answer
        needed = n if self.op == "forall" else 1
        if low >= needed or high < needed:
            return TruthValue.sure(low >= needed, answer)
        row = int(np.flatnonzero(possible & ~sure & among)[0])
        reasons = [bounds.in_words(row) for places, bounds in why if places[row]]
        return TruthValue.undecided(f"in {state_name(chain, row)}, {', and '.join(reasons)}", answer)

    def _of_numbers(self, chain: Chain, among: Mask, found: StateAnswers) -> Answer:
        if self.op.startswith("arg"):
            return self._extreme(chain, among, found)
        value, low, high = (float(self._together(each[among])) for each in (found.value, found.low, found.high))
        why = counted(int(among.sum()), "state")
        answer = Answer(value, low, high, kind_of(found.is_bound), found.method, found.cpu_seconds, why)
        return answer.inflated(ROUNDOFF * (int(among.sum()) + 1)) if self.op in ("avg", "sum") else answer

    def _together(self, values: Floats) -> Any:
        match self.op:
            case "min":
                return values.min()
            case "max" | "state" | "first":
                return values.max()
            case "sum":
                return values.sum()
        return values.mean()

    def _extreme(self, chain: Chain, among: Mask, found: StateAnswers) -> Answer:
        """The number of the one state in which the answer is certainly smallest, or largest."""
        low, high = (found.low, found.high) if self.op == "argmin" else (-found.high, -found.low)
        candidates = np.flatnonzero(among & (low <= high[among].min()))
        if candidates.size > 1:
            names = ", ".join(state_name(chain, int(row)) for row in candidates[:3])
            return Answer.none(f"{candidates.size} states are equal within the bound: {names}")
        row = float(candidates[0])
        kind = kind_of(found.is_bound)
        return Answer(row, row, row, kind, found.method, found.cpu_seconds, state_name(chain, int(row)))

    @property
    def counts_as(self) -> str:
        """The kind of the answer: that of what is asked."""
        return self.asked.counts_as if isinstance(self.asked, Question) else MEAN

    @property
    def conditions(self) -> tuple[StateFormula, ...]:
        """The states, and what is asked of them if it is a condition."""
        own = () if self.states is None else (self.states,)
        return (*own, self.asked) if isinstance(self.asked, StateFormula) else (*own, *self.asked.conditions)

    @property
    def unsampled(self) -> str:
        """Runs have one start."""
        return "a filter is of many starts; allow more states"

    def check(self, model: Model) -> None:
        """A ValueError if what is asked names something that there is not, too."""
        super().check(model)
        if isinstance(self.asked, Question):
            self.asked.check(model)
