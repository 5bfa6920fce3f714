"""The observables of a network file as rewards and variables of its chain."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from kinetics.markov.chain import Chain
from kinetics.markov.rewards import Reward, named_reward
from kinetics.network import Network
from kinetics.network.predicates import weights_of, whole_sums
from kinetics.support.arrays import Floats, Ints


def observing(chain: Chain, network: Network, observables: Mapping[str, Mapping[str, float]]) -> Chain:
    """The same chain of a network, whose questions may name these sums of counts.

    observables : name -> weight of each species in the sum; those named like a species are left out
    Sums are rewards unless they may be negative, and variables of conditions where they are whole.

    >>> from kinetics import Chain, Network
    >>> dimers = Network.from_text("2 A <-> D, 1, 1")
    >>> observed = observing(Chain.of(dimers, {"A": 6}), dimers, {"bodies": {"A": 1, "D": 1}})
    >>> observed.states("bodies <= 4").tolist()
    [False, False, True, True]
    """
    counts = np.asarray(chain.counts)
    return chain.with_variables(whole_sums(network, observables, counts)).with_rewards(
        _rewards(network, observables, counts)
    )


def earned_in(
    network: Network, observables: Mapping[str, Mapping[str, float]], name: str | None, counts: Ints
) -> Floats:
    """The rates (N,) at which states (N, S) earn the reward of a name, as the chain of `observing` has it."""
    sums = whole_sums(network, observables, counts)
    rewards = {each: Reward(values) for each, values in _rewards(network, observables, counts).items()}
    columns = np.column_stack([counts, *sums.values()])
    return np.asarray(named_reward(name, rewards, (*network.species, *sums), columns, len(counts)).rates)


def _rewards(network: Network, observables: Mapping[str, Mapping[str, float]], counts: Ints) -> dict[str, Floats]:
    """The sums (N,) that are never negative, in states (N, S)."""
    return {name: counts @ weights for name, weights in weights_of(network, observables) if (weights >= 0).all()}
