"""The first-passage time of a chain to a target: moments, distribution and quantiles, each with its bounds."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import cached_property, partial
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from kinetics.markov.passage.arrival import Arrival
from kinetics.markov.passage.certified import BoundedSolution, Equations, leaving_rates
from kinetics.markov.passage.elimination import mean_over
from kinetics.markov.passage.equations import equations
from kinetics.markov.passage.until import UNDERFLOW
from kinetics.markov.transient.poisson import ROUNDOFF
from kinetics.markov.transient.transitions import Transitions, totals
from kinetics.support.answer import Answer, kind_of
from kinetics.support.arrays import Floats, Ints, reals
from kinetics.support.extras import extra
from kinetics.support.shown import ResultTable, Shown, Tabular, on_axes
from kinetics.support.tables import counted, figure, in_unit

if TYPE_CHECKING:
    import pandas as pd

DRAWN = 201  # times of a curve


@dataclass(frozen=True, eq=False, repr=False)
class Passage(Shown, Tabular):
    """The distribution of a first-passage time.

    A run that leaves a truncated chain reaches the target at that moment at the earliest, and never at the latest: the
    cdf of the time lies between those of the two (Munsky & Khammash 2006, doi:10.1063/1.2145882). Values are those of
    the latest, bounds those of both.

    target : the target, in words
    mean : mean of the time; inf where the target may never be reached
    probability : probability of ever reaching the target
    error : relative error of mean and probability; probabilities below 1e-290 may be lost
    n_states : number of states before the target
    transitions : among these states and the target, which is the last
    start : probabilities of these states at time 0
    is_bound : whether errors and bounds are proven; not by a rate law that cannot be bounded
    time_unit : name of the unit of all times, "" where none is stated
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
        """Of what it is, its mean, and the number of states."""
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
            notes.append("truncated: the bounds hold for any behaviour outside, and the values count nothing of it")
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
            return Answer.none("a truncated chain bounds no standard deviation")
        else:
            low, high = self.quantile_bounds(what)
            found = Answer(float(self.quantile(what)), float(low), float(high))
        method = "uniformisation" if isinstance(what, float) else "linear equations"
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
        """Whether the target is reached with probability 1."""
        return bool(np.isfinite(self.mean))

    @property
    def may_reach(self) -> bool:
        """Whether some way leads to the target, however unlikely it is."""
        is_target = np.arange(self.start.size) == self.start.size - 1
        return bool(self.transitions.leading_to(is_target)[self.start > 0.0].any())

    @property
    def mean_bounds(self) -> tuple[float, float]:
        """Lower and upper bound of the mean; the upper one is inf where a chain is truncated."""
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
        """Standard deviation of the time; nan where the target may never be reached. Solved for when first asked."""
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
        """Times (...) by which the target has been reached with probability q (...); inf where that never happens."""
        asked = _probabilities(q)
        return np.array([self._quantile(float(one)) for one in asked.ravel()]).reshape(asked.shape)

    def quantile_bounds(self, q: ArrayLike) -> tuple[Floats, Floats]:
        """Lower and upper bounds of the quantiles (...); the upper one is inf where q may never be reached."""
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
        pandas = extra("pandas")

        times = self._drawn_at
        low, high = self.cdf_bounds(times)
        return pandas.DataFrame({"time": times, "probability": self.cdf(times), "low": low, "high": high})

    @on_axes
    def plot(self, ax: Any) -> Any:
        """Plot the distribution function up to the 99 % quantile, and the mean; returns `ax`."""
        from kinetics.support import plots

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


def passage_to(
    transitions: Transitions, start: Floats, is_target: NDArray[np.bool_], target: str, unit: str = ""
) -> Passage:
    """The first-passage time of any chain from a start spread as `start` (N,) to the target states (N,)."""
    chain, begins = lumped(transitions, is_target, start)
    n, there = begins.size - 1, float(begins[-1])
    is_bound = transitions.is_certified
    if not begins[:n].any():
        return Passage(target, 0.0, 1.0, 0.0, 0, chain, begins, is_bound, unit, _spread=lambda: (0.0, 0.0))
    inner = _inner(chain, begins)
    first, hits = inner.first, inner.hits
    if not first.any():
        return Passage(target, np.inf, there, 0.0, n, chain, begins, is_bound, unit)
    chances = equations(inner.rows, inner.columns, inner.rates, hits + inner.losses, transitions.roundings)
    if not inner.is_certain:
        chance, error = _checked(chances.solved(hits), first).mean(first)
        chance = min(there + chance, 1.0)
        return Passage(target, np.inf, chance, error, n, chain, begins, is_bound, unit)
    means = _checked(chances.solved(np.ones(hits.size)), first)
    mean, error = means.mean(first)
    return Passage(
        target, mean, 1.0, error, n, chain, begins, is_bound, unit, _spread=partial(_sd, chances, inner, there, means)
    )


def _sd(chances: Equations, inner: _Inner, there: float, means: BoundedSolution) -> tuple[float, float]:
    """Standard deviation and its relative error; there : probability of beginning in the target."""
    variances, doubt = _variances(chances, inner, means)
    spread, more = _spread(inner.first, there, means)
    within, wrong = variances.mean(inner.first)
    variance = within + spread
    terms = 8.0 + chances.given + int(np.count_nonzero(inner.first))
    slack = 1.01 * ((mean_over(inner.first, doubt) + more) / variance + terms * ROUNDOFF)
    # Half the relative error of the variance, and that of a root.
    return float(np.sqrt(variance)), 0.5 * (wrong + slack) + ROUNDOFF


class _Inner(NamedTuple):
    """The transient states (n,) between the start and the target: reachable from the one, coreachable to the other.

    rows, columns, rates : (K,) among them
    hits, losses : (n,) 1/tu, into the target and to where it can no longer be reached
    first : (n,) probabilities of beginning in them
    is_certain : whether the target is reached with probability 1
    """

    rows: Ints
    columns: Ints
    rates: Floats
    hits: Floats
    losses: Floats
    first: Floats
    is_certain: bool


def _inner(chain: Transitions, begins: Floats) -> _Inner:
    """The transient states of a chain whose last state is the target."""
    rows, columns, rates, *_ = chain
    is_last = np.arange(begins.size) == begins.size - 1
    coreachable = chain.leading_to(is_last)
    transient = coreachable & chain.reached_from(begins > 0) & ~is_last
    place, n = np.cumsum(transient) - 1, int(transient.sum())
    here = transient[rows]
    inside, hit, missed = here & transient[columns], here & is_last[columns], here & ~coreachable[columns]
    hits, losses = (leaving_rates(place[rows[out]], rates[out], n) for out in (hit, missed))
    is_certain = not (losses.any() or begins[~coreachable].any())
    return _Inner(
        place[rows[inside]], place[columns[inside]], rates[inside], hits, losses, begins[transient], is_certain
    )


def _variances(chain: Equations, inner: _Inner, means: BoundedSolution) -> tuple[BoundedSolution, Floats]:
    """Variances (n,) of the time from each state, and what the errors of the means may bring to each.

    That of a step's own wait plus that of where it leads: sums of squares, so that nothing cancels between them. Within
    a square means are subtracted: what that may be wrong by is added up by the same equations.
    """
    rows, columns, rates, hits, *_ = inner
    mean, each = means
    exits = totals(rows, rates, mean.size) + hits
    onward = mean - 1.0 / exits
    gaps = mean[columns] - onward[rows]
    spread = totals(rows, rates * gaps**2, mean.size) + hits * onward**2
    variance = chain.solved(1.0 / exits + spread)
    # a mean wait is as wrong as the rates and their sum
    roundings = chain.given + 8.0
    wrong = each[columns] + each[rows] + roundings * ROUNDOFF * (mean[columns] + mean[rows])
    doubt = totals(rows, rates * wrong * (2.0 * np.abs(gaps) + wrong), mean.size)
    doubt += hits * (each + roundings * ROUNDOFF * mean) * (2.0 * onward + each)
    return variance, chain.at_most(doubt, variance.values)


def _spread(first: Floats, there: float, means: BoundedSolution) -> tuple[float, float]:
    """Variance of the mean time between the beginnings, and what that may be wrong by.

    first : (n,) probabilities of beginning on the way; there : of beginning in the target
    """
    if there == 0.0 and np.count_nonzero(first) == 1:
        return 0.0, 0.0
    mean, relative = means.mean(first)
    gaps = means.values - mean
    wrong = means.errors + 8.0 * ROUNDOFF * (means.values + mean) + relative * mean
    doubt = wrong * (2.0 * np.abs(gaps) + wrong)
    return mean_over(first, gaps**2) + there * mean**2, mean_over(first, doubt) + there * 3.0 * mean * wrong.max()


def _checked(solution: BoundedSolution, first: Floats) -> BoundedSolution:
    """The solution, where its entries are numbers and its mean over the beginnings is known to three digits."""
    if not np.isfinite(solution.values).all():
        raise ValueError(
            "the target is too remote: a mean time until it is beyond 1e308 tu; start nearer to the target"
        )
    if not solution.mean(first)[1] < 1e-3:
        raise ValueError(
            f"the target is too remote: with {first.size} states on the way, too many to eliminate, it cannot be "
            f"solved for to three digits; start nearer to the target, or from fewer copies"
        )
    return solution


def lumped(transitions: Transitions, is_target: NDArray[np.bool_], start: Floats) -> tuple[Transitions, Floats]:
    """The chain with all targets as one last state, which is never left; and the start among these."""
    n = int((~is_target).sum())
    place = np.where(is_target, n, np.cumsum(~is_target) - 1)
    goes = ~is_target[transitions.rows]
    places = place[transitions.rows[goes]], place[transitions.columns[goes]]
    chain = Transitions(*places, transitions.rates[goes], np.zeros(n + 1), transitions.rate_error)
    return chain, np.append(start[~is_target], start[is_target].sum())
