"""The steps of a run, found one after the other: over all states that can be reached, or over likely ones that move.

Where more states can be reached than are worth listing, the time between two looks is cut into windows. Each has the
states that hold nearly all of the probability at its beginning, and those around them that this reaches within it. What
leaves them, or is dropped at its end, is no longer followed. It is added up: whatever became of it, the likelihood is
no more than what the others give with all of that. So the bound is proven, and each window is as small, and its rate of
uniformisation as low, as its states allow.

Finite state projection: Munsky & Khammash (2006), doi:10.1063/1.2145882.
"""

from __future__ import annotations

from math import ceil

import numpy as np

from kinetics.markov.panels.carrying import Carried, carry
from kinetics.markov.panels.data import PanelData, PanelRun
from kinetics.markov.panels.panel_step import PanelStep, ends_at, hopeless, length_before, without_record
from kinetics.markov.passage.until import Mask
from kinetics.markov.transient.projection import extend, largest
from kinetics.markov.transient.search import Search, TooManyStatesError
from kinetics.markov.transient.states import StateSpace
from kinetics.network import Network
from kinetics.support.arrays import Floats, Ints

EXPLORED = 20_000  # states; where more can be reached, likely ones are enough
LOST_AT_MOST = 1e-13  # of the probability between two looks, where only likely states are kept
STEPS = 128.0  # uniformised steps of a window, on average
FIRST_LAYERS = 64  # events by which a window goes beyond the states in which it begins
SPARE_LAYERS = 3


class StepFinder:
    """The steps of a run at the rates of a network, each from the probabilities after the one before.

    max_states : the most states of one step; more are refused
    """

    def __init__(self, network: Network, data: PanelData, run: PanelRun, max_states: int) -> None:
        self._network, self._data, self._run, self._max_states = network, data, run, max_states
        self._states, self._look, self._layers = run.initial[None, :], 0, FIRST_LAYERS
        self._left = 0.0  # tu, before the next look; 0 where that has not been begun

    def next(self, now: Floats) -> Carried | None:
        """The next step from the probabilities now (M,); None after the last look.

        ValueError: what was seen cannot be, is too unlikely, or needs too many states
        """
        if self._look == self._run.times.size:
            return None
        found = self._window(now) if self._left else self._begun(now)
        self._states = found.step.seen_states
        if found.step.look >= 0:
            self._look += 1
            self._left = 0.0
        return found

    def _begun(self, now: Floats) -> Carried:
        """The step to the next look over all states, or the first window of many."""
        self._layers = FIRST_LAYERS
        try:
            return self._whole(now, min(EXPLORED, self._max_states))
        except TooManyStatesError:
            self._left = length_before(self._run, self._look)
        try:
            return self._window(now)
        except TooManyStatesError:
            # What was seen may leave far fewer states than are likely: so it is with many kinds, all of them seen.
            if self._max_states <= EXPLORED:
                raise
        self._left = 0.0
        return self._whole(now, self._max_states)

    def _whole(self, now: Floats, most: int) -> Carried:
        """The step to the next look over all states that lead there. TooManyStatesError: over `most` are searched"""
        step = PanelStep.of(self._network, self._data, self._run, self._look, self._states, most)
        return carry(step, self._network, now)

    def _window(self, now: Floats) -> Carried:
        """A window, with more states around it as long as too much leaves them."""
        search = Search(self._network, self._states, self._max_states)
        extend(search, np.ones(len(search), dtype=bool), self._layers)
        share = 0.5 * LOST_AT_MOST / length_before(self._run, self._look)
        while True:
            # Sorted, so that those a transition apart lie close to each other in memory.
            order = np.lexsort(search.states.T[::-1])
            begins = np.argsort(order)[: len(self._states)]
            step, is_hopeless = self._step(search.states[order], begins)
            found = carry(step, self._network, now)
            allowed = share * step.length
            if found.there[-2] <= allowed:
                break
            edge = np.zeros(len(search), dtype=bool)
            edge[order[step.rows[step.columns == len(step.states)]]] = True
            extend(search, edge, max(self._layers // 2, 1))
        if step.look >= 0:
            return found
        self._left -= step.length
        there = np.where(is_hopeless, 0.0, found.there[:-2])
        kept = largest(there, allowed)
        if not kept.any():
            raise self._unlikely()
        # The next window is about as long, so that its probability goes about as far beyond its begins.
        reached = np.searchsorted(np.cumsum(search.levels), order[kept].max(), side="right")
        self._layers = int(reached) + SPARE_LAYERS
        step = step.with_ends(kept)
        return found._replace(step=step, left=found.left + float(there[~kept].sum()))

    def _unlikely(self) -> ValueError:
        return ValueError(
            f"{self._run.named(self._look)}: what was seen has a probability below {LOST_AT_MOST:g} at these rates; "
            f"begin with other values"
        )

    def _step(self, states: Ints, begins: Ints) -> tuple[PanelStep, Mask]:
        """A step over states (N, S) from some (M,), and in which of them nothing leads to the look."""
        network, run, look = self._network, self._run, self._look
        is_hopeless = hopeless(network, self._data, run, look)(states)
        space = StateSpace(network, states, is_hopeless)
        moves, n = space.transitions(), len(states)
        out = _ways_out(network, space, moves.leaks > 0.0)
        rows, columns = np.append(moves.rows, out[0]), np.append(moves.columns, np.full(out[0].size, n))
        channels = np.append(np.asarray(moves.channels), out[1])
        columns, _ = without_record(network, self._data, columns, channels, n + 1)
        windows = ceil(self._left * float(moves.exits.max(initial=0.0)) / STEPS)
        if windows > 1:
            everywhere = np.arange(n)
            length = self._left / windows
            return PanelStep(
                -1, length, states, begins, everywhere, rows, columns, channels, None, states, True
            ), is_hopeless
        ends, jumps, seen = ends_at(network, self._data, run, look, states)
        if not len(ends):
            raise self._unlikely()
        return PanelStep(
            look, self._left, states, begins, ends, rows, columns, channels, jumps, seen, True
        ), is_hopeless


def _ways_out(network: Network, space: StateSpace, leaks: Mask) -> tuple[Ints, Ints]:
    """Rows and channels (L,) of the transitions that lead out of the states, from those that leak (N,)."""
    edge = np.flatnonzero(leaks)
    if not edge.size:
        return edge, edge
    happens = network.propensities(space.states[edge]) > 0
    happens[:, ~network.sparse_stoichiometry.has_entries] = False
    rows, channels = np.nonzero(happens)
    is_out = space.index_of(space.states[edge[rows]] + network.stoichiometry[channels]) < 0
    return edge[rows[is_out]], channels[is_out]
