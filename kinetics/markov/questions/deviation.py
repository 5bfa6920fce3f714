"""The standard deviation of a count at a time: `sd[AB] @ 100`."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import ClassVar

from kinetics.markov.chain import Chain
from kinetics.markov.questions.base import MEAN, AtTime, Question, at_time, time_in_words
from kinetics.markov.questions.formula import StateFormula
from kinetics.markov.questions.reader import Cursor
from kinetics.markov.questions.variance import VarianceQuestion
from kinetics.network import Model
from kinetics.support.answer import Answer
from kinetics.support.arrays import Floats
from kinetics.support.estimates import SampleEstimate, sd_estimate


@dataclass(frozen=True)
class DeviationQuestion(Question):
    """sd[name] @ t: the root of `var[name] @ t`, in the unit of the count.

    >>> from kinetics.markov.questions import parse
    >>> parse("sd[AB] @ 100")
    DeviationQuestion(name='AB', at=100.0)
    """

    forms: ClassVar = ("sd[name] @ t",)
    examples: ClassVar = ("sd[A] @ 0.2",)

    name: str
    at: float

    @classmethod
    def read(cls, text: Cursor) -> DeviationQuestion | None:
        """Read a name and a time behind sd."""
        return cls(*text.name_at("sd[name] @ t")) if text.takes("sd", "[") else None

    def value(self, chain: Chain) -> Answer:
        """The root of the variance and of its bounds, which its rounding moves by less than one float."""
        found = self._variance.value(chain)
        low, high = math.sqrt(found.low), math.sqrt(found.high)
        low, high = math.nextafter(low, 0.0), math.nextafter(high, math.inf) if high > 0.0 else 0.0
        return replace(found, value=math.sqrt(found.value), low=low, high=high)

    @property
    def _variance(self) -> VarianceQuestion:
        return VarianceQuestion(self.name, at=self.at)

    @property
    def counts_as(self) -> str:
        """The kind of the answer: as a mean, it has the unit of the count."""
        return MEAN

    def title(self, asked: str, unit: str) -> str:  # noqa: ARG002 - in words
        """The standard deviation of a count."""
        return f"standard deviation of {self.name} at {time_in_words(self.at, unit)} (count)"

    @property
    def conditions(self) -> tuple[StateFormula, ...]:
        """None."""
        return ()

    @property
    def sampling(self) -> AtTime:
        """A run contributes the count that it has at the time."""
        return at_time(self.name, self.at)

    def estimate(self, values: Floats, level: float) -> SampleEstimate:
        """The standard deviation of the runs."""
        return sd_estimate(values, level)

    def check(self, model: Model) -> None:
        """A ValueError if there is no such count."""
        self._variance.check(model)
