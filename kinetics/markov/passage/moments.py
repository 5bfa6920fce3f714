"""Mean, variance and probability of a first-passage time by linear equations on the states before the target."""

from __future__ import annotations

from functools import partial
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from kinetics.markov.passage.certified import BoundedSolution, Equations, leaving_rates
from kinetics.markov.passage.elimination import mean_over
from kinetics.markov.passage.equations import equations
from kinetics.markov.passage.first_passage import Passage
from kinetics.markov.passage.until import InfiniteMeanError
from kinetics.markov.transient.poisson import ROUNDOFF
from kinetics.markov.transient.transitions import Transitions, totals
from kinetics.support.arrays import Floats, Ints


def passage_to(
    transitions: Transitions, start: Floats, is_target: NDArray[np.bool_], target: str, unit: str = ""
) -> Passage:
    """The first-passage time of any chain from a start spread as `start` (N,) to the target states (N,)."""
    chain, begins = _lumped(transitions, is_target, start)
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


def variance_until(
    transitions: Transitions, start: Floats, rates: Floats, is_target: NDArray[np.bool_]
) -> tuple[float, float]:
    """Variance of a reward at `rates` (N,), in 1/tu, until target states (N,) that are certain; its relative error.

    ValueError: the target may never be reached, so that there is none
    """
    chain, begins = _lumped(transitions, is_target, start)
    if not begins[:-1].any():
        return 0.0, 0.0
    inner = _inner(chain, begins)
    if not inner.is_certain:
        raise InfiniteMeanError(
            "the target may never be reached, so the reward until then has no finite variance; ask for a target that "
            "is certain"
        )
    rewards = rates[~is_target][inner.places]
    if not rewards.any():
        return 0.0, 0.0
    chances = equations(inner.rows, inner.columns, inner.rates, inner.hits, transitions.roundings)
    means = _checked(chances.solved(rewards), inner.first)
    return _variance(chances, inner, float(begins[-1]), means, rewards)


def _sd(chances: Equations, inner: _Inner, there: float, means: BoundedSolution) -> tuple[float, float]:
    """Standard deviation and its relative error; there : probability of beginning in the target."""
    variance, error = _variance(chances, inner, there, means, np.ones(inner.first.size))
    # Half the relative error of the variance, and that of a root.
    return float(np.sqrt(variance)), 0.5 * error + ROUNDOFF


def _variance(
    chances: Equations, inner: _Inner, there: float, means: BoundedSolution, rewards: Floats
) -> tuple[float, float]:
    """Variance of what accumulates at rates (n,) until the target, and its relative error."""
    variances, doubt = _variances(chances, inner, means, rewards)
    spread, more = _spread(inner.first, there, means)
    within, wrong = variances.mean(inner.first)
    variance = within + spread
    terms = 8.0 + chances.given + int(np.count_nonzero(inner.first))
    return variance, wrong + 1.01 * ((mean_over(inner.first, doubt) + more) / variance + terms * ROUNDOFF)


class _Inner(NamedTuple):
    """The transient states (n,) between the start and the target: reachable from the one, coreachable to the other.

    rows, columns, rates : (K,) jumps among them; hits, losses : (n,) 1/tu, into the target, and to where it is lost
    first : (n,) initial probabilities; is_certain : true if the target is reached with probability 1
    places : (n,) of these states in the chain
    """

    rows: Ints
    columns: Ints
    rates: Floats
    hits: Floats
    losses: Floats
    first: Floats
    is_certain: bool
    places: Ints


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
    entries = place[rows[inside]], place[columns[inside]], rates[inside]
    return _Inner(*entries, hits, losses, begins[transient], is_certain, np.flatnonzero(transient))


def _variances(
    chain: Equations, inner: _Inner, means: BoundedSolution, rewards: Floats
) -> tuple[BoundedSolution, Floats]:
    """Variances (n,) of what accumulates at rates (n,) from each state, and bounds on what errors of the means add.

    By the law of total variance, as a sum of squares without cancellation between its terms.
    """
    rows, columns, rates, hits, *_ = inner
    mean, each = means
    exits = totals(rows, rates, mean.size) + hits
    onward = mean - rewards / exits  # what is left after the wait in the state, whose reward has the variance (r/q)**2
    gaps = mean[columns] - onward[rows]
    spread = totals(rows, rates * gaps**2, mean.size) + hits * onward**2
    variance = chain.solved(rewards**2 / exits + spread)
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
            f"the target is too remote: with {first.size} transient states, too many to eliminate, it cannot be "
            f"solved to three digits; start nearer to the target or from smaller counts"
        )
    return solution


def _lumped(transitions: Transitions, is_target: NDArray[np.bool_], start: Floats) -> tuple[Transitions, Floats]:
    """The chain with all targets as one last state, which is never left; and the start among these."""
    n = int((~is_target).sum())
    place = np.where(is_target, n, np.cumsum(~is_target) - 1)
    goes = ~is_target[transitions.rows]
    places = place[transitions.rows[goes]], place[transitions.columns[goes]]
    chain = Transitions(*places, transitions.rates[goes], np.zeros(n + 1), transitions.rate_error)
    return chain, np.append(start[~is_target], start[is_target].sum())
