"""The observables of a model as rewards and variables of its chain."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from kinetics.markov.chain import Chain
from kinetics.markov.checks import Reward
from kinetics.markov.rewards import named_reward
from kinetics.network import Model
from kinetics.network.predicates import weights_of, whole_sums
from kinetics.support.arrays import Floats, Ints


def observing(chain: Chain, model: Model) -> Chain:
    """The chain of a model, made such that its questions may also name the observables.

    Sums are rewards unless they may be negative, and variables of conditions where they are whole. Those named like a
    species are left out.

    >>> from kinetics import Chain, Model, Network
    >>> dimers = Model(Network.from_text("2 A <-> D, 1, 1"), {"A": 6}, {"bodies": {"A": 1, "D": 1}})
    >>> observed = observing(Chain.of(dimers), dimers)
    >>> observed.states("bodies <= 4").tolist()
    [False, False, True, True]
    """
    sums = whole_sums(model, chain.counts)
    counts = np.column_stack([chain.counts, *sums.values()])
    rewards = _rewards(model, chain.counts)
    return replace(chain, variables=(*chain.variables, *sums), counts=counts, rewards=rewards)


def reward_rates(model: Model, name: str | None, counts: Ints) -> Floats:
    """The rates (N,) of the reward of a name in states (N, S), as the chain of `observing` has it."""
    sums = whole_sums(model, counts)
    rewards = {each: Reward(values) for each, values in _rewards(model, counts).items()}
    columns = np.column_stack([counts, *sums.values()])
    return np.asarray(named_reward(name, rewards, (*model.network.species, *sums), columns, len(counts)).rates)


def _rewards(model: Model, counts: Ints) -> dict[str, Floats]:
    """The sums (N,) that are never negative, in states (N, S)."""
    return {name: counts @ weights for name, weights in weights_of(model) if (weights >= 0).all()}
