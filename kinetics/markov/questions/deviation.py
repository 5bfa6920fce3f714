"""The standard deviation of a count at a time: `sd[AB] @ 100`."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import ClassVar

from kinetics.markov.chain import Chain
from kinetics.markov.questions.base import time_in_words
from kinetics.markov.questions.reader import Cursor
from kinetics.markov.questions.rewarded import RewardedQuestion
from kinetics.markov.questions.variance import VarianceQuestion
from kinetics.support.answer import Answer
from kinetics.support.arrays import Floats
from kinetics.support.estimates import SampleEstimate, sd_estimate


@dataclass(frozen=True)
class DeviationQuestion(RewardedQuestion):
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
        found = VarianceQuestion(self.name, at=self.at).value(chain)
        low, high = math.sqrt(found.low), math.sqrt(found.high)
        low, high = math.nextafter(low, 0.0), math.nextafter(high, math.inf) if high > 0.0 else 0.0
        return replace(found, value=math.sqrt(found.value), low=low, high=high)

    def title(self, asked: str, unit: str) -> str:  # noqa: ARG002 - the notation is not needed
        """The standard deviation of a count."""
        return f"standard deviation of {self.name} at {time_in_words(self.at, unit)} (count)"

    def estimate(self, values: Floats, level: float) -> SampleEstimate:
        """The standard deviation of the runs."""
        return sd_estimate(values, level)
