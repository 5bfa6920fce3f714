"""Whether a chain reaches a target on the way through given states, at all or by a time; what is earned until then."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from kinetics.passage.backward import LimitedValue, expected_at
from kinetics.passage.certified import leaving_rates
from kinetics.passage.elimination import equations
from kinetics.solving.poisson import ROUNDOFF
from kinetics.solving.transitions import Transitions
from kinetics.support.arrays import Floats

UNDERFLOW = 1e-290  # what probabilities may lose below
Mask = NDArray[np.bool_]
CERTAIN = LimitedValue(1.0, 1.0, 1.0, True)
IMPOSSIBLE = LimitedValue(0.0, 0.0, 0.0, True)


def until(transitions: Transitions, start: Floats, through: Mask, target: Mask) -> LimitedValue:
    """Probability of reaching the target (N,) at some time, on the way through states `through` (N,) alone.

    By elimination without subtractions, with a relative error; exactly 0 or 1 where no rate that is above 0 matters.
    """
    chain = transitions.stopped(target | ~through)
    leads, seen = chain.leading_to(target), chain.reached_from(start > 0)
    if not (leads & seen).any():
        return IMPOSSIBLE._replace(is_bound=chain.is_certified)
    if leads[seen].all():
        return CERTAIN._replace(is_bound=chain.is_certified)
    at_once = float(start[target].sum())
    if not start[leads & ~target].any():
        return LimitedValue.within(at_once, ROUNDOFF * start.size, chain.is_certified)
    reached, relative = _solved(chain, start, leads & seen & ~target, target, None)
    wide = relative + ROUNDOFF * (start.size + 1)
    found = LimitedValue.within(at_once + reached, wide, chain.is_certified, UNDERFLOW)
    return found._replace(value=min(found.value, 1.0), high=min(found.high, 1.0))


def always(transitions: Transitions, start: Floats, states: Mask) -> LimitedValue:
    """Probability of never leaving `states` (N,): of entering some from which there is no way out of them."""
    trapped = states & ~transitions.stopped(~states).leading_to(~states)
    return until(transitions, start, states, trapped)


def until_by(transitions: Transitions, start: Floats, through: Mask, target: Mask, time: float) -> LimitedValue:
    """Probability of reaching the target by a time, tu, on the way through states `through` (N,) alone."""
    chain = transitions.stopped(target | ~through)
    return _probability(expected_at(chain, start, target.astype(float), time))


def always_by(transitions: Transitions, start: Floats, states: Mask, time: float) -> LimitedValue:
    """Probability of not leaving `states` (N,) before a time, tu; as exact where it is tiny."""
    return _probability(expected_at(transitions.stopped(~states), start, states.astype(float), time))


def earned_until(transitions: Transitions, start: Floats, earning: Floats, target: Mask) -> LimitedValue:
    """Mean of what is earned at `earning` (N,) a time unit until the target is reached.

    ValueError: the target may never be reached, and what is earned has no finite mean
    """
    chain = transitions.stopped(target)
    leads, seen = chain.leading_to(target), chain.reached_from(start > 0)
    if not leads[seen].all():
        chance = until(transitions, start, np.ones_like(target), target).value
        raise ValueError(
            f"the target is reached with probability {chance:.6g} only, so what is earned until then has no finite "
            f"mean; ask for what is earned up to a time, or for a target that is certain"
        )
    way = seen & ~target
    if not start[way].any():
        return IMPOSSIBLE
    return LimitedValue.within(*_solved(chain, start, way, target, earning), chain.is_certified)


def _solved(chain: Transitions, start: Floats, way: Mask, target: Mask, earning: Floats | None) -> tuple[float, float]:
    """What is earned on the way, or without earnings the probability of leaving it for the target.

    With its relative error.
    """
    rows, columns, rates, *_ = chain
    place, n = np.cumsum(way) - 1, int(way.sum())
    inside, out = way[rows] & way[columns], way[rows] & ~way[columns]
    here = place[rows[out]]
    leaving = leaving_rates(here, rates[out], n)
    equation = equations(place[rows[inside]], place[columns[inside]], rates[inside], leaving, chain.roundings)
    weights = leaving_rates(here, rates[out] * target[columns[out]], n) if earning is None else earning[way]
    solution, first = equation.solved(weights), start[way]
    if not np.isfinite(solution.values).all():
        raise ValueError("the target is too remote: what is earned until then is beyond 1e308; start nearer to it")
    return solution.mean(first)


def _probability(limited: LimitedValue) -> LimitedValue:
    return limited._replace(value=min(limited.value, 1.0), low=min(limited.low, 1.0), high=min(limited.high, 1.0))
