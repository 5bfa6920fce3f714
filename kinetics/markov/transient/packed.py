"""States packed into one integer each, in rising order: a chain on a set of them, whose propensities are not stored.

The counts of a state lie side by side in the bits of its key. A channel adds the same number to every key, so it keeps
the order of states; from sorted keys, the sources of all states under one channel are found by one pass.
"""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import cached_property
from math import factorial
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from kinetics.markov.transient.search import TooManyStatesError
from kinetics.markov.transient.states import CERTIFIED_ORDER, StateSpace
from kinetics.markov.transient.transitions import totals
from kinetics.native import packed
from kinetics.network import Network
from kinetics.network.network import check_homogeneous
from kinetics.support.arrays import Floats, Ints

BITS = 62  # of a key, so that sums of keys never overflow
LIVE, GOAL, FAILED = 0, 1, 2  # verdicts on states; nothing more happens in those that are not live
Verdicts = NDArray[np.int8]
Judge = Callable[[Ints], Verdicts]  # verdicts (n,) on states (n, S)


@dataclass(frozen=True, eq=False)
class Packing:
    """How the states of a network that can be reached from one are packed, and how its channels act on keys.

    bits : (S,) of each species' field
    chosen : (R,) the channels that change something at a rate above 0

    >>> from kinetics import Network
    >>> packing = Packing.of(Network.from_text("A <-> B, 2, 3"), np.array([2, 0]))
    >>> packing.counts(packing.keys(np.array([[2, 0], [0, 2]]))).tolist()
    [[2, 0], [0, 2]]
    """

    network: Network
    bits: Ints
    chosen: Ints

    @classmethod
    def of(cls, network: Network, start: Ints) -> Packing:
        """The packing for a start (S,): species that conserved quantities bound get no more room than they need.

        ValueError: the fields do not fit into a key, or the generator is not constant
        """
        check_homogeneous(network)
        n_species = start.size
        most = np.full(n_species, np.inf)
        for weights in network.conserved.values():
            if (weights >= 0.0).all():
                held = weights > 0.0
                most[held] = np.minimum(most[held], np.floor(float(start @ weights) / weights[held] + 1e-9))
        is_bounded = np.isfinite(most)
        bits = np.ones(n_species, dtype=np.int64)
        bits[is_bounded] = [max(1, int(each).bit_length()) for each in most[is_bounded]]
        n_open = int(np.count_nonzero(~is_bounded))
        if n_open:
            bits[~is_bounded] = (BITS - int(bits[is_bounded].sum())) // n_open
        if bits.sum() > BITS or (bits < 1).any() or (start >= np.left_shift(1, np.minimum(bits, 61))).any():
            raise ValueError(
                f"the counts of {n_species} species do not fit into one number of {BITS} bits, in which the "
                f"matrix-free method holds a state; use the method 'transient' or 'fsp', or sample"
            )
        works = network.sparse_stoichiometry.has_entries & (network.known_rates * network.ways > 0)
        return cls(network, bits, np.flatnonzero(works))

    @cached_property
    def shifts(self) -> Ints:
        """(S,) where each field begins: that of the last species at bit 0, so that keys are in lexicographic order."""
        return np.append(np.cumsum(self.bits[::-1])[-2::-1], 0)

    def keys(self, states: Ints) -> Ints:
        """Keys (n,) of states (n, S)."""
        return np.asarray(np.left_shift(states, self.shifts).sum(axis=1), dtype=np.int64)

    def counts(self, keys: Ints) -> Ints:
        """States (n, S) of keys (n,)."""
        found = np.empty((keys.size, self.bits.size), dtype=np.int64)
        for s, (shift, width) in enumerate(zip(self.shifts, self.bits, strict=True)):
            found[:, s] = (keys >> shift) & ((1 << int(width)) - 1)
        return found

    @cached_property
    def law_channels(self) -> Ints:
        """(L,) channels whose propensities are computed once for each state: rate laws, and combinations that are no
        product of a few falling counts."""
        network, needed = self.network, self.network.sparse_reactants
        listed = np.zeros(len(network.channels), dtype=bool)
        listed[[network.channel_places[name] for name in network.laws]] = True
        listed |= np.bincount(needed.rows, needed.copies, minlength=listed.size) > CERTIFIED_ORDER
        if network.combinations == "product":
            listed[needed.rows[needed.copies > 1]] = True
        return self.chosen[listed[self.chosen]]

    def law_values(self, keys: Ints) -> Floats:
        """Propensities (n, L) of the channels with a law."""
        return np.asarray(self.network.propensities(self.counts(keys))[:, self.law_channels])

    def rate_error(self, keys: Ints) -> float:
        """Bound on the relative error of all rates out of these states, in roundings; inf if there is none."""
        space = StateSpace(self.network, self.counts(keys), np.zeros(keys.size, dtype=bool))
        return float(space.rate_errors[self.chosen].max(initial=0.0))

    @cached_property
    def coefficients(self) -> Floats:
        """(R,) what the factors of each propensity are multiplied by, 1/tu; 1 for rate laws."""
        network, chosen = self.network, self.chosen
        needed = network.sparse_reactants
        found = network.known_rates[chosen] * network.ways[chosen]
        for k, r in enumerate(chosen.tolist()):
            if network.combinations == "distinct" and r not in self.law_channels:
                found[k] /= float(np.prod([factorial(int(copy)) for copy in needed.row(r)[1]], initial=1.0))
        found[np.isin(chosen, self.law_channels)] = 1.0
        return found

    @cached_property
    def channels(self) -> packed.ChannelArrays:
        """The channels as the kernels read them."""
        needed, changes = self.network.sparse_reactants, self.network.sparse_stoichiometry
        law_of = {int(r): k for k, r in enumerate(self.law_channels)}
        factors: list[tuple[int, float, float]] = []
        checks: list[tuple[int, int, int]] = []
        starts, begins, offsets = [0], [0], []
        for r in self.chosen.tolist():
            moved = dict(zip(*(each.tolist() for each in changes.row(r)), strict=True))
            takes = {} if r in law_of else dict(zip(*(each.tolist() for each in needed.row(r)), strict=True))
            factors += [(s, float(k), float(moved.get(s, 0))) for s, copies in takes.items() for k in range(copies)]
            checks += [(s, takes.get(s, 0), moved.get(s, 0)) for s in sorted({*moved, *takes})]
            starts.append(len(factors))
            begins.append(len(checks))
            offsets.append(sum(copies << int(self.shifts[s]) for s, copies in moved.items()))
        species = [s for s, _, _ in factors]
        less, change = (np.array([each[k] for each in factors], dtype=float) for k in (1, 2))
        checked, least, by = ([each[k] for each in checks] for k in range(3))
        laws = [law_of.get(r, -1) for r in self.chosen.tolist()]
        lists = starts, species, begins, checked, least, by, offsets, laws
        places: Any = [np.array(each, dtype=np.int64) for each in lists]
        masks = np.left_shift(1, self.bits) - 1
        return packed.ChannelArrays(self.shifts, masks, *places, less, change)  # type: ignore[call-arg]


class Rows(NamedTuple):
    """States of a set, in rising order of their keys.

    keys : (N,); verdicts : (N,) whether each is live
    laws : (N, L) propensities of the channels with a rate law
    exits : (N,) rate at which each is left, 1/tu; able : (N, W) the bits of the channels that do so
    """

    keys: Ints
    verdicts: Verdicts
    laws: Floats
    exits: Floats
    able: packed.Bits

    def picked(self, chosen: NDArray[np.bool_]) -> Rows:
        """Some of the states."""
        keys, verdicts, laws, exits, able = self
        return Rows(keys[chosen], verdicts[chosen], laws[chosen], exits[chosen], able[chosen])


class PackedChain:
    """The chain of a network on sets of packed states; live states among them are followed.

    judge : verdicts on states; None: all are live
    """

    def __init__(self, packing: Packing, judge: Judge | None, pool: ThreadPoolExecutor) -> None:
        self.packing, self.judge, self.pool = packing, judge, pool
        self.record = packing.channels.record()
        self.coefficients = packing.coefficients
        self.rate_error = 0.0

    @property
    def n_channels(self) -> int:
        """Number of channels that work."""
        return self.coefficients.size

    def rows(self, keys: Ints) -> Rows:
        """The states with these keys (N,), rising."""
        packing = self.packing
        verdicts = np.zeros(keys.size, np.int8) if self.judge is None else self.judge(packing.counts(keys))
        live = verdicts == LIVE
        laws = np.zeros((keys.size, packing.law_channels.size))
        if laws.size and live.any():
            laws[live] = packing.law_values(keys[live])
            self.rate_error = max(self.rate_error, packing.rate_error(keys[live]))
        elif not packing.law_channels.size and not self.rate_error:
            self.rate_error = packing.rate_error(keys[:1])
        exits, able = packed.exits(self.record, self.coefficients, keys, ~live, _with_none(laws))
        if not np.isfinite(exits).all():
            raise ValueError(
                "a propensity is beyond what a float can hold, 1.8e308; lower its rate constant, or start from smaller "
                "counts"
            )
        return Rows(keys, verdicts, laws, exits, able)

    def steps(self, rows: Rows, rate: float) -> tuple[packed.PackedSteps, packed.Bits]:
        """Steps of the chain of these states, uniformised at `rate`, and the bits (N, W) of channels that lead
        elsewhere."""
        table = _with_none(rows.laws)
        sources, inside = packed.sources(self.record, rows.keys, rows.verdicts != LIVE, table, self.pool)
        shares = self.coefficients / rate
        return packed.PackedSteps(
            self.record, shares, rows.keys, sources, rows.exits / rate, table
        ), rows.able & ~inside

    def spilled(self, rows: Rows, vector: Floats, leads: packed.Bits, floor: float, among: Ints) -> tuple[Ints, Floats]:
        """Keys (n,), rising, of states outside `among` to which these channels lead, and the rates times `vector` (N,)
        at which they do; flows below `floor` may be missing."""
        table = _with_none(rows.laws)
        found = packed.spill(self.record, self.coefficients, rows.keys, vector, rows.exits, leads, table, floor, among)
        if found is None:
            raise TooManyStatesError.of(
                "a count grows beyond the states that fit into one number, or a law is above 0 without its reactants",
                "Ask for earlier times, start from smaller counts, use the method 'fsp', or sample",
            )
        ends, flows = found
        keys, places = np.unique(ends, return_inverse=True)
        return keys, totals(places, flows, keys.size)


def _with_none(laws: Floats) -> Floats:
    """Values (L, N + 1) of laws (N, L), with those of no state, which are 0."""
    return np.concatenate([laws.T, np.zeros((laws.shape[1], 1))], axis=1)
