"""Partial propensities: exact trajectories of networks with many channels among few species."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from kinetics import kernels
from kinetics.network import Network
from kinetics.sampling.base import SamplingMethod
from kinetics.sampling.buffered import BufferedSampler
from kinetics.sampling.cost_model import NetworkSize
from kinetics.sampling.mass_action import mass_action
from kinetics.support.arrays import Ints


@dataclass(frozen=True)
class PartialPropensities(SamplingMethod):
    """The partial-propensity method (Ramaswamy et al. 2009, doi:10.1063/1.3154624), an exact sampling method.

    It takes channels of at most two reactants. Choose it where many channels couple few species, as in polymerisation:
    an event costs about 50 ns, plus 1 ns per channel of a species and 0.03 ns per species. Rounding of the running sums
    is made harmless by thinning.

    >>> from kinetics import Network, PartialPropensities, simulate
    >>> dimers = Network.from_text("2 A <-> AA, 0.01, 0.1")
    >>> runs = simulate(dimers, PartialPropensities(), {"A": 20}, [0.0, 50.0], runs=100, seed=1)
    >>> bool((runs["A"] + 2 * runs["AA"] == 20).all())
    True
    """

    name: ClassVar[str] = "partial"
    start_cost: ClassVar[float] = 14e3
    takes_until: ClassVar[bool] = True
    most_reactants: ClassVar[float] = 2
    max_species: ClassVar[float] = 3000  # the table of couplings has the square of that many entries

    def cost(self, size: NetworkSize) -> float:
        """Processor time of an event, ns, with the beginning of a run of some hundred events."""
        return 92.0 + 0.04 * size.n_species + 1.0 * size.n_channels / max(1, size.n_species)

    def prepared(self, network: Network) -> BufferedSampler:
        """The network made ready for `kernels.partial`."""
        model, order = model_of(network)
        n_species, width = model.couplings.shape

        def begin(counts: Ints) -> kernels.partial.PartialWork:
            copies = np.zeros(2 * width)
            copies[: n_species + 1] = counts[model.species]
            copies[width:] = np.where(copies[:width] >= 2, copies[:width] - model.less, 0.0)
            work = kernels.partial.PartialWork(
                copies,
                np.empty(width),
                np.empty(width),
                np.empty(width // kernels.blocks.BLOCK),
                np.empty(width // kernels.blocks.BLOCK**2),
                np.zeros(1, dtype=np.int64),
            )
            kernels.partial.refresh(model, work)
            return work

        return BufferedSampler(begin, lambda work, *rest: kernels.partial.advance(model, work, *rest), order)


def model_of(network: Network) -> tuple[kernels.partial.PartialModel, Ints]:
    """The tables that `kernels.partial` reads, and the network's channels (R,) in the order of the kernel."""
    needed, change = network.sparse_reactants, network.sparse_stoichiometry
    n_channels, n_species = needed.shape
    laws = mass_action(network)
    coefficients, factors = laws.coefficients, laws.factors
    first, second = factors[:, 0].astype(np.int64), factors[:, 1].astype(np.int64)
    is_like = (first[:, 0] == second[:, 0]) & (first[:, 0] < n_species)
    is_pair = (second[:, 0] < n_species) & ~is_like
    # Owners are numbered from the species that most channels read, and own the pairs with those after them: the rows
    # of the table, of which an event renews some, are then short.
    species = np.append(np.argsort(-np.bincount(needed.columns, minlength=n_species), kind="stable"), n_species)
    number = np.argsort(species)
    owner = np.minimum(number[first[:, 0]], number[second[:, 0]])
    partner = np.maximum(number[first[:, 0]], number[second[:, 0]])

    width = -(-(n_species + 1) // kernels.blocks.BLOCK**2) * kernels.blocks.BLOCK**2
    couplings = np.zeros((n_species, width))
    np.add.at(couplings, (partner[is_pair], owner[is_pair]), coefficients[is_pair])
    is_coupled = couplings != 0
    reach = np.column_stack([is_coupled.argmax(axis=1), width - is_coupled[:, ::-1].argmax(axis=1)])
    reach[~is_coupled.any(axis=1)] = 0
    is_alone = ~(is_pair | is_like)
    less = np.zeros(width)
    less[owner[is_like]] = second[is_like, 1]

    order = np.argsort(owner, kind="stable")
    changed_by, entries = change.entries_of(order)
    return kernels.partial.PartialModel(
        couplings,
        reach,
        np.bincount(owner[is_alone], coefficients[is_alone], width).astype(float),  # of none, whole numbers
        np.bincount(owner[is_like], coefficients[is_like], width).astype(float),
        less,
        np.searchsorted(owner[order], np.arange(width + 1)),
        np.where(is_like, width + owner, partner)[order].astype(np.int32),
        coefficients[order],
        np.searchsorted(changed_by, np.arange(n_channels + 1)),
        number[change.columns[entries]],
        change.copies[entries],
        species,
        float(change.copies.max(initial=0)),
        int(np.diff(change.starts).max(initial=0)),
    ), order
