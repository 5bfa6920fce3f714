"""The accuracy that is asked of a prediction, and what was done to reach it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from kinetics.predicting.tuning import BUDGET, LEAST
from kinetics.support.answer import CONFIDENCE, PROVEN
from kinetics.support.arrays import Floats, real_number

KINDS = ("mean", "sd", "distribution")


@dataclass(frozen=True)
class AskedAccuracy:
    """The largest error allowed in a prediction, for all species shown and all times together.

    value : the largest error. Of means and standard deviations in copies, or where `is_relative` as a share of the
        species' largest mean (sd) over the times, and of one copy at least, so that rare species need no digits.
        Of distributions it is the largest error of the probability of at most n copies, for any n
    of : "mean", "sd" or "distribution"
    budget : CPU time allowed for it, s
    ValueError: a budget that is not above 0, or a value below 1e-12, or above 1 if it is relative or a probability

    >>> from kinetics.predicting import AskedAccuracy
    >>> AskedAccuracy.of_text("1%", of="sd")
    AskedAccuracy(value=0.01, is_relative=True, of='sd', budget=1200.0)
    """

    value: float
    is_relative: bool = False
    of: str = "mean"
    budget: float = BUDGET

    def __post_init__(self) -> None:
        if not 0 < real_number("budget", self.budget) < np.inf:
            raise ValueError(f"budget = {self.budget:g}; expected a positive number of seconds")
        if self.of not in KINDS:
            raise ValueError(f"accuracy of {self.of!r}; expected that of {', '.join(KINDS)}")
        real_number("accuracy", self.value)
        shown, is_share = self.in_words, self.is_relative or self.of == "distribution"
        if not 0 < self.value < np.inf:
            raise ValueError(f"accuracy = {shown}; expected a finite error above 0, as in 1% or 0.5 (copies)")
        if self.value < LEAST:
            raise ValueError(
                f"accuracy = {shown}; expected at least {LEAST:g} ({100 * LEAST:g} %): double precision cannot "
                f"prove less"
            )
        if is_share and self.value > 1:
            raise ValueError(f"accuracy = {shown}; expected at most 100 %" + self._hint)

    @property
    def _hint(self) -> str:
        return ", the error of a probability" if self.of == "distribution" else ""

    @classmethod
    def of_text(cls, text: str, of: str = "mean", budget: float = BUDGET) -> AskedAccuracy:
        """Read an accuracy from "1%" or "0.5"; for a distribution both are probabilities."""
        stripped = text.strip()
        is_percent = stripped.endswith("%")
        try:
            number = float(stripped.removesuffix("%"))
        except ValueError:
            raise ValueError(
                f"accuracy {text!r}; expected a share such as 1%, or a number of copies such as 0.5"
            ) from None
        return cls(number / 100 if is_percent else number, is_percent and of != "distribution", of, budget)

    @property
    def in_words(self) -> str:
        """The accuracy as text with its unit."""
        return self.words(self.value)

    def words(self, value: float) -> str:
        """Text for a value in the unit of the accuracy: percent, probability or copies."""
        if self.is_relative:
            return f"{100 * value:.3g} %"
        return f"{value:.3g}" if self.of == "distribution" else f"{value:.3g} copies"

    @property
    def meaning(self) -> str:
        """Text that says which quantity the accuracy bounds the error of."""
        if self.of == "distribution":
            return "of the probability of at most n copies, for any n"
        figure = "mean" if self.of == "mean" else "standard deviation"
        return f"of the species' largest {figure}, or of one copy" if self.is_relative else f"of each {figure}"

    def tolerances(self, figures: Floats) -> Floats:
        """Largest errors (S,) of means or standard deviations that came out as `figures` (T, S).

        A relative one is somewhat less than the share of these, so that it is no more than that share of the true ones.
        """
        if not self.is_relative:
            return np.full(figures.shape[1], self.value)
        return np.asarray(self.value / (1.0 + self.value) * np.maximum(figures.max(axis=0), 1.0))


class CostForecast(NamedTuple):
    """The forecast cost of a method: CPU time (s; None if not known), and a remark."""

    method: str
    seconds: float | None
    remark: str = ""

    @property
    def in_words(self) -> str:
        """Method, cost and remark on one line."""
        cost = "" if self.seconds is None else f"{self.seconds:.2g} s"
        return f"{self.method}: {', '.join(filter(None, [cost, self.remark]))}"


@dataclass(frozen=True)
class Reached:
    """The accuracy of a prediction that was made for one.

    asked : what was asked for
    error : bound on the error, in the unit of `asked`; inf if none is known
    is_proven : whether the bound is proven, else that of an interval by the normal distribution
    confidence : of the bound, for all figures together; 1 for a solution
    chosen : method that gave the answer
    candidates : all that were considered, with their forecast costs
    tenfold : the cheapest for a tenth of the error, and its forecast cost; None if none can reach it
    rare : of an answer by runs, how rare events were allowed for; empty if none showed

    >>> from kinetics import Model, Network, predict
    >>> decay = Network.from_text("A -> 0, 0.1")
    >>> found = predict(Model(decay, {"A": 100}), None, [10.0], method="1%")
    >>> found.reached.chosen, found.reached.is_reached, found.reached.is_proven
    ('transient', True, True)
    """

    asked: AskedAccuracy
    error: float
    is_proven: bool
    confidence: float
    chosen: str
    candidates: tuple[CostForecast, ...]
    tenfold: CostForecast | None
    rare: str = ""

    @property
    def is_reached(self) -> bool:
        """True if the error is no larger than asked for."""
        return self.error <= self.asked.value

    @property
    def guarantee(self) -> str:
        """Text that says in what sense the bound holds: proven, or with a confidence."""
        if self.confidence == 1.0:
            return "proven"
        sure = f"with {100 * self.confidence:g} % confidence for all figures together"
        return f"{sure}, proven" if self.is_proven else f"{sure}, by the normal distribution of means of many runs"

    @property
    def kind(self) -> str:
        """The kind of the error bound, one of those of `Answer`."""
        return PROVEN if self.confidence == 1.0 else CONFIDENCE

    @property
    def headline(self) -> str:
        """The accuracy in a few words."""
        return f"{self.asked.of} within {self.asked.words(self.error)}, {self.kind}"

    @property
    def notes(self) -> tuple[str, ...]:
        """Lines for people: the accuracy asked for and reached, the candidates, the cost of a tenth of the error."""
        asked = self.asked
        verdict = "reached" if self.is_reached else "NOT reached; achieved"
        best = self.tenfold
        more = "no method here reaches it" if best is None else f"about {best.seconds:.2g} s CPU, by {best.method}"
        return (
            f"accuracy: {asked.in_words} {asked.meaning}; {verdict} {asked.words(self.error)}, {self.guarantee}",
            *([f"rare events: {self.rare}"] if self.rare else []),
            f"chosen: {self.chosen}; forecasts were {'; '.join(each.in_words for each in self.candidates)}",
            f"ten times the accuracy: {more}",
        )

    def to_dict(self) -> dict[str, Any]:
        """The accuracy reached as a dictionary, ready for JSON."""
        best = self.tenfold
        return {
            "asked": self.asked.value,
            "relative": self.asked.is_relative,
            "of": self.asked.of,
            "error": self.error,
            "reached": self.is_reached,
            "kind": self.kind,
            "guarantee": self.guarantee,
            "rare_events": self.rare,
            "chosen": self.chosen,
            "candidates": [each._asdict() for each in self.candidates],
            "tenfold": None if best is None else {"method": best.method, "seconds": best.seconds},
        }
