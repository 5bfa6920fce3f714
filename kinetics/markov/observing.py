"""The observables of a network file as rewards and variables of its chain."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from kinetics.markov.chain import Chain
from kinetics.markov.predicates import StateNames
from kinetics.markov.rewards import Reward, named_reward
from kinetics.network import Network
from kinetics.network.sums import summed
from kinetics.support.arrays import Floats, Ints


def observing(chain: Chain, network: Network, observables: Mapping[str, Mapping[str, float]]) -> Chain:
    """A chain of a network whose questions may also name these sums of counts.

    observables : name -> weight of each species in the sum; those named like a species are left out
    Sums are rewards unless they may be negative, and variables of conditions where they are whole.

    >>> from kinetics import Chain, Network
    >>> dimers = Network.from_text("2 A <-> D, 1, 1")
    >>> observed = observing(Chain.of(dimers, {"A": 6}), dimers, {"bodies": {"A": 1, "D": 1}})
    >>> observed.states("bodies <= 4").tolist()
    [False, False, True, True]
    """
    sums = whole_sums(network, observables, chain.counts)
    counts = np.column_stack([chain.counts, *sums.values()])
    rewards = _rewards(network, observables, chain.counts)
    return replace(chain, variables=(*chain.variables, *sums), counts=counts, rewards=rewards)


def state_names(network: Network, observables: Mapping[str, Mapping[str, float]], counts: Ints) -> StateNames:
    """What conditions may name in states (N, S), as on the chain of `observing`."""
    sums = whole_sums(network, observables, counts)
    columns = np.column_stack([counts, *sums.values()])
    return StateNames(len(counts), (*network.species, *sums), columns, {})


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
    return {name: counts @ weights for name, weights in _weights(network, observables) if (weights >= 0).all()}


def whole_sums(network: Network, observables: Mapping[str, Mapping[str, float]], counts: Ints) -> dict[str, Ints]:
    """Those of the sums that are whole numbers, in states (N, S): values (N,) by name."""
    return {
        name: counts @ np.rint(weights).astype(np.int64)
        for name, weights in _weights(network, observables)
        if np.array_equal(weights, np.rint(weights))
    }


def _weights(network: Network, observables: Mapping[str, Mapping[str, float]]) -> list[tuple[str, Floats]]:
    return [
        (name, summed(network, sum_)[0]) for name, sum_ in observables.items() if name not in network.species_places
    ]
