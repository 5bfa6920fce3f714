"""Composition and rejection: exact trajectories of networks with very many channels."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from kinetics.arrays import Ints
from kinetics.methods.mass_action import mass_action
from kinetics.methods.sampling import Candidate, StepwiseSampler
from kinetics.methods.shape import Shape
from kinetics.network import Network
from kinetics.terms import Terms

if TYPE_CHECKING:
    from kinetics.kernels import rejection

LARGEST_GROUP = 16  # channels; a longer walk through a group costs more than another group


@dataclass(frozen=True)
class CompositionRejection(Candidate):
    """Composition and rejection over groups of channels (Slepoy et al. 2008; Ramaswamy & Sbalzarini 2010). Exact.

    Choose it for hundreds of channels and more, each event changing a few of them: the cost of an event grows with
    those, not with the number of channels.
    """

    name: ClassVar[str] = "rejection"

    def cost(self, shape: Shape) -> float:
        """Processor time of an event, ns; the last part is for memory out of reach of the caches."""
        return 45.0 + shape.update_cost + 0.0025 * shape.n_channels

    def sampler(self, network: Network) -> StepwiseSampler:
        """The network made ready for `kernels.rejection`."""
        from kinetics.kernels import rejection

        model, order = model_of(network)
        n_groups = model.likes.size
        if n_groups > rejection.MOST_GROUPS:
            raise ValueError(f"{n_groups} groups of channels; composition and rejection takes {rejection.MOST_GROUPS}")

        def begin(counts: Ints) -> rejection.Work:
            work = rejection.Work(
                np.empty(n_groups),
                np.empty(n_groups),
                np.empty(2 * n_groups, dtype=np.int32),
                np.empty(rejection.N_BINS * n_groups, dtype=np.int32),
                np.empty(rejection.N_BINS, dtype=np.int64),
                np.empty(rejection.N_OCTAVES),
                np.empty(rejection.N_OCTAVES),
                np.empty(3, dtype=np.int64),
                np.empty(1),
            )
            rejection.start(model, work, counts)
            return work

        def advance(work: rejection.Work, *rest: object) -> int:
            return rejection.advance(model, work, *rest)

        return StepwiseSampler(begin, advance, order)


def model_of(network: Network) -> tuple[rejection.Model, Ints]:
    """What the kernel reads, and the network's channels in the order of the kernel's."""
    from kinetics.kernels import rejection

    laws = mass_action(network)
    needed, change = network.reactant_terms, network.change_terms
    n_channels, n_species = needed.shape
    first, second = laws.first.astype(np.int64), laws.second.astype(np.int64)
    is_pair = ~laws.is_general & (second < n_species) & (second != first)
    is_like = ~laws.is_general & (second < n_species) & (second == first)
    # The owner of a pair is the one that more channels read: what changes often then changes whole groups together.
    popularity = np.append(np.bincount(needed.columns, minlength=n_species), 0)
    swaps = is_pair & (popularity[second] > popularity[first])
    owner, partner = np.where(swaps, second, first), np.where(swaps, first, second)

    order = np.argsort(owner, kind="stable")
    place = np.arange(n_channels) - np.searchsorted(owner[order], owner[order])
    starts = np.append(np.flatnonzero(place % LARGEST_GROUP == 0), n_channels)
    n_groups = starts.size - 1
    group = np.empty(n_channels, dtype=np.int64)
    group[order] = np.repeat(np.arange(n_groups), np.diff(starts))

    # Who touches what: as owner (1), or in a way that L depends on (1 more than all owners of a group).
    deep = LARGEST_GROUP + 1
    is_general = laws.is_general[needed.rows]
    ways = [
        (owner, group, np.ones(n_channels, dtype=np.int64)),
        (partner[is_pair], group[is_pair], np.full(is_pair.sum(), deep)),
        (needed.columns[is_general], group[needed.rows[is_general]], np.full(is_general.sum(), deep)),
    ]
    touched = Terms.of_entries((n_species + 1, n_groups), *(np.concatenate(part) for part in zip(*ways, strict=True)))
    changed_by, entries = change.entries_of(order)
    bounds = np.searchsorted(changed_by, np.arange(n_channels + 1))
    return rejection.Model(
        laws.coefficients[order],
        laws.factors[order],
        _flat(partner[order], laws.less[order], laws.is_general[order], bounds[:-1], bounds[1:]).astype(np.int32),
        _flat(change.columns[entries], change.copies[entries]),
        _flat(owner[order][starts[:-1]], starts[:-1], starts[1:]).astype(np.int32),
        np.bincount(group[is_like], laws.coefficients[is_like], n_groups),
        _flat(touched.starts[:-1], touched.starts[1:]).astype(np.int32),
        _flat(touched.columns, touched.copies >= deep).astype(np.int32),
    ), order


def _flat(*columns: NDArray[Any]) -> Ints:
    """Columns side by side, row after row."""
    return np.column_stack(columns).astype(np.int64).ravel()
