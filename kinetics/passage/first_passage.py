"""First-passage times to a number of copies of a species."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from kinetics.network import Network
from kinetics.passage.elimination import Elimination, SparseFactors, equations, mean_over, relative_error
from kinetics.passage.entry import reached_states
from kinetics.solving.poisson import ROUNDOFF
from kinetics.solving.states import MAX_STATES
from kinetics.solving.transitions import Transitions, totals
from kinetics.solving.uniformisation import MAX_STEPS, Absorption, DiscreteChain
from kinetics.support.arrays import Floats, Ints, reals, whole_number

TOLERANCE = 1e-14  # probability that the distribution may leave out at a time
NEARLY = 1e-9  # by how much a quantile at the edge of what is ever reached is taken lower


@dataclass(frozen=True, eq=False)
class Passage:
    """The distribution of a first-passage time, tu.

    target : the target, in words
    mean, sd : mean and standard deviation of the time; inf and nan where the target may never be reached
    probability : probability of ever reaching the target
    error : relative error of mean and probability
    sd_error : relative error of sd, likewise
    n_states : number of states before the target
    chain : the uniformised chain on these states; its last state is the target
    start : probabilities of its states at time 0
    is_bound : whether error and sd_error are proven; not where states are too many to eliminate, or a law unbounded
    is_certified : whether the limits of cdf, survival and quantiles are proven; not where a rate law is unbounded
    """

    target: str
    mean: float
    sd: float
    probability: float
    error: float
    sd_error: float
    n_states: int
    chain: DiscreteChain = field(repr=False)
    start: Floats = field(repr=False)
    is_bound: bool = True
    is_certified: bool = True

    @property
    def is_certain(self) -> bool:
        """Whether the target is reached with probability 1."""
        return bool(np.isfinite(self.mean))

    @cached_property
    def _absorption(self) -> Absorption:
        return Absorption(self.chain, self.start)

    def cdf(self, times: ArrayLike) -> Floats:
        """Probability (...) that the target has been reached by `times` (...), tu."""
        return self._at(times)[0]

    def survival(self, times: ArrayLike) -> Floats:
        """Probability (...) that it has not been reached; summed separately, so accurate even where it is tiny."""
        return self._at(times)[1]

    def cdf_bounds(self, times: ArrayLike) -> tuple[Floats, Floats]:
        """Lower and upper limits of the cdf (...), from truncation and all rounding, that of the rates included."""
        value, _, error = self._at(times)
        return np.maximum(value - error, 0.0), np.minimum(value + error, 1.0)

    def survival_bounds(self, times: ArrayLike) -> tuple[Floats, Floats]:
        """Lower and upper limits of the survival (...)."""
        _, value, error = self._at(times)
        return np.maximum(value - error, 0.0), np.minimum(value + error, 1.0)

    def _at(self, times: ArrayLike) -> tuple[Floats, Floats, Floats]:
        asked = np.asarray(times, dtype=float)
        flat = reals("times", asked.ravel(), (None,), minimum=0)
        self._check_steps(flat.max(initial=0.0))
        found = np.array([self._absorption.at(float(time), TOLERANCE) for time in flat]).reshape(-1, 3)
        absorbed, alive, error = found.T.reshape(3, *asked.shape)
        return absorbed, alive, error

    def _check_steps(self, time: float) -> None:
        steps = self.chain.steps_until(time, TOLERANCE)
        if steps > MAX_STEPS:
            raise ValueError(
                f"the distribution of the time until {self.target} needs {steps:.3g} steps at {time:g} tu, at most "
                f"{MAX_STEPS}; mean and sd are exact without them, and a time much longer than the single waits is "
                f"nearly exponential"
            )

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
        """Quantiles of a little less and a little more: by as much as the cdf may be wrong up to twice the time."""
        middle = self._quantile(q)
        if middle == 0.0:
            return 0.0, 0.0
        if middle == np.inf:
            # Reached with just about this probability, or never.
            if q > self.probability * (1.0 + self.error):
                return np.inf, np.inf
            low = self._quantile(max(self.probability * (1.0 - self.error) - NEARLY, 0.0))
            return low if float(self._at(low)[2]) <= NEARLY else 0.0, np.inf
        error = float(self._at(2.0 * middle)[2])
        low, high = self._quantile(max(q - error, 0.0)), self._quantile(q + error)
        return low, high if high <= 2.0 * middle else np.inf

    def _quantile(self, q: float) -> float:
        """Inverts the cdf by bisection, down to the last bit."""
        if self.cdf(0.0) >= q:
            return 0.0
        if q >= self.probability:
            return float("inf")
        late = 1.0 / self.chain.rate
        while self.cdf(late) < q:
            late *= 2.0
        early = 0.0
        while True:
            middle = 0.5 * (early + late)
            if not early < middle < late:
                return late
            early, late = (middle, late) if self.cdf(middle) < q else (early, middle)

    def __str__(self) -> str:
        if self.is_certain:
            return f"time until {self.target}: mean {self.mean:.4g} tu, sd {self.sd:.4g} tu"
        return f"time until {self.target}: not certain, reached with probability {self.probability:.4g}; mean inf"

    def plot(self, ax: Any) -> Any:
        """Plot the distribution function up to the 99 % quantile, and the mean; returns `ax`."""
        from kinetics.support import plots

        last = self._quantile(0.99 * self.probability) or 1.0
        times = np.linspace(0.0, last, 201)
        return plots.passage(ax, times, self.cdf(times), self.mean, self.target)


def _probabilities(q: ArrayLike) -> Floats:
    asked = np.asarray(q, dtype=float)
    if np.any(~((asked >= 0) & (asked < 1))):
        raise ValueError(f"q = {asked}; expected probabilities from 0 to below 1")
    return asked


def first_passage(
    network: Network,
    initial: ArrayLike,
    species: str,
    copies: int = 1,
    max_states: int = MAX_STATES,
) -> Passage:
    """The first-passage time from `initial` to at least `copies` of a species.

    max_states : networks with more states before the target are refused
    ValueError: unknown species, missing rates, too many states, or a target so remote that it cannot be solved for

    Mean and variance come from linear equations on the states before the target (Norris 1997, Markov Chains, ch. 3,
    doi:10.1017/CBO9780511810633), the distribution from uniformisation when it is first used. Where the chain may miss
    the target for good, the mean is inf and `probability` below 1. Cost: the number of states times the square of the
    band's width, and for the distribution one step per uniformised event. Choose it where the states can be listed;
    sample otherwise.
    """
    index = network.index(species)
    wanted = whole_number("copies", copies, 0)
    space = reached_states(network, initial, max_states, stop=lambda states: states[:, index] >= wanted)
    start = np.eye(1, len(space))[0]
    return passage_to(space.transitions(), start, space.is_stopped, f"{wanted} {species}")


def passage_to(transitions: Transitions, start: Floats, is_target: NDArray[np.bool_], target: str) -> Passage:
    """The first-passage time of any chain from a start spread as `start` (N,) to the target states (N,)."""
    rows, columns, rates, begins = lumped(transitions, is_target, start)
    n, there = begins.size - 1, float(begins[-1])
    roundings = transitions.roundings
    chain = DiscreteChain.from_rates(rows, columns, rates, totals(rows, rates, n + 1), rate_error=roundings)
    is_certified = transitions.is_certified
    if not begins[:n].any():
        return Passage(target, 0.0, 0.0, 1.0, 0.0, 0.0, 0, chain, begins, True, is_certified)
    way = _way(rows, columns, rates, begins)
    first, hits = way.first, way.hits
    if not first.any():
        return Passage(target, np.inf, np.nan, there, 0.0, np.nan, n, chain, begins, is_certified, is_certified)
    chances = equations(way.rows, way.columns, way.rates, hits + way.losses, roundings)
    is_bound = is_certified and isinstance(chances, Elimination)
    if not way.is_certain:
        reached = _checked(chances, chances.solve(hits), first)
        error = relative_error(chances, reached, first)
        chance = min(there + mean_over(first, reached), 1.0)
        return Passage(target, np.inf, np.nan, chance, error, np.nan, n, chain, begins, is_bound, is_certified)
    means = _checked(chances, chances.solve(np.ones(hits.size)), first)
    error = relative_error(chances, means, first)
    variances, doubt = _variances(chances, way, means, roundings)
    mean, spread, more = _spread(chances, first, there, means)
    variance = mean_over(first, variances) + spread
    terms = roundings + 8 + int(np.bincount(way.rows, minlength=1).max()) + int(np.count_nonzero(first))
    slack = 1.01 * ((mean_over(first, doubt) + more) / variance + terms * ROUNDOFF)
    # Half the relative error of the variance, and that of a root.
    sd_error = 0.5 * (relative_error(chances, variances, first) + slack) + ROUNDOFF
    sd = float(np.sqrt(variance))
    return Passage(target, mean, sd, 1.0, error, sd_error, n, chain, begins, is_bound, is_certified)


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


def _way(rows: Ints, columns: Ints, rates: Floats, begins: Floats) -> _Way:
    """Of a chain whose last state is the target."""
    chain = Transitions(rows, columns, rates, np.zeros(begins.size))
    is_last = np.arange(begins.size) == begins.size - 1
    leads = chain.leading_to(is_last)
    way = leads & chain.reached_from(begins > 0) & ~is_last
    place, n = np.cumsum(way) - 1, int(way.sum())
    here = way[rows]
    inside, hit, lost = here & way[columns], here & is_last[columns], here & ~leads[columns]
    hits, losses = (totals(place[rows[out]], rates[out], n) for out in (hit, lost))
    is_certain = not (losses.any() or begins[~leads].any())
    return _Way(place[rows[inside]], place[columns[inside]], rates[inside], hits, losses, begins[way], is_certain)


def _variances(chain: Elimination | SparseFactors, way: _Way, mean: Floats, rate_error: float) -> tuple[Floats, Floats]:
    """Variances (n,) of the time from each state, and what the errors of the means may bring to each.

    That of a step's own wait plus that of where it leads: sums of squares, so that nothing cancels between them. Within
    a square means are subtracted: what that may be wrong by is added up by the same equations.
    """
    rows, columns, rates, hits, *_ = way
    exits = totals(rows, rates, mean.size) + hits
    onward = mean - 1.0 / exits
    gaps = mean[columns] - onward[rows]
    spread = totals(rows, rates * gaps**2, mean.size) + hits * onward**2
    variance = chain.solve(1.0 / exits + spread)
    each = _each_error(chain, mean)
    # a mean wait is as wrong as the rates and their sum
    roundings = rate_error + int(np.bincount(rows, minlength=1).max()) + 8.0
    wrong = each[columns] + each[rows] + roundings * ROUNDOFF * (mean[columns] + mean[rows])
    doubt = totals(rows, rates * wrong * (2.0 * np.abs(gaps) + wrong), mean.size)
    doubt += hits * (each + roundings * ROUNDOFF * mean) * (2.0 * onward + each)
    return variance, chain.solve(doubt)


def _spread(
    chain: Elimination | SparseFactors, first: Floats, there: float, means: Floats
) -> tuple[float, float, float]:
    """Mean of the time over its start, variance between the beginnings, and what that may be wrong by.

    first : (n,) probabilities of beginning on the way; there : of beginning in the target
    """
    mean = mean_over(first, means)
    if there == 0.0 and np.count_nonzero(first) == 1:
        return mean, 0.0, 0.0
    gaps = means - mean
    wrong = _each_error(chain, means) + 8.0 * ROUNDOFF * (means + mean)
    wrong += relative_error(chain, means, first) * mean
    doubt = wrong * (2.0 * np.abs(gaps) + wrong)
    return mean, mean_over(first, gaps**2) + there * mean**2, mean_over(first, doubt) + there * 3.0 * mean * wrong.max()


def _each_error(chain: Elimination | SparseFactors, mean: Floats) -> Floats:
    return chain.error * (mean if isinstance(chain, Elimination) else np.full(mean.size, mean.max()))


def _checked(chain: Elimination | SparseFactors, solution: Floats, first: Floats) -> Floats:
    """The solution, where its entries are numbers and its mean over the beginnings is known to three digits."""
    if not np.isfinite(solution).all():
        raise ValueError(
            "the target is too remote: a mean time until it is beyond 1e308 tu; start nearer to the target"
        )
    if not relative_error(chain, solution, first) < 1e-3:
        raise ValueError(
            f"the target is too remote: with {solution.size} states on the way, too many to eliminate, it cannot be "
            f"solved for to three digits; start nearer to the target, or from fewer copies"
        )
    return solution


def lumped(transitions: Transitions, is_target: NDArray[np.bool_], start: Floats) -> tuple[Ints, Ints, Floats, Floats]:
    """Rows, columns and rates with all targets as one last state, which is never left; and the start among these."""
    n = int((~is_target).sum())
    place = np.where(is_target, n, np.cumsum(~is_target) - 1)
    goes = ~is_target[transitions.rows]
    rows, columns = place[transitions.rows[goes]], place[transitions.columns[goes]]
    return rows, columns, transitions.rates[goes], np.append(start[~is_target], start[is_target].sum())
