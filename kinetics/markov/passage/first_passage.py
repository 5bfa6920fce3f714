"""The first-passage time of a chain to a target: moments, distribution and quantiles, each with its bounds."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from kinetics.markov.passage.arrival import Arrival
from kinetics.markov.passage.until import UNDERFLOW
from kinetics.markov.transient.transitions import Transitions
from kinetics.support import plots
from kinetics.support.answer import Answer, kind_of
from kinetics.support.arrays import Floats, reals
from kinetics.support.datasets import dataframe
from kinetics.support.packages import pd
from kinetics.support.shown import ResultTable, Shown, Tabular, on_axes
from kinetics.support.tables import counted, figure, in_unit

DRAWN = 201  # times of a curve


@dataclass(frozen=True, eq=False, repr=False)
class Passage(Shown, Tabular):
    """The distribution of a first-passage time.

    A run that leaves a truncated chain reaches the target at that moment at the earliest, and never at the latest: the
    cdf of the time lies between those of the two (Munsky & Khammash 2006, doi:10.1063/1.2145882). Values are those of
    the latest, bounds those of both.

    target : name of the target in tables and on axes
    mean : mean of the time; inf if the target may never be reached
    probability : probability of ever reaching the target
    error : relative error of mean and probability; probabilities below 1e-290 may be lost
    n_states : number of states before the target
    transitions : among these states and the target, which is the last
    start : probabilities of these states at time 0
    is_bound : whether errors and bounds are proven; not by a rate law that cannot be bounded
    time_unit : name of the unit of all times, "" if none is stated
    earliest : of a truncated chain, the time until it reaches the target or its edge
    cpu_seconds : processor time that mean and probability took

    >>> from kinetics import Network, first_passage
    >>> found = first_passage(Network.from_text("A -> B, 0.1"), {"A": 1}, "B")  # exponential, with mean 10
    >>> found.cdf([0.0, 10.0]).round(6).tolist(), found.quantile(0.5).round(6).tolist()
    ([0.0, 0.632121], 6.931472)
    >>> low, high = found.cdf_bounds(1e-9)
    >>> bool(0 < high / low - 1 < 1e-12)
    True
    """

    target: str
    mean: float
    probability: float
    error: float
    n_states: int
    transitions: Transitions = field(repr=False)
    start: Floats = field(repr=False)
    is_bound: bool = True
    time_unit: str = ""
    earliest: Passage | None = None
    cpu_seconds: float = 0.0
    _spread: Callable[[], tuple[float, float]] = field(default=lambda: (np.nan, np.nan), repr=False)

    @property
    def headline(self) -> str:
        """One line: the target, the mean, and the number of states."""
        return f"time until {self.target}: {self._mean_in_words}; {self.n_states} states"

    def summary(self) -> ResultTable:
        """Mean, standard deviation, probability and some quantiles, with their bounds."""
        rows = []
        for what in ("mean", "sd", "probability", 0.05, 0.5, 0.95):
            answer = self.answer(what)
            title = what if isinstance(what, str) else f"{100 * what:g} % have arrived by"
            value = figure(answer.value, ".6g") if what == "probability" else self._in_words(answer.value, ".6g")
            rows.append((title, value, answer.bounds_text))
        notes = [f"solved, not sampled; bounds: {kind_of(self.is_bound)}"]
        if self.earliest is not None:
            notes.append("truncated: the bounds hold for any behaviour outside; the values exclude it")
        return ResultTable(self.headline, ("", "value", "bounds"), rows, notes)

    def answer(self, what: str | float) -> Answer:
        """The "mean", "sd" or "probability", or the quantile of a probability, with bounds."""
        began = time.process_time()
        if what == "mean":
            found = Answer(self.mean, *self.mean_bounds)
        elif what == "probability":
            found = Answer(self.probability, *self.probability_bounds)
        elif what == "sd" and self.earliest is None:
            found = Answer.within(self.sd, self.sd_error, True)
        elif what == "sd":
            return Answer.none("a truncated chain gives no bound on the standard deviation")
        else:
            low, high = self.quantile_bounds(what)
            found = Answer(float(self.quantile(what)), float(low), float(high))
        method = "linear equations"
        if isinstance(what, float) and np.isfinite(found.value):
            method = self._arrival.method_at(found.value)
        seconds = time.process_time() - began + (self.cpu_seconds if what in ("mean", "probability") else 0.0)
        size = counted(self.n_states, "state")
        return replace(found, kind=kind_of(self.is_bound), method=method, cpu_seconds=seconds, why=size)

    @property
    def _mean_in_words(self) -> str:
        if self.earliest is not None:
            return f"mean at least {self._in_words(self.mean_bounds[0], '.6g')}"
        return f"mean {self._in_words(self.mean, '.4g')}"

    def _in_words(self, time: float, form: str) -> str:
        return in_unit(figure(time, form), self.time_unit * bool(np.isfinite(time)))

    @property
    def is_certain(self) -> bool:
        """True if the target is reached with probability 1."""
        return bool(np.isfinite(self.mean))

    @property
    def may_reach(self) -> bool:
        """True if the target is reachable, however unlikely it is."""
        is_target = np.arange(self.start.size) == self.start.size - 1
        return bool(self.transitions.leading_to(is_target)[self.start > 0.0].any())

    @property
    def mean_bounds(self) -> tuple[float, float]:
        """Lower and upper bound of the mean; the upper one is inf if a chain is truncated."""
        low = self._first
        return low.mean * (1.0 - low.error), self.mean * (1.0 + self.error)

    @property
    def probability_bounds(self) -> tuple[float, float]:
        """Lower and upper bound of the probability of ever reaching the target."""
        if self.is_certain:
            return 1.0, 1.0
        high = self._first
        most = high.probability * (1.0 + high.error)
        if most < UNDERFLOW and high.may_reach:  # too small for numbers, or known to few digits
            most += UNDERFLOW
        return self.probability * (1.0 - self.error) if self.probability > UNDERFLOW else 0.0, min(most, 1.0)

    @property
    def _first(self) -> Passage:
        """The passage that bounds the time from below."""
        return self.earliest or self

    @property
    def sd(self) -> float:
        """Standard deviation of the time; nan if the target may never be reached. Solved for when first asked."""
        return self._sd[0]

    @property
    def sd_error(self) -> float:
        """Relative error of sd, proven where that of the mean is."""
        return self._sd[1]

    @cached_property
    def _sd(self) -> tuple[float, float]:
        return self._spread()

    @cached_property
    def _arrival(self) -> Arrival:
        return Arrival(self.transitions, self.start, self.target)

    def cdf(self, times: ArrayLike) -> Floats:
        """Probability (...) that the target has been reached by `times` (...), tu."""
        return _at(times, self._arrival.cdf)[0]

    def survival(self, times: ArrayLike) -> Floats:
        """Probability (...) that it has not been reached."""
        return _at(times, self._arrival.survival)[0]

    def cdf_bounds(self, times: ArrayLike) -> tuple[Floats, Floats]:
        """Lower and upper bounds of the cdf (...), from truncation and all rounding, that of the rates included.

        Where it is small, they are close relative to it.
        """
        return _at(times, self._arrival.cdf)[1], _at(times, self._first._arrival.cdf)[2]

    def survival_bounds(self, times: ArrayLike) -> tuple[Floats, Floats]:
        """Lower and upper bounds of the survival (...), as of the cdf."""
        return _at(times, self._first._arrival.survival)[1], _at(times, self._arrival.survival)[2]

    def quantile(self, q: ArrayLike) -> Floats:
        """Times (...) by which the target has been reached with probability q (...); inf if that never happens."""
        asked = _probabilities(q)
        return np.array([self._quantile(float(one)) for one in asked.ravel()]).reshape(asked.shape)

    def quantile_bounds(self, q: ArrayLike) -> tuple[Floats, Floats]:
        """Lower and upper bounds of the quantiles (...); the upper one is inf if q may never be reached."""
        asked = _probabilities(q)
        low = [self._first._quantile_bounds(float(one))[0] for one in asked.ravel()]
        high = [self._quantile_bounds(float(one))[1] for one in asked.ravel()]
        return np.array(low).reshape(asked.shape), np.array(high).reshape(asked.shape)

    def _quantile_bounds(self, q: float) -> tuple[float, float]:
        if not self.is_certain and q > self.probability * (1.0 + self.error):
            return np.inf, np.inf
        ever = 1.0 if self.is_certain else self.probability * (1.0 - self.error)
        return self._arrival.quantile_bounds(q, ever)

    def _quantile(self, q: float) -> float:
        if q > self.start[-1] and q >= self.probability:
            return np.inf
        return self._arrival.quantile(q)

    def __str__(self) -> str:
        if self.earliest is not None:
            low, high = self.probability_bounds
            return (
                f"time until {self.target}: {self._mean_in_words}; reached with probability {low:.12g} to {high:.12g}"
            )
        if self.is_certain:
            mean, sd = (self._in_words(value, ".4g") for value in (self.mean, self.sd))
            return f"time until {self.target}: mean {mean}, sd {sd}"
        return f"time until {self.target}: not certain, reached with probability {self.probability:.4g}; mean infinite"

    @property
    def _drawn_at(self) -> Floats:
        return np.linspace(0.0, self._quantile(0.99 * self.probability) or 1.0, DRAWN)

    def to_dataframe(self) -> pd.DataFrame:
        """The distribution function up to 99 % of those that arrive: time, probability, and its bounds low and high."""
        times = self._drawn_at
        low, high = self.cdf_bounds(times)
        return dataframe({"time": times, "probability": self.cdf(times), "low": low, "high": high})

    @on_axes
    def plot(self, ax: Any) -> Any:
        """Plot the distribution function up to the 99 % quantile, and the mean; returns `ax`."""
        times = self._drawn_at
        return plots.passage(ax, times, self.cdf(times), self.mean, self.target, self.time_unit)


def _at(times: ArrayLike, question: Callable[[float], Answer]) -> tuple[Floats, Floats, Floats]:
    """Values (...) at times (...), and their bounds."""
    asked = np.asarray(times, dtype=float)
    flat = reals("times", asked.ravel(), (None,), minimum=0)
    latest = question(float(flat.max(initial=0.0)))  # one pass serves all
    found = [latest if time == flat.max() else question(float(time)) for time in flat]
    values, low, high = (
        np.array([(each.value, each.low, each.high) for each in found]).reshape(-1, 3).T.reshape(3, *asked.shape)
    )
    return values, low, high


def _probabilities(q: ArrayLike) -> Floats:
    asked = np.asarray(q, dtype=float)
    if np.any(~((asked >= 0) & (asked < 1))):
        raise ValueError(f"q = {asked}; expected probabilities from 0 to below 1")
    return asked
