"""Whether a chain reaches a target on the way through given states; what is earned until then."""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from kinetics.markov.passage.certified import BoundedSolution, Equations, leaving_rates
from kinetics.markov.passage.equations import equations
from kinetics.markov.transient.poisson import ROUNDOFF
from kinetics.markov.transient.transitions import Transitions, totals
from kinetics.support.answer import Answer, kind_of
from kinetics.support.arrays import Floats

UNDERFLOW = 1e-290  # what probabilities may lose below
Mask = NDArray[np.bool_]
CERTAIN = Answer(1.0, 1.0, 1.0)
IMPOSSIBLE = Answer(0.0, 0.0, 0.0)


class OnTheWay(NamedTuple):
    """What is earned, or the chance of an end, from every state on the way to it.

    chain : the stopped chain; way : (N,) its states from which the start leads to an end
    equation : of the chain on the way
    first : (n,) probabilities of beginning in each of the n states on the way
    solution : (N,) on the way what was solved for, elsewhere what is known; with limits on the errors
    """

    chain: Transitions
    way: Mask
    equation: Equations
    first: Floats
    solution: BoundedSolution

    @classmethod
    def of(cls, chain: Transitions, start: Floats, way: Mask, known: Floats, earning: Floats) -> OnTheWay:
        """The mean of what is earned (N,) a time unit on the way, and of what is `known` (N,) where it ends."""
        rows, columns, rates, *_ = chain
        place, n = np.cumsum(way) - 1, int(way.sum())
        inside, out = way[rows] & way[columns], way[rows] & ~way[columns]
        here = place[rows[out]]
        leaving = leaving_rates(here, rates[out], n)
        equation = equations(place[rows[inside]], place[columns[inside]], rates[inside], leaving, chain.roundings)
        values, errors = np.where(way, 0.0, known), np.zeros(way.size)
        weights = leaving_rates(here, rates[out] * values[columns[out]], n) + earning[way]
        values[way], errors[way] = equation.solved(weights)
        if not np.isfinite(values).all():
            raise ValueError("the target is too remote: what is earned until then is beyond 1e308; start nearer to it")
        return cls(chain, way, equation, start[way], BoundedSolution(values, errors))

    def mean(self) -> tuple[float, float]:
        """The mean over the start, where it is on the way, and its relative error."""
        values, errors = self.solution
        return BoundedSolution(values[self.way], errors[self.way]).mean(self.first)


class Ending(NamedTuple):
    """A value, and how it was solved for: None where no rate matters."""

    limited: Answer
    solved: OnTheWay | None = None


def until(transitions: Transitions, start: Floats, through: Mask, target: Mask) -> Ending:
    """Probability of reaching the target (N,) at some time, on the way through states `through` (N,) alone.

    By linear equations (see `equations`), with a relative error; exactly 0 or 1 where no rate that is above 0 matters.
    """
    chain = transitions.stopped(target | ~through)
    leads, seen = chain.leading_to(target), chain.reached_from(start > 0)
    if not (leads & seen).any():
        return Ending(replace(IMPOSSIBLE, kind=kind_of(chain.is_certified)))
    if leads[seen].all():
        return Ending(replace(CERTAIN, kind=kind_of(chain.is_certified)))
    at_once = float(start[target].sum())
    if not start[leads & ~target].any():
        return Ending(Answer.within(at_once, ROUNDOFF * start.size, chain.is_certified))
    way = leads & seen & ~target
    solved = OnTheWay.of(chain, start, way, target.astype(float), np.zeros(start.size))
    reached, relative = solved.mean()
    error = relative + ROUNDOFF * (start.size + 1)
    found = Answer.within(at_once + reached, error, chain.is_certified, UNDERFLOW)
    return Ending(found.clipped(), solved)


def always(transitions: Transitions, start: Floats, states: Mask) -> Ending:
    """Probability of never leaving `states` (N,): of entering some from which there is no way out of them."""
    trapped = states & ~transitions.stopped(~states).leading_to(~states)
    return until(transitions, start, states, trapped)


def earned_until(transitions: Transitions, start: Floats, earning: Floats, target: Mask) -> Ending:
    """Mean of what is earned at `earning` (N,) a time unit until the target is reached.

    ValueError: the target may never be reached, and what is earned has no finite mean
    """
    chain = transitions.stopped(target)
    leads, seen = chain.leading_to(target), chain.reached_from(start > 0)
    if not leads[seen].all():
        chance = until(transitions, start, np.ones_like(target), target).limited.value
        raise ValueError(
            f"the target is reached with probability {chance:.6g} only, so what is earned until then has no finite "
            f"mean; ask for what is earned up to a time, or for a target that is certain"
        )
    way = seen & ~target
    if not start[way].any():
        return Ending(IMPOSSIBLE)
    solved = OnTheWay.of(chain, start, way, np.zeros(start.size), earning)
    return Ending(Answer.within(*solved.mean(), chain.is_certified), solved)


def earning_with(transitions: Transitions, earning: Floats, worth: Floats | None) -> tuple[Floats, float]:
    """What is earned (N,) a time unit, with what each jump is worth (K,), and the relative error of the sum."""
    if worth is None:
        return earning, 0.0
    rows, _, rates, *_ = transitions
    terms = int(np.bincount(rows, minlength=1).max())
    return earning + totals(rows, rates * worth, earning.size), ROUNDOFF * (transitions.roundings + terms + 3)
