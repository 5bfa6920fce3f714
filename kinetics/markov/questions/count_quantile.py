"""A quantile of a count at a time: `q0.9[AB] @ 100`."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from kinetics.markov.chain import Chain
from kinetics.markov.count_quantile import count_quantile
from kinetics.markov.questions.base import time_in_words
from kinetics.markov.questions.reader import Cursor
from kinetics.markov.questions.rewarded import RewardedQuestion
from kinetics.support.answer import Answer
from kinetics.support.arrays import Floats
from kinetics.support.estimates import SampleEstimate, quantile_estimate


@dataclass(frozen=True)
class CountQuantileQuestion(RewardedQuestion):
    """qP[name] @ t: the least count that is not exceeded at time t, tu, with probability P or more.

    >>> from kinetics.markov.questions import parse
    >>> parse("q0.9[AB] @ 100")
    CountQuantileQuestion(name='AB', at=100.0, q=0.9)
    """

    forms: ClassVar = ("q0.9[name] @ t",)
    examples: ClassVar = ("q0.9[A] @ 0.2", "q.1[both] @ 0.2", "q1e-1[B] @ 0.2")

    name: str
    at: float
    q: float

    @classmethod
    def read(cls, text: Cursor) -> CountQuantileQuestion | None:
        """Read a q with a probability, a name in brackets and a time."""
        begin, q = text.place, text.number_after("q", "[")
        if q is None:
            return None
        if not 0.0 < q < 1.0:
            text.fail(f"quantile {q:g}; expected a probability between 0 and 1, as in q0.9", begin)
        text.expect("[")
        return cls(*text.name_at("q0.9[name] @ t"), q)

    def value(self, chain: Chain) -> Answer:
        """The quantile, as `count_quantile` gives it."""
        return count_quantile(chain, self.name, self.at, self.q)

    def title(self, asked: str, unit: str) -> str:  # noqa: ARG002 - the notation is not needed
        """The quantile of a count."""
        return f"{self.q:g}-quantile of {self.name} at {time_in_words(self.at, unit)} (count)"

    def estimate(self, values: Floats, level: float) -> SampleEstimate:
        """The quantile of the runs."""
        return quantile_estimate(values, self.q, level)
