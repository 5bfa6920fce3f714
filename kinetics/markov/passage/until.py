"""Whether a chain reaches a target on the way through given states; the reward accumulated until then."""

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


class InfiniteMeanError(ValueError):
    """A reward has no finite mean, because it may accumulate for ever."""


class Solved(NamedTuple):
    """The accumulated reward, or the chance of an end, from every transient state.

    chain : the stopped chain; transient : (N,) its states from which the start leads to an end
    equation : of the chain on the transient states
    first : (n,) probabilities of beginning in each of the n transient states
    solution : (N,) in transient states what was solved for, elsewhere what is known; with bounds on the errors
    """

    chain: Transitions
    transient: Mask
    equation: Equations
    first: Floats
    solution: BoundedSolution

    @classmethod
    def of(cls, chain: Transitions, start: Floats, transient: Mask, known: Floats, rates: Floats) -> Solved:
        """The mean of a reward at `rates` (N,) in transient states, and of what is `known` (N,) where they end."""
        rows, columns, jumps, *_ = chain
        place, n = np.cumsum(transient) - 1, int(transient.sum())
        inside, out = transient[rows] & transient[columns], transient[rows] & ~transient[columns]
        here = place[rows[out]]
        leaving = leaving_rates(here, jumps[out], n)
        equation = equations(place[rows[inside]], place[columns[inside]], jumps[inside], leaving, chain.roundings)
        values, errors = np.where(transient, 0.0, known), np.zeros(transient.size)
        weights = leaving_rates(here, jumps[out] * values[columns[out]], n) + rates[transient]
        values[transient], errors[transient] = equation.solved(weights)
        if not np.isfinite(values).all():
            raise ValueError("the target is too remote: the reward until then is beyond 1e308; start nearer to it")
        return cls(chain, transient, equation, start[transient], BoundedSolution(values, errors))

    def mean(self) -> tuple[float, float]:
        """The mean over the start, where it is transient, and its relative error."""
        values, errors = self.solution
        return BoundedSolution(values[self.transient], errors[self.transient]).mean(self.first)


class Ending(NamedTuple):
    """A value, and how it was solved for: None if no rate matters."""

    found: Answer
    solved: Solved | None = None


def until(transitions: Transitions, start: Floats, through: Mask, target: Mask) -> Ending:
    """Probability of reaching the target (N,) at some time, on the way through states `through` (N,) alone.

    By linear equations (see `equations`), with a relative error; exactly 0 or 1 if no rate that is above 0 matters.
    """
    chain = transitions.stopped(target | ~through)
    coreachable, reachable = chain.leading_to(target), chain.reached_from(start > 0)
    if not (coreachable & reachable).any():
        return Ending(replace(IMPOSSIBLE, kind=kind_of(chain.is_certified)))
    if coreachable[reachable].all():
        return Ending(replace(CERTAIN, kind=kind_of(chain.is_certified)))
    at_once = float(start[target].sum())
    if not start[coreachable & ~target].any():
        return Ending(Answer.within(at_once, ROUNDOFF * start.size, chain.is_certified))
    transient = coreachable & reachable & ~target
    solved = Solved.of(chain, start, transient, target.astype(float), np.zeros(start.size))
    reached, relative = solved.mean()
    error = relative + ROUNDOFF * (start.size + 1)
    found = Answer.within(at_once + reached, error, chain.is_certified, UNDERFLOW)
    return Ending(found.clipped(), solved)


def always(transitions: Transitions, start: Floats, states: Mask) -> Ending:
    """Probability of never leaving `states` (N,): of entering some from which there is no way out of them."""
    trapped = states & ~transitions.stopped(~states).leading_to(~states)
    return until(transitions, start, states, trapped)


def accumulated_until(transitions: Transitions, start: Floats, rates: Floats, target: Mask) -> Ending:
    """Mean of a reward at `rates` (N,) a time unit until the target is reached.

    ValueError: the target may never be reached, and the reward has no finite mean
    """
    chain = transitions.stopped(target)
    coreachable, reachable = chain.leading_to(target), chain.reached_from(start > 0)
    if not coreachable[reachable].all():
        chance = until(transitions, start, np.ones_like(target), target).found.value
        raise InfiniteMeanError(
            f"the target is reached with probability {chance:.6g} only, so the reward until then has no finite "
            f"mean; ask "
            f"for the reward up to a time, or for a target that is certain"
        )
    transient = reachable & ~target
    if not start[transient].any():
        return Ending(IMPOSSIBLE)
    solved = Solved.of(chain, start, transient, np.zeros(start.size), rates)
    return Ending(Answer.within(*solved.mean(), chain.is_certified), solved)


def rate_reward(transitions: Transitions, rates: Floats, impulses: Floats | None) -> tuple[Floats, float]:
    """The rate (N,) of a reward that also has impulses (K,) at jumps, and the relative error of the sum."""
    if impulses is None:
        return rates, 0.0
    rows, _, jumps, *_ = transitions
    terms = int(np.bincount(rows, minlength=1).max())
    return rates + totals(rows, jumps * impulses, rates.size), ROUNDOFF * (transitions.roundings + terms + 3)
