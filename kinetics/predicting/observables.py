"""Observables: weighted sums of counts that a prediction reports instead of all counts."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from kinetics.network import Network
from kinetics.network.predicates import Condition
from kinetics.network.sparse_tables import SparseTable
from kinetics.sampling import SamplingMethod
from kinetics.sampling.watch import MAX_EVENTS
from kinetics.support.arrays import Counts, Ints, integers

if TYPE_CHECKING:
    from kinetics.markov.transient import Distribution
    from kinetics.sampling.run_source import RunSource, Sampler


@dataclass(frozen=True, eq=False)
class Observables:
    """V named sums of the counts of S species, by whole weights (S, V).

    >>> from kinetics import Network
    >>> from kinetics.predicting import Observables
    >>> pairs = Network.from_text("2 A <-> AA, 0.01, 0.1")
    >>> Observables.of(pairs, {"all A": {"A": 1, "AA": 2}}).weights.tolist()
    [[1], [2]]
    """

    names: tuple[str, ...]
    weights: Ints
    time_unit: str = ""

    @classmethod
    def of(cls, network: Network, sums: Mapping[str, Mapping[str, float]]) -> Observables:
        """Observables from a mapping name -> weights of species; a ValueError if a weight is no whole number >= 0."""
        weights = np.zeros((len(network.species), len(sums)))
        for v, (name, terms) in enumerate(sums.items()):
            for species, weight in terms.items():
                if weight < 0 or weight != int(weight):
                    raise ValueError(f"{name!r} counts {species!r} {weight:g} times; expected a whole number >= 0")
                weights[network.index(species), v] = weight
        return cls(tuple(sums), integers("weights", weights, (None, None), minimum=0), network.time_unit)

    @cached_property
    def network(self) -> Network:
        """A network without reactions whose species are the observables: results refer to it."""
        none = SparseTable.of_entries((0, len(self.names)), [], [], [])
        return Network(self.names, (), none, none, np.ones(0), np.ones(0), time_unit=self.time_unit)

    def sampling(self, method: SamplingMethod, model: Network) -> ObservedSampling:
        """A method that samples `model` and returns the observables."""
        return ObservedSampling(self, method, model)

    def of_distribution(self, found: Distribution) -> Distribution:
        """The distribution of the observables, from that of the counts."""
        from kinetics.markov.transient import StateSpace

        sums = found.space.states @ self.weights
        _, first, which = np.unique(sums, axis=0, return_index=True, return_inverse=True)
        order = np.argsort(first)  # row 0 is the initial state
        place = np.argsort(order)[which.ravel()]
        merged = np.zeros((found.times.size, order.size))
        np.add.at(merged.T, place, found.probabilities.T)
        space = StateSpace(self.network, sums[first[order]], np.zeros(order.size, dtype=bool))
        return replace(found, space=space, probabilities=merged)


@dataclass(frozen=True, eq=False)
class ObservedSampling(SamplingMethod):
    """A sampling method that keeps observables alone; all counts exist for one block of runs at a time."""

    observables: Observables
    method: SamplingMethod
    model: Network
    name: ClassVar[str] = "observed"

    def prepared(self, network: Network) -> Sampler:  # noqa: ARG002
        """The model made ready, of whose counts `source` takes the sums."""
        return self.method.sampler(self.model)

    def source(
        self,
        network: Network,  # noqa: ARG002
        initial: Counts,
        seed: int = 0,
        max_events: int = MAX_EVENTS,
        until: str | Condition | None = None,
    ) -> RunSource:
        """The observables of the model's runs from `initial` (S,); `network` is that of the observables."""
        source = self.method.source(self.model, initial, seed, max_events, until)
        return replace(source, weights=self.observables.weights)

    def name_for(self, network: Network, initial: Counts) -> str:  # noqa: ARG002
        """The name of the method that makes the runs."""
        return self.method.name_for(self.model, initial)
