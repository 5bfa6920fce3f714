"""The observables of a model as rewards and variables of its chain."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from kinetics.markov.chain import Chain
from kinetics.markov.checks import DEADLOCK, INIT
from kinetics.markov.predicates import StateNames
from kinetics.markov.rewards import Reward, named_reward
from kinetics.network import Model
from kinetics.network.sums import summed
from kinetics.support.arrays import Floats, Ints

BLOCK = 10**6  # propensities at a time


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


def state_names(model: Model, counts: Ints) -> StateNames:
    """What conditions may name in states (N, S), as on the chain of `observing`."""
    sums = whole_sums(model, counts)
    columns = np.column_stack([counts, *sums.values()])
    variables = (*model.network.species, *sums)
    return StateNames(len(counts), variables, columns, _Labels(model, counts, variables))


@dataclass(frozen=True, eq=False)
class _Labels(Mapping[str, NDArray[np.bool_]]):
    """The labels of every chain in states (N, S), each computed when it is asked for; not those whose name is taken."""

    model: Model
    counts: Ints
    taken: Sequence[str]

    def __getitem__(self, name: str) -> NDArray[np.bool_]:
        if name not in self:
            raise KeyError(name)
        if name == INIT:
            return np.asarray((self.counts == self.model.initial).all(axis=1))
        network = self.model.network
        leads_on = network.stoichiometry.any(axis=1)
        blocks = np.array_split(self.counts, 1 + self.counts.shape[0] * len(network.channels) // BLOCK)
        return np.concatenate([~(network.propensities(block)[:, leads_on] > 0).any(axis=1) for block in blocks])

    def __contains__(self, name: object) -> bool:
        return name in (INIT, DEADLOCK) and name not in self.taken

    def __iter__(self) -> Iterator[str]:
        return (name for name in (INIT, DEADLOCK) if name in self)

    def __len__(self) -> int:
        return sum(1 for _ in self)


def reward_rates(model: Model, name: str | None, counts: Ints) -> Floats:
    """The rates (N,) of the reward of a name in states (N, S), as the chain of `observing` has it."""
    sums = whole_sums(model, counts)
    rewards = {each: Reward(values) for each, values in _rewards(model, counts).items()}
    columns = np.column_stack([counts, *sums.values()])
    return np.asarray(named_reward(name, rewards, (*model.network.species, *sums), columns, len(counts)).rates)


def _rewards(model: Model, counts: Ints) -> dict[str, Floats]:
    """The sums (N,) that are never negative, in states (N, S)."""
    return {name: counts @ weights for name, weights in _weights(model) if (weights >= 0).all()}


def whole_sums(model: Model, counts: Ints) -> dict[str, Ints]:
    """Those of the sums that are whole numbers, in states (N, S): values (N,) by name."""
    return {
        name: counts @ np.rint(weights).astype(np.int64)
        for name, weights in _weights(model)
        if np.array_equal(weights, np.rint(weights))
    }


def _weights(model: Model) -> list[tuple[str, Floats]]:
    network = model.network
    sums = {name: sum_ for name, sum_ in model.observables.items() if name not in network.species_places}
    return [(name, summed(network, sum_)[0]) for name, sum_ in sums.items()]
