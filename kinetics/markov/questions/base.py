"""The base of all questions to a chain; answers, derivatives and samples use only its methods."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from typing import ClassVar, NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from kinetics.markov.by_state import StateAnswers, from_each
from kinetics.markov.chain import Chain
from kinetics.markov.derivatives import Derivatives
from kinetics.markov.observing import reward_rates
from kinetics.markov.questions.formula import Mask, StateFormula, Truths
from kinetics.markov.questions.reader import Cursor
from kinetics.markov.sensitivity import Sensitivity
from kinetics.network import Model
from kinetics.network.predicates import StateNames, names_in, state_names
from kinetics.support.answer import Answer
from kinetics.support.arrays import Floats, Ints
from kinetics.support.estimates import SampleEstimate, mean_estimate, probability_estimate
from kinetics.support.tables import in_unit, of_unit

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


def at_time(name: str | None, end: float) -> AtTime:
    """Runs contribute the rate of a reward of this name, or the count of a species, at a time, tu."""
    return AtTime(end, lambda model, counts: reward_rates(model, name, counts))


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
    2. Write `read`, by what the `Cursor` of `kinetics.markov.questions.reader` has for operators, paths, time bounds
       and conditions.
    3. Write `value` with bounds, and `conditions`. Write `derivatives` if there are any.
    4. Write `by_state` if one solution gives the answers from all states; else each state is asked on its own.
    5. Write `settled` if some states decide the answer, so that the chain can stop there, and `sampling` if runs of
       finite length can answer, with `estimate` unless they do by their mean; else `unsampled`.
    6. Import it in `kinetics.markov.questions`, which adds it to `QUESTIONS`. `ask`, `scan` and the contract in
       tests/contracts/test_questions.py read that tuple.

    >>> from kinetics.markov.questions import QUESTIONS
    >>> QUESTIONS[0].forms[0]
    'P=? [ F phi ]'
    """

    forms: ClassVar[tuple[str, ...]]
    examples: ClassVar[tuple[str, ...]]

    @classmethod
    @abstractmethod
    def read(cls, text: Cursor) -> Self | None:
        """The question that comes next in a text; None if it is of another kind, a ValueError if of this but wrong."""

    @abstractmethod
    def value(self, chain: Chain) -> Answer:
        """The answer of a chain, with its bounds."""

    def derivatives(self, sensitivity: Sensitivity) -> Derivatives:  # noqa: ARG002 - there are none by default
        """The derivatives of the answer by the rate constants, with bounds; a ValueError if there are none."""
        raise ValueError(f"there are no derivatives of {self.forms[0]}; ask for its value alone")

    def by_state(self, chain: Chain, among: Mask) -> StateAnswers:
        """The answers from every state, at least those among given ones (N,)."""
        return from_each(chain, among, self.value)

    def truths(self, chain: Chain) -> Truths:  # noqa: ARG002 - a number has none
        """Where the answer is certainly true, and where it may be; a ValueError if it is a number."""
        raise ValueError(f"{self.forms[0]} is not true or false in each state")

    @property
    def is_truth(self) -> bool:
        """Whether the answer is true or false."""
        return False

    @property
    @abstractmethod
    def conditions(self) -> tuple[StateFormula, ...]:
        """The conditions on states that it names."""

    @property
    def counts_as(self) -> str:
        """The kind of the answer: a probability, a mean or a mean time."""
        return PROBABILITY

    def title(self, asked: str, unit: str) -> str:
        """The title of an axis with these answers, and their unit.

        asked : the question as text; unit : of times, "" if the model states none
        """
        if self.is_truth:
            return of_unit(f"1 if true, 0 if not: {asked}", unit and f"t in {unit}")
        if self.counts_as == TIME:
            return of_unit(f"time: {asked}", unit)
        return of_unit(f"{self.counts_as}: {asked}", unit and f"t in {unit}")

    @property
    def settled(self) -> Settled | None:
        """The states in which the answer is decided; None if there are none."""
        return None

    @property
    def sampling(self) -> AtTime | Decided | Along | None:
        """How runs of finite length answer the question; None if they cannot."""
        return None

    @property
    def unsampled(self) -> str:
        """Why runs cannot answer, where `sampling` is None."""
        if any(formula.nested for formula in self.conditions):
            return "the question inside it has no answer by runs; allow more states"
        return "it has no time bound; give one, as in F<=100 or C<=100, or allow more states"

    def estimate(self, values: Floats, level: float) -> SampleEstimate:
        """What the contributions of runs (runs,) say, with an interval at a level; by default of their mean."""
        return (probability_estimate if self.counts_as == PROBABILITY else mean_estimate)(values, level)

    def concluded(self, answer: Answer) -> Answer:
        """What the sampled answer of what is measured says about the question."""
        return answer

    def check(self, model: Model) -> None:
        """Raise a ValueError if a condition names something that the model does not have."""
        names = state_names(model, np.asarray(model.initial)[np.newaxis])
        for formula in self.conditions:
            formula.check(model, names)


def time_in_words(time: float, unit: str) -> str:
    """A time of a question, for a title: t = 100 s."""
    return in_unit(f"t = {time:g}", unit)


def settled_by(target: StateFormula | None, through: StateFormula | None) -> Settled | None:
    """Where an answer is decided; None if a condition asks a question, which needs the states behind."""
    formulas = [formula for formula in (target, through) if formula is not None]
    if any(formula.nested for formula in formulas):
        return None
    return Settled(*(None if formula is None else formula.text for formula in (target, through)))
