"""Composition-rejection: exact trajectories of networks with very many channels."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from kinetics import kernels
from kinetics.network import Network
from kinetics.network.sparse_tables import SparseTable
from kinetics.sampling.base import SamplingMethod
from kinetics.sampling.buffered import BufferedSampler
from kinetics.sampling.cost_model import NetworkSize
from kinetics.sampling.mass_action import MassAction, mass_action
from kinetics.support.arrays import Ints

LARGEST_GROUP = 16  # channels; a longer walk through a group costs more than another group
MOST_GROUPS = 2**20  # of 4 units of its octave at most, so that the masses add up exactly over all octaves in a double
LONGEST_LIST = 32  # groups that an event renews; beyond, its species share lists, so that tables stay in proportion
SHALLOW, DEEP = 1, 2  # how a group depends on a species: as its owner only, or in its partial propensities


@dataclass(frozen=True)
class CompositionRejection(SamplingMethod):
    """Composition-rejection over groups of channels, an exact sampling method.

    Source: Slepoy et al. (2008), doi:10.1063/1.2919546; groups as in Ramaswamy & Sbalzarini (2010),
    doi:10.1063/1.3297948.

    Choose it for networks of hundreds of channels and more of which an event affects only a few: the cost of an event
    grows with these few, not with the number of channels.

    >>> from kinetics import CompositionRejection, Network, simulate
    >>> steps = {f"step{i}": ({f"A{i}": 1}, {f"A{i + 1}": 1}) for i in range(300)}  # a wave along 300 channels
    >>> chain = Network.from_reactions(steps, [1.0] * 300)
    >>> runs = simulate(chain, CompositionRejection(), {"A0": 10}, [40.0], runs=20, seed=1)
    >>> bool((runs.counts.sum(axis=2) == 10).all())
    True
    """

    name: ClassVar[str] = "rejection"
    start_cost: ClassVar[float] = 12e3
    takes_until: ClassVar[bool] = True

    def cost(self, size: NetworkSize) -> float:
        """Processor time of an event, ns, with the beginning of a run; the last part is for memory beyond caches."""
        few, more = min(size.updated, 14.0), max(size.updated - 14.0, 0.0)
        return 52.0 + 3.5 * few + 1.2 * more + 0.001 * size.n_channels

    def unsupported_reason(self, network: Network, size: NetworkSize | None = None) -> str:
        """Why the method does not take the network; there is a limit to the groups of channels, too."""
        refusal = super().unsupported_reason(network, size)
        if refusal or len(network.channels) <= MOST_GROUPS:  # no more groups than channels
            return refusal
        owner, _ = _owners(network, mass_action(network))
        n_groups = int((-(-np.bincount(owner) // LARGEST_GROUP)).sum())
        if n_groups <= MOST_GROUPS:
            return ""
        return (
            f"the network has {n_groups} groups of channels; the method {self.name!r} takes at most {MOST_GROUPS}: "
            f"use 'auto'"
        )

    def prepared(self, network: Network) -> BufferedSampler:
        """The network made ready for `kernels.rejection`."""
        model, order = model_of(network)
        n_groups = model.groups.size

        def begin(counts: Ints) -> kernels.rejection.RejectionWork:
            work = kernels.rejection.RejectionWork(
                model.groups.view(np.uint8).copy().view(kernels.rejection.GROUP),  # as bytes: ten times as quick
                np.empty(n_groups, dtype=np.uint32),
                np.empty(kernels.rejection.N_BINS * n_groups, dtype=np.uint32),
                np.empty(kernels.rejection.N_BINS, dtype=np.int64),
                np.empty(kernels.rejection.N_BINS),
                np.empty(kernels.rejection.N_BINS),
                np.empty(kernels.rejection.N_BINS),
                np.empty(3, dtype=np.int64),
                np.empty(1),
            )
            kernels.rejection.start(model, work, counts)
            return work

        return BufferedSampler(begin, lambda work, *rest: kernels.rejection.advance(model, work, *rest), order)


def model_of(network: Network) -> tuple[kernels.rejection.RejectionModel, Ints]:
    """The tables that `kernels.rejection` reads, and the network's channels (R,) in the order of the kernel."""
    laws = mass_action(network)
    needed, change = network.sparse_reactants, network.sparse_stoichiometry
    n_channels, n_species = needed.shape
    is_second = ~laws.is_general & (laws.second < n_species)
    is_pair, is_like = is_second & (laws.second != laws.first), is_second & (laws.second == laws.first)
    owner, partner = _owners(network, laws)

    order = np.lexsort((is_second, owner))  # the owner's own channels first, whose partner is the constant 1
    place = np.arange(n_channels) - np.searchsorted(owner[order], owner[order])
    starts = np.append(np.flatnonzero(place % LARGEST_GROUP == 0), n_channels)
    group = np.empty(n_channels, dtype=np.int64)
    group[order] = np.repeat(np.arange(starts.size - 1), np.diff(starts))
    groups = np.zeros(starts.size - 1, dtype=kernels.rejection.GROUP)
    groups["owner"], groups["start"], groups["end"] = owner[order][starts[:-1]], starts[:-1], starts[1:]
    groups["like"] = np.bincount(group[is_like], laws.coefficients[is_like], groups.size)

    kind = np.where(
        laws.is_general, kernels.rejection.GENERAL, np.where(is_like, kernels.rejection.LIKE, kernels.rejection.PLAIN)
    )
    channels = np.zeros(n_channels, dtype=kernels.rejection.CHANNEL)
    channels["coefficient"], channels["partner"] = laws.coefficients[order], (4 * partner + kind)[order]
    changed_by, entries = change.entries_of(order)

    is_general = laws.is_general[needed.rows]
    deep = LARGEST_GROUP + 1  # more than all owners of a group
    ways = [
        (owner, group, np.ones(n_channels, dtype=np.int64)),
        (partner[is_pair], group[is_pair], np.full(is_pair.sum(), deep)),
        (needed.columns[is_general], group[needed.rows[is_general]], np.full(is_general.sum(), deep)),
    ]
    readers = SparseTable.of_entries(
        (n_species + 1, groups.size), *(np.concatenate(part) for part in zip(*ways, strict=True))
    )
    kinds = np.where(readers.copies >= deep, DEEP, SHALLOW)
    species, gained = change.columns[entries], change.copies[entries]
    channels["event"], lists, words = _words(changed_by, species, gained, readers, kinds, n_channels)
    return kernels.rejection.RejectionModel(channels, laws.factors[order], words, lists, groups), order


def _owners(network: Network, laws: MassAction) -> tuple[Ints, Ints]:
    """(R,) the species whose groups each channel is in, and the other one that it reads."""
    n_species = len(network.species)
    first, second = laws.first.astype(np.int64), laws.second.astype(np.int64)
    is_pair = ~laws.is_general & (second < n_species) & (second != first)
    # The owner of a pair is the one that more channels read: what changes often then changes whole groups together.
    popularity = np.append(np.bincount(network.sparse_reactants.columns, minlength=n_species), 0)
    swaps = is_pair & (popularity[second] > popularity[first])
    return np.where(swaps, second, first), np.where(swaps, first, second)


def _words(
    changed_by: Ints, species: Ints, gained: Ints, readers: SparseTable, kinds: Ints, n_channels: int
) -> tuple[Ints, NDArray[np.uint32], NDArray[np.uint32]]:
    """Tables of events and of groups to renew, as `kernels.rejection` reads them.

    A channel has one list of the groups of all species that it changes, so that each group is renewed once; if that
    would be long, it refers to the lists of its species instead.
    """
    is_joint = np.bincount(changed_by, np.diff(readers.starts)[species], n_channels) <= LONGEST_LIST
    joined = is_joint[changed_by]
    which, entries = readers.entries_of(species[joined])
    joint = SparseTable.of_entries(
        (n_channels, readers.n_columns), changed_by[joined][which], readers.columns[entries], kinds[entries]
    )
    n_listed, n_changes = np.diff(readers.starts), np.bincount(changed_by, minlength=n_channels)
    heads = np.cumsum(n_listed + 1) - n_listed - 1
    sizes = 2 + 3 * n_changes + np.diff(joint.starts)
    events = np.cumsum(sizes) - sizes + heads.size + readers.columns.size
    lists = events + 2 + 3 * n_changes
    words = np.empty(heads.size + readers.columns.size + int(sizes.sum()), dtype=np.uint32)
    words[heads] = heads + 1 + n_listed
    words[_after(heads + 1, readers)] = 2 * readers.columns + (kinds >= DEEP)  # SHALLOW comes from the owner only
    words[events], words[events + 1] = n_changes, np.where(is_joint, events + sizes, 0)
    at = events[changed_by] + 2 + 3 * (np.arange(species.size) - np.searchsorted(changed_by, changed_by))
    halves = np.ascontiguousarray(gained, dtype="<i8").view("<u4").reshape(-1, 2)
    words[at], words[at + 1], words[at + 2] = species, halves[:, 0], halves[:, 1]
    words[_after(lists, joint)] = 2 * joint.columns + (joint.copies >= DEEP)
    return events, heads.astype(np.uint32), words


def _after(starts: Ints, table: SparseTable) -> Ints:
    """Places of the entries of a table whose rows begin at these places."""
    return np.arange(table.columns.size) + np.repeat(starts - table.starts[:-1], np.diff(table.starts))
