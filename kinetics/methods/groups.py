"""Channels in groups, and who is touched by what: networks made ready for `kernels.grouped`."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from kinetics.arrays import Ints
from kinetics.methods.mass_action import mass_action
from kinetics.methods.sampling import StepwiseSampler
from kinetics.network import Network
from kinetics.terms import Terms

if TYPE_CHECKING:
    from kinetics.kernels import grouped

LARGEST_GROUP = 16  # channels; a longer walk through a group costs more than another group


def grouped_sampler(network: Network, in_bins: bool) -> StepwiseSampler:
    """Groups are the blocks of `kernels.ssa`; for `in_bins`, channels that read one species."""
    from kinetics.kernels import grouped, ssa

    n_channels = len(network.channels)
    if in_bins:
        order, group_starts = by_species(network.reactant_terms)
    else:
        order = np.arange(n_channels)
        group_starts = np.append(np.arange(0, n_channels, ssa.BLOCK), n_channels)
    model = model_of(network, order, group_starts)
    n_groups = group_starts.size - 1

    def begin(counts: Ints) -> grouped.Work:
        binned = n_groups if in_bins else 0
        work = grouped.Work(
            np.empty(n_channels),
            np.empty(n_groups),
            np.empty(n_groups),
            np.empty(2 * binned, dtype=np.int32),
            np.empty(grouped.N_BINS * binned, dtype=np.int32),
            np.zeros(grouped.N_BINS, dtype=np.int64),
            np.zeros(grouped.N_OCTAVES),
            np.zeros(grouped.N_OCTAVES),
            np.zeros(3, dtype=np.int64),
            np.zeros(1),
        )
        grouped.start(model, work, counts, in_bins)
        return work

    def advance(work: grouped.Work, counts: Ints, *rest: object) -> int:
        return grouped.advance(model, work, counts, in_bins, *rest)

    return StepwiseSampler(begin, advance, order)


def by_species(needed: Terms) -> tuple[Ints, Ints]:
    """Channels in the order of their groups, and the first of each group (G + 1,).

    A channel belongs to that of its reactants which most channels read: when that one changes, a whole group changes
    together.
    """
    n_channels, n_species = needed.shape
    popularity = np.bincount(needed.columns, minlength=n_species)
    owner = np.full(n_channels, n_species)  # of channels without a reactant
    rising = np.argsort(popularity[needed.columns], kind="stable")
    owner[needed.rows[rising]] = needed.columns[rising]  # the most popular is written last
    order = np.argsort(owner, kind="stable")
    place = np.arange(n_channels) - np.searchsorted(owner[order], owner[order])
    is_first = place % LARGEST_GROUP == 0
    return order, np.append(np.flatnonzero(is_first), n_channels)


def model_of(network: Network, order: Ints, group_starts: Ints) -> grouped.Model:
    """What the kernel reads of a network whose channels come in this order, in groups that start so."""
    from kinetics.kernels import grouped

    laws = mass_action(network)
    pairs = np.column_stack([laws.first, laws.second, laws.less, laws.is_general]).astype(np.int64)
    needed, change = network.reactant_terms, network.change_terms
    n_channels, n_species = needed.shape
    n_groups = group_starts.size - 1
    rank = np.empty(n_channels, dtype=np.int64)
    rank[order] = np.arange(n_channels)
    changed_by, entries = change.entries_of(order)
    change_starts = np.searchsorted(changed_by, np.arange(n_channels + 1))

    # Species by group: how many channels of the group read the species; all of them, or some.
    group_of = np.repeat(np.arange(n_groups), np.diff(group_starts))[rank[needed.rows]]
    touched = Terms.of_entries((n_species, n_groups), needed.columns, group_of, np.ones_like(needed.rows))
    is_whole = touched.copies == np.diff(group_starts)[touched.columns]
    whole_keys = touched.keys[is_whole]
    is_single = ~np.isin(needed.columns * n_groups + group_of, whole_keys)
    readers = np.stack([needed.columns[is_single], rank[needed.rows[is_single]]])
    readers = readers[:, np.lexsort(readers[::-1])]
    reader_starts = np.searchsorted(readers[0], np.arange(n_species + 1))

    bounds = [np.column_stack([starts[:-1], starts[1:]]) for starts in (change_starts, reader_starts, touched.starts)]
    return grouped.Model(
        laws.coefficients[order],
        laws.factors[order],
        _flat(pairs[order], bounds[0]).astype(np.int32),
        _flat(change.columns[entries], change.copies[entries]),
        _flat(group_starts[:-1], group_starts[1:]).astype(np.int32),
        _flat(bounds[1], bounds[2]).astype(np.int32),
        _flat(touched.columns, is_whole).astype(np.int32),
        readers[1].astype(np.int32),
    )


def _flat(*columns: NDArray[Any]) -> Ints:
    """Columns side by side, row after row."""
    return np.column_stack(columns).astype(np.int64).ravel()
