"""The dependency graph of a network: which propensities an event changes."""

from __future__ import annotations

import numpy as np

from kinetics import kernels
from kinetics.network import Network
from kinetics.network.sparse_tables import SparseTable
from kinetics.sampling.buffered import BufferedSampler
from kinetics.sampling.mass_action import mass_action
from kinetics.support.arrays import Ints


def updating_sampler(network: Network) -> BufferedSampler:
    """The network with its dependency graph, ready for `kernels.grouped`."""
    model = model_of(network)
    n_channels = len(network.channels)
    n_blocks = -(-n_channels // kernels.blocks.BLOCK)

    def begin(counts: Ints) -> kernels.grouped.GroupedWork:
        work = kernels.grouped.GroupedWork(np.empty(n_channels), np.empty(n_blocks), np.empty(n_blocks))
        kernels.grouped.start(model, work, counts)
        return work

    return BufferedSampler(
        begin, lambda work, *rest: kernels.grouped.advance(model, work, *rest), np.arange(n_channels)
    )


def model_of(network: Network) -> kernels.grouped.GroupedModel:
    """The tables of a network that `kernels.grouped` reads."""
    laws = mass_action(network)
    needed, change = network.sparse_reactants, network.sparse_stoichiometry
    n_channels, n_species = needed.shape
    n_blocks = -(-n_channels // kernels.blocks.BLOCK)
    readers = SparseTable.of_entries((n_species, n_channels), needed.columns, needed.rows, needed.copies)
    touched = SparseTable.of_entries(
        (n_species, n_blocks), needed.columns, needed.rows // kernels.blocks.BLOCK, needed.copies
    )
    pairs = [laws.first, laws.second, laws.less, laws.is_general, change.starts[:-1], change.starts[1:]]
    bounds = [readers.starts[:-1], readers.starts[1:], touched.starts[:-1], touched.starts[1:]]
    return kernels.grouped.GroupedModel(
        laws.coefficients,
        laws.factors,
        np.column_stack(pairs).astype(np.int32).ravel(),
        np.column_stack([change.columns, change.copies]).ravel(),
        np.column_stack(bounds).astype(np.int32).ravel(),
        readers.columns.astype(np.int32),
        touched.columns.astype(np.int32),
    )
