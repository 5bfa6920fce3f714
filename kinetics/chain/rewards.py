"""What a chain earns in each state, and limits of it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import ArrayLike

from kinetics.chain.checks import Reward
from kinetics.passage.backward import LimitedValue
from kinetics.solving import Transitions
from kinetics.solving.poisson import ROUNDOFF
from kinetics.solving.transitions import totals
from kinetics.support.arrays import Floats


def named_reward(
    name: str | None, rewards: Mapping[str, Reward], variables: Sequence[str], counts: ArrayLike | None
) -> Reward:
    """The reward of a name, or the value of a variable; None for the only reward there is."""
    if name is None and len(rewards) == 1:
        name = next(iter(rewards))
    if name in rewards:
        return rewards[str(name)]
    if name in variables:
        return Reward(np.asarray(counts)[:, list(variables).index(str(name))].astype(float))
    there = ", ".join([*rewards, *variables]) or "none"
    came = "no reward was named" if name is None else f"unknown reward {name!r}"
    raise ValueError(f"{came}; there are {there}")


def earning(transitions: Transitions, reward: Reward) -> tuple[Floats, float]:
    """What is earned (N,) a time unit in each state, impulses included, and its relative error."""
    rates = np.asarray(reward.rates)
    if reward.impulses is None:
        return rates, 0.0
    rows, columns, speeds, *_ = transitions
    worth = np.asarray(reward.impulses[rows, columns]).ravel()
    terms = int(np.bincount(rows, minlength=1).max())
    return rates + totals(rows, speeds * worth, transitions.size), ROUNDOFF * (transitions.roundings + terms + 3)


def wider(limited: LimitedValue, relative: float) -> LimitedValue:
    """The same, where what was added up has a relative error of its own."""
    more = 1.001 * relative
    return limited._replace(low=limited.low * (1.0 - more), high=limited.high * (1.0 + more))


def with_more(limited: LimitedValue, lost: LimitedValue, most: float | None) -> LimitedValue:
    """The same where up to `most` a time unit is earned where the chain is `lost` as well; None: nobody knows."""
    if lost.high == 0.0:
        return limited
    more = np.inf if most is None else 1.001 * most * lost.high
    return limited._replace(high=limited.high + more, is_bound=limited.is_bound and lost.is_bound)
