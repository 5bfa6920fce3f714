"""The mean of a reward: `R{"heat"}=? [ C<=100 ]`, `E[AB] @ 100`, and of a time: `R{"time"}=? [ F A = 0 ]`."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from kinetics.markov.by_state import StateAnswers, reward_by_state
from kinetics.markov.chain import Chain
from kinetics.markov.derivatives import Derivatives
from kinetics.markov.observing import reward_rates
from kinetics.markov.questions.base import (
    MEAN,
    TIME,
    Along,
    AtTime,
    at_time,
    time_in_words,
)
from kinetics.markov.questions.formula import Mask, StateFormula
from kinetics.markov.questions.reader import Cursor
from kinetics.markov.questions.rewarded import RewardedQuestion
from kinetics.markov.sensitivity import Sensitivity
from kinetics.network import Model
from kinetics.support.answer import Answer
from kinetics.support.arrays import Floats, Ints
from kinetics.support.tables import of_unit


@dataclass(frozen=True)
class RewardQuestion(RewardedQuestion):
    """R{"name"}=? [ ... ]: its rate `at` a time, its total `up_to` a time or `until` a target; else its steady rate.

    up_to : inf for the total of all time

    >>> from kinetics.markov.questions import parse
    >>> parse("E[AB] @ 100")
    RewardQuestion(name='AB', at=100.0, up_to=None, until=None)
    """

    forms: ClassVar = ('R{"name"}=? [ I=t | C<=t | C | F phi | S ]', "E[name] @ t")
    examples: ClassVar = (
        'R{"B"}=? [ I=0.3 ]',
        'R{"both"}=? [ C<=0.3 ]',
        'R{"time"}=? [ F B >= 2 ]',
        'R{"A"}=? [ S ]',
        'R{"time"}=? [ F P<0.5 [ F<=0.2 B >= 2 ] ]',
        "E[A] @ 0.2",
    )

    name: str | None = None
    at: float | None = None
    up_to: float | None = None
    until: StateFormula | None = None

    @classmethod
    def read(cls, text: Cursor) -> RewardQuestion | None:
        """Read one of the words I, C, F and S behind R, or a name and a time behind E."""
        if text.takes("E", "["):
            name, at = text.name_at("E[name] @ t")
            return cls(name, at=at)
        head = text.operator("R")
        if head is None or head.measure != "exp":
            return None
        found = cls._inside(text, head.name)
        if found is not None:
            text.expect("]")
        return found

    @classmethod
    def _inside(cls, text: Cursor, name: str | None) -> RewardQuestion | None:
        if text.takes("S"):
            return cls(name)
        if text.takes("I"):
            text.expect("=", "expected I=t, as in I=100")
            return cls(name, at=text.time())
        if text.takes("C"):
            if text.sees("]"):
                return cls(name, up_to=math.inf)
            text.expect("<=", "expected C<=t, as in C<=100, or C")
            return cls(name, up_to=text.time())
        if text.takes("F"):
            if text.bound() != (0.0, None):
                text.fail("a reward until a target takes no time bound; ask for C<=t")
            return cls(name, until=text.states())
        return None

    @property
    def _is_steady(self) -> bool:
        return self.at is None and self.up_to is None and self.until is None

    def value(self, chain: Chain) -> Answer:
        """The mean reward, as `Chain.reward` gives it."""
        return chain.reward(self.name, self.at, self.up_to, self._target(chain), self._is_steady)

    def by_state(self, chain: Chain, _: Mask) -> StateAnswers:
        """The mean reward from every state; inf if there is no finite mean."""
        return reward_by_state(chain, self.name, self.at, self.up_to, self._target(chain), self._is_steady)

    def derivatives(self, sensitivity: Sensitivity) -> Derivatives:
        """The derivatives, as `Sensitivity.reward` gives them."""
        return sensitivity.reward(self.name, self.at, self.up_to, self._target(sensitivity.chain), self._is_steady)

    @property
    def counts_as(self) -> str:
        """The kind of the answer: a mean, or a mean time."""
        return TIME if self.name == TIME and self.at is None and not self._is_steady else MEAN

    def title(self, asked: str, unit: str) -> str:
        """A mean count, its integral over time, or a mean time."""
        if self.counts_as == TIME:
            if self.until is None:
                return super().title(asked, unit)
            return of_unit(f"mean time until {self.until.text}", unit)
        mean = f"mean of {self.name}" if self.name else "mean of the reward"
        if self.at is not None:
            return f"{mean} at {time_in_words(self.at, unit)} (count)"
        if self._is_steady:
            return f"{mean} in the steady state (count)"
        end = f"until {self.until.text}" if self.until else f"up to {time_in_words(self.up_to or 0.0, unit)}"
        return of_unit(
            f"{mean}, integrated {'over all time' if self.up_to == math.inf else end}", f"count {unit or 't'}"
        )

    @property
    def sampling(self) -> AtTime | Along | None:
        """A run contributes the rate that it has at the time, or the total on its way."""
        if self.at is not None:
            return at_time(self.name, self.at)
        if self._is_steady or self.up_to == math.inf or (self.until is not None and self.until.nested):
            return None
        return Along(self.up_to, None if self.until is None else self.until.text, self._earned)

    def _earned(self, model: Model, entered: Floats, left: Floats, states: Ints) -> float:
        return float(np.cumsum((left - entered) * reward_rates(model, self.name, states))[-1])
