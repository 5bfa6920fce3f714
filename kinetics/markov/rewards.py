"""The rewards of a chain by name, and their bounds where it is truncated."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from kinetics.markov.checks import Reward, checked_reward
from kinetics.support.answer import Answer, weakest
from kinetics.support.arrays import Floats

TIME = "time"


def named_reward(
    name: str | None, rewards: Mapping[str, Reward], variables: Sequence[str], counts: ArrayLike | None, n_states: int
) -> Reward:
    """The reward of a name, or the value of a variable; None for the only reward there is.

    `time`, where nothing else is called so, accumulates at rate 1: its mean until a target is that of the passage time.
    ValueError: there is none of this name, or a variable is below 0 in a state.
    """
    if name is None and len(rewards) == 1:
        name = next(iter(rewards))
    if name in rewards:
        return rewards[str(name)]
    if name in variables:
        return checked_reward(str(name), Reward(np.asarray(counts)[:, list(variables).index(str(name))]), n_states)
    if name == TIME:
        return Reward(np.ones(n_states), most=1.0)
    there = ", ".join(dict.fromkeys([*rewards, *variables])) or "none"
    came = "no reward was named" if name is None else f"unknown reward {name!r}"
    raise ValueError(f"{came}; there are {there}")


def truncation_bounds(
    mean: Callable[[Floats], Answer], rates: Floats, truncated: NDArray[np.bool_], most: float | None
) -> Answer:
    """Mean of a reward at `rates` (N,), where `mean` answers for any values (N,).

    In truncated states (N,) it is 0 at least, and at most the larger of `most` and the largest rate of other states;
    None: unknown.
    """
    known = mean(np.where(truncated, 0.0, rates))
    if not truncated.any():
        return known
    away = mean(truncated.astype(float))
    if away.high == 0.0:
        return known
    # a run that left may come back, and then accumulates at the rates of states here
    more = np.inf if most is None else 1.001 * max(most, float(rates[~truncated].max(initial=0.0))) * away.high
    seconds = known.cpu_seconds + away.cpu_seconds
    return replace(known, high=known.high + more, kind=weakest(known, away), cpu_seconds=seconds)
