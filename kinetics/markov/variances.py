"""Variances of the rewards of a chain, with bounds: of a reward at a time, and of one until a target."""

from __future__ import annotations

import time
from dataclasses import replace

import numpy as np

from kinetics.markov.chain import EQUATIONS, Chain, Target, reward_asked
from kinetics.markov.passage.moments import variance_until
from kinetics.markov.transient_means import mean_at, one_time
from kinetics.support.answer import Answer, kind_of
from kinetics.support.arrays import Floats
from kinetics.support.tables import counted


def variance(chain: Chain, name: str | None = None, at: float | None = None, until: Target | None = None) -> Answer:
    """Variance of a reward: of its rate `at` a time, tu, or of its total `until` a target that is certain.

    By the law of total variance, as sums of squares without cancellation. Cost: two linear systems, or two passes.
    ValueError: the reward has impulses or rounded values, or the chain is truncated

    >>> from kinetics import Chain
    >>> from kinetics.markov.variances import variance
    >>> steps = Chain([[0, 2, 0], [0, 0, 1], [0, 0, 0]], 0)
    >>> round(variance(steps, "time", until=[False, False, True]).value, 9)  # 1/4 + 1
    1.25
    """
    chain.check_complete("a variance")
    given, began = reward_asked(chain, name, at, None, until, False), time.process_time()
    if given.impulses is not None:
        raise ValueError(f"reward {name!r} has impulses, of which no variance is known; ask for its mean")
    if given.error:
        raise ValueError(f"the values of reward {name!r} are rounded, so its variance has no bound; give exact numbers")
    rates = np.asarray(given.rates)
    if until is not None:
        size, goal = counted(len(chain), "state"), chain.states(until)
        value, error = variance_until(chain.transitions, chain.initial, rates, goal)
        found = Answer.within(value, error, chain.transitions.is_certified)
        return replace(found, method=EQUATIONS, cpu_seconds=time.process_time() - began, why=size)
    now = one_time("at", at)  # type: ignore[arg-type]
    mean = mean_at(chain.transitions, chain.initial, rates, now, chain.space)
    squares = squares_about(rates, mean.value)
    found = mean_at(chain.transitions, chain.initial, squares, now, chain.space)
    # The mean square about c is the variance and (mean - c)**2, which is at most the square of an error. A square
    # rounds three times, and underflows below 1e-300 of the largest.
    missed = mean.error**2 + 1e-300 * float(rates.max(initial=0.0)) ** 2
    wide = 4.0 * 2.0**-53
    low, high = max(found.low * (1.0 - wide) - missed, 0.0), found.high * (1.0 + wide)
    kind = kind_of(found.is_bound and mean.is_bound)
    return replace(found, low=low, high=high, kind=kind, cpu_seconds=time.process_time() - began)


def squares_about(rates: Floats, mean: float) -> Floats:
    """The squares (N,) of what a reward's rates (N,) differ from their mean."""
    return np.asarray((rates - mean) ** 2)
