"""The base of all questions to a chain; answers, derivatives and samples use only its methods."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from typing import ClassVar, NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from kinetics.markov.chain import Chain
from kinetics.markov.derivatives import Derivatives
from kinetics.markov.questions.reader import Framed
from kinetics.markov.sensitivity import Sensitivity
from kinetics.network import Model
from kinetics.network.predicates import StateNames, names_in, state_names
from kinetics.support.answer import Answer
from kinetics.support.arrays import Floats, Ints

PROBABILITY, MEAN, TIME = "probability", "mean", "time"  # what an answer counts as


class Settled(NamedTuple):
    """The states in which the answer to a question is decided: a target, and all states outside of `through`.

    Each is a condition, or None.
    """

    target: str | None
    through: str | None

    def holds(self, names: StateNames) -> NDArray[np.bool_]:
        """True (N,) for the states in which the answer is decided."""
        found = np.zeros(names.n_states, dtype=bool)
        if self.target is not None:
            found |= names.holds(self.target)
        return found if self.through is None else found | ~names.holds(self.through)

    @property
    def names(self) -> set[str]:
        """The variables and labels that both conditions name."""
        return {name for text in self if text is not None for name in names_in(text)}


class AtTime(NamedTuple):
    """Runs are looked at once, at a time, tu: `value` gives what counts (runs, S) then contribute (runs,)."""

    end: float
    value: Callable[[Model, Ints], Floats]


class Decided(NamedTuple):
    """Runs end where a condition `stop` holds, or at the time `end`, tu.

    value : what they contribute (runs,), from whether `stop` held (runs,), and the counts (runs, S) at their end
    """

    end: float
    stop: str
    value: Callable[[Model, NDArray[np.bool_], Ints], Floats]


class Along(NamedTuple):
    """Runs contribute what happens on their way until a condition `stop` holds, or until the time `end`, tu.

    end : None if runs go on until `stop` holds
    value : what one run contributes, from the times at which its states (n, S) were entered (n,) and left (n,)
    """

    end: float | None
    stop: str | None
    value: Callable[[Model, Floats, Floats, Ints], float]


class Question(ABC):
    """A question to a chain, read from text; a kind of question is a frozen dataclass that inherits from this class.

    To add a kind:

    1. In a file of its own, write the class. Give it `forms`, as errors list them, and `examples`, which the contract
       asks of the network `A <-> B` with observable `both`.
    2. Write `read`, by what `kinetics.markov.questions.reader` has for time bounds and conditions.
    3. Write `value` and `derivatives`, with bounds, and `conditions`.
    4. Write `settled` if some states decide the answer, so that the chain can stop there, and `sampling` if runs of
       finite length can answer.
    5. Import it in `kinetics.markov.questions`, which adds it to `QUESTIONS`. `ask`, `scan` and the contract in
       tests/contracts/test_questions.py read that tuple.

    >>> from kinetics.markov.questions import QUESTIONS
    >>> QUESTIONS[0].forms[0]
    'P=? [ F phi ]'
    """

    forms: ClassVar[tuple[str, ...]]
    examples: ClassVar[tuple[str, ...]]

    @classmethod
    @abstractmethod
    def read(cls, asked: Framed) -> Self | None:
        """The question of a text; None if it is of another kind, a ValueError if it is of this one but wrong."""

    @abstractmethod
    def value(self, chain: Chain) -> Answer:
        """The answer of a chain, with its bounds."""

    @abstractmethod
    def derivatives(self, sensitivity: Sensitivity) -> Derivatives:
        """The derivatives of the answer by the rate constants, with bounds."""

    @property
    @abstractmethod
    def conditions(self) -> tuple[str, ...]:
        """The conditions on states that it names."""

    @property
    def counts_as(self) -> str:
        """The kind of the answer: a probability, a mean or a mean time."""
        return PROBABILITY

    @property
    def settled(self) -> Settled | None:
        """The states in which the answer is decided; None if there are none."""
        return None

    @property
    def sampling(self) -> AtTime | Decided | Along | None:
        """How runs of finite length answer the question; None if they cannot."""
        return None

    def check(self, model: Model) -> None:
        """Raise a ValueError if a condition names something that the model does not have."""
        names = state_names(model, np.asarray(model.initial)[np.newaxis])
        for condition in self.conditions:
            names.holds(condition)
