"""The measures of a network, and of its initial counts, that decide what an exact sampling method costs."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from kinetics.network import Network
from kinetics.sampling.crowds import has_bounds
from kinetics.sampling.leap_length import events_of_leap
from kinetics.sampling.merging import representatives
from kinetics.support.arrays import Ints


@dataclass(frozen=True)
class NetworkSize:
    """Size and coupling of a network, and how long its propensities stay what they are.

    n_channels, n_species : R and S
    order : most reactants of a channel
    updated : propensities that an event changes, on average over the channels; those that two changed species share
        count twice
    n_merged : channels once those that change the same are merged, see `merging`
    leap_events : events of an exact leap from the initial counts; 0 if it does not pay, or counts are not given
    in_crowd, has_bounds : whether a crowd changes its rates, and whether from these counts its factors have bounds
    """

    n_channels: int
    n_species: int
    order: int
    updated: float
    n_merged: int
    leap_events: float = 0.0
    in_crowd: bool = False
    has_bounds: bool = True

    @classmethod
    def of(cls, network: Network, initial: Ints | None = None) -> NetworkSize:
        """The size of a network, as seen from the counts `initial` (S,) where they are given."""
        needed, change = network.sparse_reactants, network.sparse_stoichiometry
        n_channels, n_species = needed.shape
        readers = np.bincount(needed.columns, minlength=n_species)
        order = int(cls.orders(network).max(initial=0))
        updated = readers[change.columns].sum() / max(1, n_channels)
        n_merged = int((representatives(network) == np.arange(n_channels)).sum())
        leap_events = 0.0 if initial is None else events_of_leap(network, initial)
        crowd = network.crowding is not None, has_bounds(network, initial)
        return cls(n_channels, n_species, order, updated, n_merged, leap_events, *crowd)

    @staticmethod
    def orders(network: Network) -> Ints:
        """(R,) copies that each channel needs."""
        needed = network.sparse_reactants
        return np.bincount(needed.rows, needed.copies, minlength=needed.shape[0]).astype(np.int64)

    @property
    def update_cost(self) -> float:
        """Processor time in ns for the propensities that an event changes; the more there are, the less each costs."""
        return 9.0 * min(self.updated, 14.0) + 3.0 * max(self.updated - 14.0, 0.0)
