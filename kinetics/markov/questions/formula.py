"""`StateFormula`: a condition on states, which may ask questions of its own, as in `x > 1 & P>0.5 [ F<=10 "done" ]`."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product
from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from kinetics.markov.chain import Chain, Target
from kinetics.network import Model
from kinetics.network.predicates import StateNames, names_in, read_condition

Mask = NDArray[np.bool_]
MOST_DOUBTFUL = 8  # nested questions with undecided states: all combinations of what they may say are tried


class Truths(NamedTuple):
    """Where a formula certainly holds (N,), where it may hold (N,), and what is known where the two differ.

    why : for each nested question with undecided states, these (N,) and what their bounds are, by state
    """

    sure: Mask
    possible: Mask
    why: tuple[tuple[Mask, Bounds], ...] = ()

    def decided(self, chain: Chain) -> Mask:
        """The states in which it holds; a ValueError that names a state for which that is not decided."""
        undecided = np.flatnonzero(self.possible & ~self.sure)
        if not undecided.size:
            return self.sure
        row = int(undecided[0])
        reasons = [bounds.in_words(row) for places, bounds in self.why if places[row]]
        raise ValueError(
            f"not decided within the bound in {undecided.size} of {len(chain)} states: in {state_name(chain, row)}, "
            f"{', and '.join(reasons)}; ask for another limit"
        )


class Bounds(Protocol):
    """What bounds a nested question has in each state."""

    def in_words(self, row: int) -> str:
        """What lies between which bounds in one state, and what that does not decide."""


class Nested(Protocol):
    """A question that is true or false in each state."""

    def truths(self, chain: Chain) -> Truths:
        """Where it certainly holds, and where it may."""

    def check(self, model: Model) -> None:
        """Raise a ValueError if it names something that the model does not have."""


class Span(NamedTuple):
    """A nested question, and where it begins and ends in the text of its formula."""

    begin: int
    end: int
    question: Nested


@dataclass(frozen=True, repr=False)
class StateFormula:
    """A condition on states as text, and the questions in it, each of which is true or false in a state.

    A nested question holds in a state if its answer from there lies on that side of its limit with all of its proven
    bounds. States for which that is not decided, and matters, are an error, never a guess.

    >>> from kinetics import Chain
    >>> from kinetics.markov.questions import parse
    >>> steps = Chain([[0, 1, 0], [0, 0, 1], [0, 0, 0]], 0, variables=("n",), counts=[[0], [1], [2]])
    >>> parse("P=? [ F n > 0 & P>0.5 [ F<=1 n = 2 ] ]").target.states(steps).tolist()  # 1 - 2/e, 1 - 1/e and 1
    [False, True, True]
    """

    text: str
    nested: tuple[Span, ...] = ()

    def __repr__(self) -> str:
        return repr(self.text)

    @property
    def condition(self) -> str:
        """The text with each nested question as a label, whose name is the question."""
        found, place = "", 0
        for span in self.nested:
            found += self.text[place : span.begin] + repr(self._label(span))
            place = span.end
        return found + self.text[place:]

    def _label(self, span: Span) -> str:
        return self.text[span.begin : span.end]

    def place_of(self, place: int) -> int:
        """The place in the text of one in the condition."""
        shift = 0
        for span in self.nested:
            label = repr(self._label(span))
            if place < span.begin + shift + len(label):
                return min(place - shift, span.end)
            shift += len(label) - (span.end - span.begin)
        return place - shift

    def check_syntax(self) -> None:
        """Raise a `FormulaError` if the text is no condition, whatever its names."""
        read_condition(self.condition)

    @property
    def is_truth(self) -> bool:
        """A condition is true or false in each state."""
        return True

    @property
    def names(self) -> set[str]:
        """The variables and labels of a formula without nested questions."""
        return set(names_in(self.text))

    def check(self, model: Model, names: StateNames) -> None:
        """Raise a ValueError if it names something that the model does not have; names : those of any states."""
        labels = {**names.labels}
        for span in self.nested:
            span.question.check(model)
            labels[self._label(span)] = np.zeros(names.n_states, dtype=bool)
        places = StateNames(names.n_states, tuple(names.variables), names.counts, labels)
        places.holds(self.condition)

    def states(self, chain: Chain) -> Target:
        """The states of a chain in which it holds: its text if nothing is nested, else truths (N,), all decided."""
        return self.truths(chain).decided(chain) if self.nested else self.text

    def truths(self, chain: Chain) -> Truths:
        """Where it certainly holds, and where it may hold, if some nested questions are not decided."""
        answers = {self._label(span): span.question.truths(chain) for span in self.nested}
        doubtful = [name for name, found in answers.items() if not np.array_equal(found.sure, found.possible)]
        why = tuple(each for found in answers.values() for each in found.why)
        if len(doubtful) > MOST_DOUBTFUL:
            return Truths(np.zeros(len(chain), dtype=bool), np.ones(len(chain), dtype=bool), why)
        # A state is decided if the formula comes out alike, whatever its undecided questions are.
        found = []
        for choice in product((False, True), repeat=len(doubtful)):
            takes = dict(zip(doubtful, choice, strict=True))
            labels = {name: each.possible if takes.get(name) else each.sure for name, each in answers.items()}
            found.append(chain.states(self.condition, labels=labels))
        return Truths(np.logical_and.reduce(found), np.logical_or.reduce(found), why)


def state_name(chain: Chain, row: int) -> str:
    """The number of a state and the values of its variables, as errors name it."""
    if chain.counts is None or not chain.variables:
        return f"state {row}"
    values = zip(chain.variables, np.asarray(chain.counts)[row].tolist(), strict=True)
    return f"state {row} ({', '.join(f'{name}={value}' for name, value in values)})"
