"""The probability that a target is reached, through given states: `P=? [ F<=100 B >= 1 ]`, `P=? [ A U[2,5] B ]`."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from kinetics.markov.chain import Chain
from kinetics.markov.derivatives import Derivatives
from kinetics.markov.questions.base import Along, Decided, Question, Settled
from kinetics.markov.questions.reader import Bounded, Framed, words
from kinetics.markov.sensitivity import Sensitivity
from kinetics.network import Model
from kinetics.network.laws.reading import shortened
from kinetics.network.predicates import Condition
from kinetics.support.answer import Answer
from kinetics.support.arrays import Floats, Ints


@dataclass(frozen=True)
class UntilQuestion(Question):
    """P=? [ through U[after,by] target ]; F if there is no `through`; without `by`, time is unbounded.

    >>> from kinetics.markov.questions import parse
    >>> parse("P=? [ A > 0 U<=2 B = 3 ]")
    UntilQuestion(target='B = 3', through='A > 0', by=2.0, after=0.0)
    """

    forms: ClassVar = ("P=? [ F phi ]", "P=? [ phi U psi ]")
    examples: ClassVar = (
        "P=? [ F[0.1,0.3] B >= 2 ]",
        "P=? [ A >= 1 U[0.1,0.3] B >= 2 ]",
        "P=? [ F<=0.2 B >= 2 ]",
        "P=? [ A >= 2 U<=0.3 B >= 2 ]",
        "P=? [ both = 3 & B < 2 U A = 0 ]",
    )

    target: str
    through: str | None = None
    by: float | None = None
    after: float = 0.0

    @classmethod
    def read(cls, asked: Framed) -> UntilQuestion | None:
        """F at the beginning, or one U between two conditions."""
        if asked.letter != "P" or asked.begins_with("G"):
            return None
        if asked.begins_with("F"):
            after, by, target = Bounded.of(asked.inner[1:])
            return cls(target, None, by, after)
        places = words(asked.inner, "U")
        if not places:
            return None
        if len(places) > 1:
            raise ValueError(f"{shortened(asked.inner)!r} has {len(places)} times U where one is expected")
        through = asked.inner[: places[0]].strip()
        if not through:
            raise ValueError("nothing stands before U; write F psi, or true U psi")
        after, by, target = Bounded.of(asked.inner[places[0] + 1 :])
        return cls(target, through, by, after)

    def value(self, chain: Chain) -> Answer:
        """The probability, as `Chain.until` gives it."""
        return chain.until(self.target, self.through, self.by, after=self.after)

    def derivatives(self, sensitivity: Sensitivity) -> Derivatives:
        """The derivatives, as `Sensitivity.until` gives them."""
        return sensitivity.until(self.target, self.through, self.by, self.after)

    @property
    def conditions(self) -> tuple[str, ...]:
        """The target, and the states on the way to it."""
        return (self.target,) if self.through is None else (self.target, self.through)

    @property
    def settled(self) -> Settled | None:
        """The answer is decided outside of the states on the way, and in the target if that counts from the start."""
        if self.after:
            return Settled(None, self.through) if self.through is not None else None
        return Settled(self.target, self.through)

    @property
    def sampling(self) -> Decided | Along | None:
        """A run ends where it is settled, and counts if that is the target."""
        if self.by is None:
            return None
        if self.after:
            return Along(self.by, None if self.through is None else f"!({self.through})", self._reaches)
        stop = f"({self.target})" + (f" | !({self.through})" if self.through is not None else "")

        def fulfils(model: Model, stopped: NDArray[np.bool_], counts: Ints) -> Floats:
            return (stopped & Condition(self.target, model).holds(counts)).astype(float)

        return Decided(self.by, stop, fulfils)

    def _reaches(self, model: Model, entered: Floats, left: Floats, states: Ints) -> float:
        """1 if a run is in the target in the interval, and was on the way until then."""
        there = Condition(self.target, model).holds(states) & (left >= self.after)
        if self.through is not None:
            astray = ~Condition(self.through, model).holds(states)
            lost = np.cumsum(astray)
            there &= (lost == 0) | ((lost == 1) & astray & (entered >= self.after))
        return float(there.any())
