"""The probability that a target is reached, through given states: `P=? [ F<=100 B >= 1 ]`, `P=? [ A > 0 U B = 3 ]`."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from kinetics.markov.chain import Chain
from kinetics.markov.derivatives import Derivatives
from kinetics.markov.questions.base import Decided, Question, Settled
from kinetics.markov.questions.reader import Framed, bounded, words
from kinetics.markov.sensitivity import Sensitivity
from kinetics.network import Model
from kinetics.network.laws.reading import shortened
from kinetics.network.predicates import Condition
from kinetics.support.answer import Answer
from kinetics.support.arrays import Floats, Ints


@dataclass(frozen=True)
class UntilQuestion(Question):
    """P=? [ through U<=by target ]; F without `through`, and for ever without `by`.

    >>> from kinetics.markov.questions import parse
    >>> parse("P=? [ A > 0 U<=2 B = 3 ]")
    UntilQuestion(target='B = 3', through='A > 0', by=2.0)
    """

    forms: ClassVar = ("P=? [ F phi ]", "P=? [ phi U psi ]")
    examples: ClassVar = ("P=? [ F<=0.2 B >= 2 ]", "P=? [ A >= 2 U<=0.3 B >= 2 ]", "P=? [ both = 3 & B < 2 U A = 0 ]")

    target: str
    through: str | None = None
    by: float | None = None

    @classmethod
    def read(cls, asked: Framed) -> UntilQuestion | None:
        """F at the beginning, or one U between two conditions."""
        if asked.letter != "P" or asked.begins_with("G"):
            return None
        if asked.begins_with("F"):
            by, target = bounded(asked.inner[1:])
            return cls(target, None, by)
        places = words(asked.inner, "U")
        if not places:
            return None
        if len(places) > 1:
            raise ValueError(f"{shortened(asked.inner)!r} has {len(places)} times U where one is expected")
        through = asked.inner[: places[0]].strip()
        if not through:
            raise ValueError("nothing stands before U; write F psi, or true U psi")
        by, target = bounded(asked.inner[places[0] + 1 :])
        return cls(target, through, by)

    def value(self, chain: Chain) -> Answer:
        """As `Chain.until` has it."""
        return chain.until(self.target, self.through, self.by)

    def derivatives(self, sensitivity: Sensitivity) -> Derivatives:
        """As `Sensitivity.until` has them."""
        return sensitivity.until(self.target, self.through, self.by)

    @property
    def conditions(self) -> tuple[str, ...]:
        """The target, and the states on the way to it."""
        return (self.target,) if self.through is None else (self.target, self.through)

    @property
    def settled(self) -> Settled | None:
        """It is settled in the target, and outside of the states on the way."""
        return Settled(self.target, self.through)

    @property
    def sampling(self) -> Decided | None:
        """A run ends where it is settled, and counts if that is the target."""
        if self.by is None:
            return None
        stop = f"({self.target})" + (f" | !({self.through})" if self.through is not None else "")

        def fulfils(model: Model, stopped: NDArray[np.bool_], counts: Ints) -> Floats:
            return (stopped & Condition(self.target, model).holds(counts)).astype(float)

        return Decided(self.by, stop, fulfils)
