"""The base of questions about a reward, or about the count of a species, which is one."""

from __future__ import annotations

from typing import Any

import numpy as np

from kinetics.markov.chain import Chain, Target
from kinetics.markov.observing import reward_rates
from kinetics.markov.questions.base import MEAN, AtTime, Question, Settled, at_time, settled_by
from kinetics.markov.questions.formula import StateFormula
from kinetics.network import Model


class RewardedQuestion(Question):
    """A question about a reward `name` `at` a time, or `until` a target.

    name, at, until : fields of the questions; None where they do not ask for one
    """

    name: Any
    at: Any
    until: Any = None

    @property
    def counts_as(self) -> str:
        """The kind of the answer: a mean, or in its unit."""
        return MEAN

    @property
    def conditions(self) -> tuple[StateFormula, ...]:
        """The target, if there is one."""
        return () if self.until is None else (self.until,)

    @property
    def settled(self) -> Settled | None:
        """The answer is decided in the target, if there is one."""
        return None if self.until is None else settled_by(self.until, None)

    @property
    def sampling(self) -> Any:
        """A run contributes the rate, or the count, that it has at the time."""
        found: AtTime | None = None if self.at is None else at_time(self.name, self.at)
        return found

    def check(self, model: Model) -> None:
        """A ValueError if there is no such reward either."""
        reward_rates(model, self.name, np.asarray(model.initial)[np.newaxis])
        super().check(model)

    def _target(self, chain: Chain) -> Target | None:
        return None if self.until is None else self.until.states(chain)
