"""Channels that change the counts alike, merged into one whose propensity is their sum.

Which of them fires matters to no count, so the jump process of the counts stays what it was. A break that any body can
cause is one channel a partner in the network, X + Y -> parts + Y, and one in all here: k x_X (z - w_X) with
z = sum of w_Y x_Y, which all breaks share whose partners have the same weights up to a factor.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple
from weakref import WeakKeyDictionary

import numpy as np
from numpy.typing import NDArray

from kinetics import kernels
from kinetics.network import Network
from kinetics.sampling.crowds import Thinning, thinning_of
from kinetics.sampling.mass_action import MassAction, mass_action
from kinetics.support.arrays import Floats, Ints, read_only

MOST_CHANNELS = 2000  # of a network in which any are merged; among more, an event had better update what it changed
ALIKE = 1e-14  # relative difference of weights that rounding explains
WIDEST = 1e6  # ratio of weights up to which w_X is taken off a sum: at most so many roundings are lost by it


class MergedChannels(NamedTuple):
    """Propensities of G channels among S species, made from the R of a network, and what the kernels read of them.

    coefficients, first, second (G,), less (G,), is_general (G,), factors (G, K, 3) : as in `mass_action.MassAction`; a
        second of S + 1 + f stands for sum f
    terms (M, 4) : of the sums, one after another: a weight, the species s and what is taken from its copies, for
        weight * (x[s] - taken); and S + 1 + f in the last term of sum f, else 0
    thinning : of a network in a crowd; None where all events are as propensities have it
    """

    coefficients: np.ndarray
    first: np.ndarray
    second: np.ndarray
    less: np.ndarray
    is_general: np.ndarray
    factors: np.ndarray
    terms: np.ndarray
    thinning: Thinning | None = None


def representatives(network: Network) -> Ints:
    """(R,) the first of the channels that each channel can be merged with; itself where there is none before.

    They change the counts alike, and are of mass action in at most two reactants, one of them a species that is used
    up. Factors of a crowd make no difference. Cost: about 1 us a channel, once a network; among more than
    `MOST_CHANNELS`, none is merged.
    """
    if len(network.channels) > MOST_CHANNELS:
        return np.arange(len(network.channels))
    if network not in _REPRESENTATIVES:
        _REPRESENTATIVES[network] = read_only(_found_representatives(network))
    return _REPRESENTATIVES[network]


_REPRESENTATIVES: WeakKeyDictionary[Network, Ints] = WeakKeyDictionary()
_THINNINGS: WeakKeyDictionary[Network, dict[tuple[bytes, bytes], Thinning]] = WeakKeyDictionary()


def _found_representatives(network: Network) -> Ints:
    needed, change = network.sparse_reactants, network.sparse_stoichiometry
    n_channels = len(network.channels)
    representative = np.arange(n_channels)
    can = (np.bincount(needed.rows, needed.copies, n_channels) <= 2) & (_used_up(network) >= 0)
    laws = network.uncrowded.laws
    can &= np.array([name not in laws for name in network.channels], dtype=bool)
    if network.combinations == "product":
        can[needed.rows[needed.copies > 1]] = False
    seen: dict[tuple[bytes, bytes], int] = {}
    for r in np.flatnonzero(can).tolist():
        columns, copies = change.row(r)
        representative[r] = seen.setdefault((columns.tobytes(), copies.tobytes()), r)
    return representative


def _used_up(network: Network) -> Ints:
    """(R,) the first species of which a channel leaves fewer copies; -1 if there is none."""
    change = network.sparse_stoichiometry
    falls = np.flatnonzero(change.copies < 0)[::-1]
    used = np.full(len(network.channels), -1)
    used[change.rows[falls]] = change.columns[falls]
    return used


@dataclass(frozen=True, eq=False)
class Merging:
    """Which channels of a network of mass action are merged; `model` adds their rate constants.

    laws : the network's channels, those that are merged beside each other
    used (R,) : the species that a channel uses up
    members (R,), spans (G + 1,) : channel g stands for the network's members[spans[g]] to members[spans[g + 1]]
    crowded : the network, if the factors of a crowd change any of its channels, which are the last ones; else None
    """

    laws: MassAction
    used: Ints
    members: Ints
    spans: Ints
    n_species: int
    crowded: Network | None = None

    @classmethod
    def of(cls, network: Network, representative: Ints | None = None) -> Merging:
        """Channels merged with their `representative` (R,), by default wherever it can be."""
        representative = representatives(network) if representative is None else representative
        is_last = np.zeros(representative.size, dtype=bool)
        if network.crowding is not None:
            is_last = np.isin(representative, representative[network.crowding.is_changed])
        members = np.lexsort((representative, is_last))
        spans = np.append(np.flatnonzero(np.diff(representative[members], prepend=-1)), members.size)
        laws = MassAction(*(part[members] for part in mass_action(network)))
        crowded = network if is_last.any() else None
        return cls(laws, _used_up(network)[members], members, spans, len(network.species), crowded)

    @property
    def representatives(self) -> Ints:
        """(G,) the first of the network's channels that each channel stands for."""
        return self.members[self.spans[:-1]]

    def thinning(self, initial: Ints) -> Thinning | None:
        """The thinning of runs from counts (S,), its coefficients without rate constants; None without a crowd."""
        if self.crowded is None:
            return None
        known = _THINNINGS.setdefault(self.crowded, {})
        asked = initial.tobytes(), self.spans.tobytes()
        if asked not in known:
            tables = self.spans, self.members, self._partners, self.laws.less
            known[asked] = thinning_of(self.crowded, initial, *tables)
        return known[asked]

    def model(self, constants: Floats | None = None, thinning: Thinning | None = None) -> MergedChannels:
        """The tables that the kernels read; `constants` (R,) replace rate constants of 1."""
        laws, starts = self.laws, self.spans[:-1]
        shares = self._coefficients(constants)
        if thinning is not None:
            shares = shares * thinning.coefficients
            thinning = thinning._replace(coefficients=shares)
        coefficients, first, second = shares[starts], laws.first[starts], laws.second[starts]
        less = laws.less[starts]
        merged = np.flatnonzero(np.diff(self.spans) > 1)
        terms = [np.empty((0, 4))]
        if merged.size:
            row_of = np.repeat(np.arange(starts.size), np.diff(self.spans))
            table = np.zeros((starts.size, self.n_species + 1))
            np.add.at(table, (row_of, self._partners), shares)
            own = self.used[starts]
            first[merged] = own[merged]
            alone = np.zeros(starts.size)
            if thinning is not None:
                # What needs no partner is added after the sum, but for what rises with the sum of all surface.
                alone, table[:, -1] = table[:, -1].copy(), 0.0
                np.add.at(table[:, -1], row_of, shares * thinning.slopes)
                is_bare = ~table[merged].any(axis=1)
                bare, merged = merged[is_bare], merged[~is_bare]
                coefficients[bare], second[bare], less[bare] = alone[bare], self.n_species, 0.0
        while merged.size:
            weights, scale, is_alike, is_taken = _shared(table[merged], own[merged[0]])
            alike = merged[is_alike]
            coefficients[alike], second[alike] = scale[is_alike], self.n_species + len(terms)
            less[alike] = 0.0 if is_taken.any() else weights[own[alike]]
            if thinning is not None:
                less[alike] -= alone[alike] / coefficients[alike]
                surface, weights = weights[-1] * thinning.weights, np.append(weights[:-1], 0.0)
                weights[:-1] += surface
                less[alike] -= np.append(surface, 0.0)[own[alike]] * is_taken[own[alike]]
            there = np.union1d(np.flatnonzero(weights), own[alike[0]])  # at least one term, if all weights are 0
            terms.append(np.column_stack([weights[there], there, is_taken[there], np.zeros(there.size)]))
            terms[-1][-1, 3] = second[alike[0]]
            merged = merged[~is_alike]
        return MergedChannels(
            coefficients,
            first,
            second,
            less,
            laws.is_general[starts],
            laws.factors[starts],
            np.concatenate(terms),
            thinning,
        )

    def named(self, constants: Floats | None = None, thinning: Thinning | None = None) -> kernels.members.Members:
        """The tables by which kernels attribute an event to a channel of the network; arguments as for `model`."""
        weights = self._coefficients(constants)
        if thinning is not None:
            weights = weights * thinning.coefficients
        return kernels.members.Members(self.spans, self.members, weights, self._partners, self.laws.less, thinning)

    def _coefficients(self, constants: Floats | None) -> Floats:
        return self.laws.coefficients if constants is None else self.laws.coefficients * constants[self.members]

    @property
    def _partners(self) -> Ints:
        """(R,) the reactant beside the one that is used up; S, the constant 1, where there is none."""
        return np.where(self.laws.first == self.used, self.laws.second, self.laws.first)


def _shared(table: Floats, own: int) -> tuple[Floats, Floats, NDArray[np.bool_], NDArray[np.bool_]]:
    """The first row (S + 1,) of weights, the rows (n,) in terms of it, which are its multiples, and what is taken.

    In the sum itself, one copy of `own` is taken (S + 1,) if weights are too different to do so after it.
    """
    weights = table[0]
    is_taken = np.zeros(weights.size, dtype=bool)
    is_alike = np.zeros(len(table), dtype=bool)
    top = weights.argmax()
    scale = table[:, top] / (weights[top] or 1.0)
    if weights[own] > WIDEST * weights[weights > 0].min(initial=np.inf):
        is_taken[own] = True
    else:
        expected = scale[:, None] * weights
        is_alike = (np.abs(table - expected) <= ALIKE * expected).all(axis=1)
    is_alike[0] = True
    return weights, scale, is_alike, is_taken
