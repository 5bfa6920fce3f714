"""The mean of a reward: `R{"heat"}=? [ C<=100 ]`, `E[AB] @ 100`, and of a time: `R{"time"}=? [ F A = 0 ]`."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from kinetics.markov.chain import Chain
from kinetics.markov.derivatives import Derivatives
from kinetics.markov.observing import reward_rates
from kinetics.markov.questions.base import MEAN, TIME, Along, AtTime, Question, Settled
from kinetics.markov.questions.reader import Bounded, Framed, one_bound, time_of
from kinetics.markov.sensitivity import Sensitivity
from kinetics.network import Model
from kinetics.support.answer import Answer
from kinetics.support.arrays import Floats, Ints


@dataclass(frozen=True)
class RewardQuestion(Question):
    """R{"name"}=? [ ... ]: its rate `at` a time, its total `up_to` a time or `until` a target; else its steady rate.

    >>> from kinetics.markov.questions import parse
    >>> parse("E[AB] @ 100")
    RewardQuestion(name='AB', at=100.0, up_to=None, until=None)
    """

    forms: ClassVar = ('R{"name"}=? [ I=t | C<=t | F phi | S ]', "E[name] @ t")
    examples: ClassVar = (
        'R{"B"}=? [ I=0.3 ]',
        'R{"both"}=? [ C<=0.3 ]',
        'R{"time"}=? [ F B >= 2 ]',
        'R{"A"}=? [ S ]',
        "E[A] @ 0.2",
    )

    name: str | None = None
    at: float | None = None
    up_to: float | None = None
    until: str | None = None

    @classmethod
    def read(cls, asked: Framed) -> RewardQuestion | None:
        """One of the words I, C, F and S behind R, or a name and a time behind E."""
        if asked.letter == "E":
            if not asked.name or not asked.inner:
                raise ValueError("expected E[name] @ t, as in E[AB] @ 100")
            return cls(asked.name, at=time_of(asked.inner))
        if asked.letter != "R":
            return None
        if asked.inner == "S":
            return cls(asked.name)
        match asked.begins_with("ICF"):
            case "I":
                return cls(asked.name, at=one_bound(asked.inner[1:], "I", "="))
            case "C":
                return cls(asked.name, up_to=one_bound(asked.inner[1:], "C", "<="))
            case "F":
                _, by, states = Bounded.of(asked.inner[1:])
                if by is not None:
                    raise ValueError("a reward until a target takes no time bound; ask for C<=t")
                return cls(asked.name, until=states)
        return None

    @property
    def _is_steady(self) -> bool:
        return self.at is None and self.up_to is None and self.until is None

    def value(self, chain: Chain) -> Answer:
        """The mean reward, as `Chain.reward` gives it."""
        return chain.reward(self.name, self.at, self.up_to, self.until, self._is_steady)

    def derivatives(self, sensitivity: Sensitivity) -> Derivatives:
        """The derivatives, as `Sensitivity.reward` gives them."""
        return sensitivity.reward(self.name, self.at, self.up_to, self.until, self._is_steady)

    @property
    def counts_as(self) -> str:
        """The kind of the answer: a mean, or a mean time."""
        return TIME if self.name == TIME and self.at is None and not self._is_steady else MEAN

    @property
    def conditions(self) -> tuple[str, ...]:
        """The target, if there is one."""
        return () if self.until is None else (self.until,)

    @property
    def settled(self) -> Settled | None:
        """The answer is decided in the target, if there is one."""
        return None if self.until is None else Settled(self.until, None)

    @property
    def sampling(self) -> AtTime | Along | None:
        """A run contributes the rate that it has at the time, or the total on its way."""
        if self.at is not None:
            return AtTime(self.at, lambda model, counts: reward_rates(model, self.name, counts))
        return None if self._is_steady else Along(self.up_to, self.until, self._earned)

    def _earned(self, model: Model, entered: Floats, left: Floats, states: Ints) -> float:
        return float(np.cumsum((left - entered) * reward_rates(model, self.name, states))[-1])

    def check(self, model: Model) -> None:
        """A ValueError if there is no such reward either."""
        reward_rates(model, self.name, np.asarray(model.initial)[np.newaxis])
        super().check(model)
