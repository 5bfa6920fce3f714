"""First-passage times to a number of copies of a species."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property, partial
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from kinetics.markov.passage.arrival import Arrival
from kinetics.markov.passage.certified import BoundedSolution, Equations, leaving_rates
from kinetics.markov.passage.elimination import mean_over
from kinetics.markov.passage.entry import reached_states
from kinetics.markov.passage.equations import equations
from kinetics.markov.transient.poisson import ROUNDOFF
from kinetics.markov.transient.search import MAX_STATES
from kinetics.markov.transient.transitions import Transitions, totals
from kinetics.network import Network
from kinetics.network.sums import Counted, in_words, summed
from kinetics.support.answer import Answer
from kinetics.support.arrays import Counts, Floats, Ints, reals, whole_number
from kinetics.support.extras import extra
from kinetics.support.shown import ResultTable, Shown, Tabular, facts, on_axes
from kinetics.support.tables import figure, in_unit

if TYPE_CHECKING:
    import pandas as pd

DRAWN = 201  # times of a curve


@dataclass(frozen=True, eq=False, repr=False)
class Passage(Shown, Tabular):
    """The distribution of a first-passage time.

    target : the target, in words
    mean : mean of the time; inf where the target may never be reached
    probability : probability of ever reaching the target
    error : relative error of mean and probability; probabilities below 1e-290 may be lost
    n_states : number of states before the target
    transitions : among these states and the target, which is the last
    start : probabilities of these states at time 0
    is_bound : whether errors and limits are proven; not by a rate law that cannot be bounded
    time_unit : name of the unit of all times, "" where none is stated

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
    _spread: Callable[[], tuple[float, float]] = field(default=lambda: (np.nan, np.nan), repr=False)

    @property
    def headline(self) -> str:
        """Of what it is, its mean, and the number of states."""
        return f"time until {self.target}: mean {self._in_words(self.mean, '.4g')}; {self.n_states} states"

    def summary(self) -> ResultTable:
        """Mean, standard deviation, probability and some quantiles, and how well they are known."""
        times = {"mean": self.mean, "sd": self.sd}
        times |= {f"{100 * q:g} % have arrived by": float(self.quantile(q)) for q in (0.05, 0.5, 0.95)}
        values = {name: self._in_words(value, ".6g") for name, value in times.items()}
        kind = "proven" if self.is_bound else "estimated"
        note = f"solved, not sampled: relative error of mean and probability {self.error:.1g}, {kind}"
        return facts(self.headline, values | {"probability": f"{self.probability:.6g}"}, [note])

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
        """Lower and upper limits of the cdf (...), from truncation and all rounding, that of the rates included.

        Where it is small, they are close relative to it.
        """
        low, high = _at(times, self._arrival.cdf)[1:]
        return low, high

    def survival_bounds(self, times: ArrayLike) -> tuple[Floats, Floats]:
        """Lower and upper limits of the survival (...), likewise."""
        low, high = _at(times, self._arrival.survival)[1:]
        return low, high

    def quantile(self, q: ArrayLike) -> Floats:
        """Times (...) by which the target has been reached with probability q (...); inf where that never happens."""
        asked = _probabilities(q)
        return np.array([self._quantile(float(one)) for one in asked.ravel()]).reshape(asked.shape)

    def quantile_bounds(self, q: ArrayLike) -> tuple[Floats, Floats]:
        """Lower and upper limits of the quantiles (...); the upper one is inf where q may never be reached."""
        asked = _probabilities(q)
        pairs = np.array([self._quantile_bounds(float(one)) for one in asked.ravel()]).reshape(-1, 2)
        return pairs[:, 0].reshape(asked.shape), pairs[:, 1].reshape(asked.shape)

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
        if self.is_certain:
            mean, sd = (self._in_words(value, ".4g") for value in (self.mean, self.sd))
            return f"time until {self.target}: mean {mean}, sd {sd}"
        return f"time until {self.target}: not certain, reached with probability {self.probability:.4g}; mean infinite"

    @property
    def _drawn_at(self) -> Floats:
        return np.linspace(0.0, self._quantile(0.99 * self.probability) or 1.0, DRAWN)

    def to_dataframe(self) -> pd.DataFrame:
        """The distribution function up to 99 % of those that arrive: time, probability, and its limits low and high."""
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
    """Values (...) at times (...), and their limits."""
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


def first_passage(
    network: Network,
    initial: Counts,
    species: Counted,
    copies: int = 1,
    max_states: int = MAX_STATES,
) -> Passage:
    """The first-passage time from `initial` to at least `copies` of a species.

    species : one, or a sum of several, as a mapping from species to weight
    max_states : networks with more states before the target are refused
    ValueError: unknown species, missing rates, too many states, or a target so remote that it cannot be solved for

    Mean and variance come from linear equations on the states before the target (Norris 1997, Markov Chains, ch. 3,
    doi:10.1017/CBO9780511810633), the distribution from uniformisation when it is first used. Where the chain may miss
    the target for good, the mean is inf and `probability` below 1. Cost: some tens of passes over the rates, or where
    that does not converge the number of states times the square of the band's width; for the distribution one step per
    uniformised event. Choose it where the states can be listed; sample otherwise.

    >>> from kinetics import Network, first_passage
    >>> decay = Network.from_text("A -> B, 0.1")
    >>> found = first_passage(decay, {"A": 3}, "B", copies=2)
    >>> round(found.mean, 6), round(found.sd, 6)  # 10/3 + 10/2, and the root of the sum of squares
    (8.333333, 6.009252)
    """
    weights, name = summed(network, species)
    wanted = whole_number("copies", copies, 0)
    space = reached_states(network, initial, max_states, stop=lambda states: states @ weights >= wanted)
    start = np.eye(1, len(space))[0]
    return passage_to(space.transitions(), start, space.is_stopped, in_words(name, wanted), network.time_unit)


def passage_to(
    transitions: Transitions, start: Floats, is_target: NDArray[np.bool_], target: str, unit: str = ""
) -> Passage:
    """The first-passage time of any chain from a start spread as `start` (N,) to the target states (N,)."""
    chain, begins = lumped(transitions, is_target, start)
    n, there = begins.size - 1, float(begins[-1])
    is_bound = transitions.is_certified
    if not begins[:n].any():
        return Passage(target, 0.0, 1.0, 0.0, 0, chain, begins, is_bound, unit, lambda: (0.0, 0.0))
    way = _way(chain, begins)
    first, hits = way.first, way.hits
    if not first.any():
        return Passage(target, np.inf, there, 0.0, n, chain, begins, is_bound, unit)
    chances = equations(way.rows, way.columns, way.rates, hits + way.losses, transitions.roundings)
    if not way.is_certain:
        chance, error = _checked(chances.solved(hits), first).mean(first)
        chance = min(there + chance, 1.0)
        return Passage(target, np.inf, chance, error, n, chain, begins, is_bound, unit)
    means = _checked(chances.solved(np.ones(hits.size)), first)
    mean, error = means.mean(first)
    return Passage(target, mean, 1.0, error, n, chain, begins, is_bound, unit, partial(_sd, chances, way, there, means))


def _sd(chances: Equations, way: _Way, there: float, means: BoundedSolution) -> tuple[float, float]:
    """Standard deviation and its relative error; there : probability of beginning in the target."""
    variances, doubt = _variances(chances, way, means)
    spread, more = _spread(way.first, there, means)
    within, wrong = variances.mean(way.first)
    variance = within + spread
    terms = 8.0 + chances.given + int(np.count_nonzero(way.first))
    slack = 1.01 * ((mean_over(way.first, doubt) + more) / variance + terms * ROUNDOFF)
    # Half the relative error of the variance, and that of a root.
    return float(np.sqrt(variance)), 0.5 * (wrong + slack) + ROUNDOFF


class _Way(NamedTuple):
    """The states (n,) that lie on some way from the start to the target.

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


def _way(chain: Transitions, begins: Floats) -> _Way:
    """Of a chain whose last state is the target."""
    rows, columns, rates, *_ = chain
    is_last = np.arange(begins.size) == begins.size - 1
    leads = chain.leading_to(is_last)
    way = leads & chain.reached_from(begins > 0) & ~is_last
    place, n = np.cumsum(way) - 1, int(way.sum())
    here = way[rows]
    inside, hit, lost = here & way[columns], here & is_last[columns], here & ~leads[columns]
    hits, losses = (leaving_rates(place[rows[out]], rates[out], n) for out in (hit, lost))
    is_certain = not (losses.any() or begins[~leads].any())
    return _Way(place[rows[inside]], place[columns[inside]], rates[inside], hits, losses, begins[way], is_certain)


def _variances(chain: Equations, way: _Way, means: BoundedSolution) -> tuple[BoundedSolution, Floats]:
    """Variances (n,) of the time from each state, and what the errors of the means may bring to each.

    That of a step's own wait plus that of where it leads: sums of squares, so that nothing cancels between them. Within
    a square means are subtracted: what that may be wrong by is added up by the same equations.
    """
    rows, columns, rates, hits, *_ = way
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
