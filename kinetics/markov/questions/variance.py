"""The variance of a reward or of a passage time: `R[var]{"time"}=? [ F A = 0 ]`, `var[AB] @ 100`."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from kinetics.markov.chain import Chain, reward_asked
from kinetics.markov.derivatives import Derivatives
from kinetics.markov.questions.base import TIME, time_in_words
from kinetics.markov.questions.formula import StateFormula
from kinetics.markov.questions.reader import Cursor
from kinetics.markov.questions.rewarded import RewardedQuestion
from kinetics.markov.sensitivity import Sensitivity
from kinetics.markov.variances import squares_about, variance
from kinetics.support.answer import Answer
from kinetics.support.arrays import Floats
from kinetics.support.estimates import SampleEstimate, variance_estimate
from kinetics.support.tables import of_unit


@dataclass(frozen=True)
class VarianceQuestion(RewardedQuestion):
    """R[var]{"name"}=? [ ... ]: of a reward `at` a time, or of its total `until` a target. The notation is Storm's.

    var[name] @ t is short for R[var]{"name"}=? [ I=t ].

    >>> from kinetics.markov.questions import parse
    >>> parse('R[var]{"time"}=? [ F A = 0 ]')
    VarianceQuestion(name='time', at=None, until='A = 0')
    """

    forms: ClassVar = ('R[var]{"name"}=? [ I=t | F phi ]', "var[name] @ t")
    examples: ClassVar = (
        'R[var]{"time"}=? [ F B >= 2 ]',
        'R[var]{"A"}=? [ I=0.1 ]',
        'R[var]{"A"}=? [ F B >= 2 ]',
        "var[both] @ 0.2",
        "var[A] @ 0.2",
    )

    name: str | None = None
    at: float | None = None
    until: StateFormula | None = None

    @classmethod
    def read(cls, text: Cursor) -> VarianceQuestion | None:
        """Read an R of the measure var, with I or F, or a name and a time behind var."""
        if text.takes("var", "["):
            name, at = text.name_at("var[name] @ t")
            return cls(name, at=at)
        head = text.operator("R")
        if head is None or head.measure != "var":
            return None
        if text.takes("I"):
            text.expect("=", "expected I=t, as in I=100")
            found = cls(head.name, at=text.time())
        elif text.takes("F"):
            if text.bound() != (0.0, None):
                text.fail("a variance until a target takes no time bound")
            found = cls(head.name, until=text.states())
        else:
            text.fail("a variance is that of I=t, or until F phi")
        text.expect("]")
        return found

    def value(self, chain: Chain) -> Answer:
        """The variance, as `variances.variance` gives it."""
        return variance(chain, self.name, self.at, self._target(chain))

    def derivatives(self, sensitivity: Sensitivity) -> Derivatives:
        """Those of a passage time by its standard deviation, those at a time by the mean square about the mean."""
        chain, answer = sensitivity.chain, self.value(sensitivity.chain)
        if self.at is not None:
            rates = np.asarray(reward_asked(chain, self.name, self.at, None, None, False).rates)
            mean = sensitivity.means(rates[None, :], self.at)[0]
            # d var = d E[(f - c)^2] - 2 (mean - c) d mean, with c as good as the mean
            found = sensitivity.means(squares_about(rates, mean.answer.value)[None, :], self.at)[0]
            slopes = np.maximum(np.abs(mean.low), np.abs(mean.high))
            wide = 2.0 * mean.answer.error * slopes + 8.0 * 2.0**-53 * np.abs(found.value)
            low, high = found.low - 1.001 * wide, found.high + 1.001 * wide
            # a relative error of the squares is one of a path's score, too, which no bound is known of here
            return replace(found, answer=answer, low=low, high=high, is_bound=False)
        target = self._target(chain)
        if target is None or self.name != TIME or self.name in chain.rewards or self.name in chain.variables:
            raise ValueError('there are no derivatives of the variance of this reward; of "time" there are')
        spread = sensitivity.passage_sd(target)
        twice = 2.0 * spread.answer.value
        ends = np.outer([spread.answer.low, spread.answer.high], np.ones(spread.value.size)) * 2.0
        corners = np.array([each * end for each in (spread.low, spread.high) for end in ends])
        slack = 4.0 * 2.0**-53 * np.abs(corners).max(axis=0)
        low, high = corners.min(axis=0) - slack, corners.max(axis=0) + slack
        return replace(spread, answer=answer, value=twice * spread.value, low=low, high=high)

    def title(self, asked: str, unit: str) -> str:
        """The variance of a count, in its square."""
        if self.at is None or not self.name:
            return of_unit(f"variance: {asked}", unit and f"t in {unit}")
        return f"variance of {self.name} at {time_in_words(self.at, unit)} (count²)"

    def estimate(self, values: Floats, level: float) -> SampleEstimate:
        """The variance of the runs."""
        return variance_estimate(values, level)

    @property
    def unsampled(self) -> str:
        """Runs are looked at once."""
        return "the variance of a total has no answer by runs; allow more states"
