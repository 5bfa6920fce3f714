"""The steps of a run, found one after the other: over all states that can be reached, or over likely ones that move.

Where more states can be reached than are worth listing, the time between two looks is cut into windows. Each has the
states that hold nearly all of the probability at its beginning, and those around them that this reaches within it, but
for those out of reach of the look. What leaves them, or is dropped at its end, is no longer followed. It is added up:
whatever became of it, the likelihood is no more than what the others give with all of that. So the bound is proven, and
each window is as small, and its rate of uniformisation as low, as its states allow.

Finite state projection: Munsky & Khammash (2006), doi:10.1063/1.2145882.
"""

from __future__ import annotations

from collections.abc import Callable
from math import ceil

import numpy as np

from kinetics.markov.panels.carrying import Carried, carry
from kinetics.markov.panels.data import PanelData, PanelRun
from kinetics.markov.panels.panel_step import PanelStep, ends_at, reach_of, without_record
from kinetics.markov.panels.reach import NEGLIGIBLE
from kinetics.markov.passage.until import Mask
from kinetics.markov.transient.projection import largest
from kinetics.markov.transient.search import Search, TooManyStatesError
from kinetics.markov.transient.states import StateSpace
from kinetics.network import Network
from kinetics.support.arrays import Floats, Ints

EXPLORED = 20_000  # states; where more can be reached, likely ones are enough
LOST_AT_MOST = 1e-13  # of the probability between two looks, where only likely states are kept
STEPS = 256.0  # uniformised steps of a window, on average
FIRST_LAYERS = 64  # events by which a window goes beyond the states in which it begins
SPARE_LAYERS = 3


class StepFinder:
    """The steps of a run at the rates of a network, each from the probabilities after the one before.

    max_states : the most states of one step; more are refused
    """

    def __init__(self, network: Network, data: PanelData, run: PanelRun, max_states: int) -> None:
        self._network, self._data, self._run, self._max_states = network, data, run, max_states
        self._states, self._look, self._layers = run.initial, 0, FIRST_LAYERS
        self._left = 0.0  # tu, before the next look; 0 where that has not been begun
        self._chance = 1.0  # of that look until now, over likely states

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
        self._layers, self._chance = FIRST_LAYERS, 1.0
        self._reach = reach_of(self._network, self._data, self._run, self._look)
        try:
            return self._whole(now, min(EXPLORED, self._max_states))
        except TooManyStatesError:
            self._left = float(self._run.lengths[self._look])
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
        is_out = self._reach.out_of_reach(self._left)
        search = Search(self._network, self._states, self._max_states)
        _extend(search, np.ones(len(search), dtype=bool), self._layers, is_out)
        share = 0.5 * LOST_AT_MOST / float(self._run.lengths[self._look])
        while True:
            # Sorted, so that those a transition apart lie close to each other in memory.
            order = np.lexsort(search.states.T[::-1])
            begins = np.argsort(order)[: len(self._states)]
            step = self._step(search.states[order], begins, is_out)
            found = carry(step, self._network, now)
            allowed = share * step.length
            if found.there[-2] <= allowed:
                break
            edge = np.zeros(len(search), dtype=bool)
            edge[order[step.rows[step.columns == len(step.states)]]] = True
            _extend(search, edge, max(self._layers // 2, 1), is_out)
        left = found.left + 2.0 * NEGLIGIBLE  # where the window went, and where it ends
        if step.look >= 0:
            self._note(float(found.there[step.ends].sum()))
            return found._replace(left=left)
        self._left -= step.length
        there = np.where(self._reach.out_of_reach(self._left)(step.states), 0.0, found.there[:-2])
        kept = largest(there, allowed)
        self._note(float(there[kept].sum()))
        # The next window is about as long, so that its probability goes about as far beyond its begins.
        reached = np.searchsorted(np.cumsum(search.levels), order[kept].max(), side="right")
        self._layers = int(reached) + SPARE_LAYERS
        step = step.with_ends(kept)
        return found._replace(step=step, left=left + float(there[~kept].sum()))

    def _note(self, chance: float) -> None:
        """Multiply the probability of the look by that of a window; ValueError where it is no more than is left out."""
        self._chance *= chance
        if self._chance <= NEGLIGIBLE:
            raise ValueError(
                f"{self._run.named(self._look)}: what was seen has a probability below {NEGLIGIBLE:g} at these rates; "
                f"begin with other values"
            )

    def _step(self, states: Ints, begins: Ints, is_out: Callable[[Ints], Mask]) -> PanelStep:
        """A step over states (N, S) from some (M,); those that are out of reach of the look are left no more."""
        network, run, look = self._network, self._run, self._look
        space = StateSpace(network, states, is_out(states))
        moves, n = space.transitions(), len(states)
        out = _ways_out(network, space, moves.leaks > 0.0)
        rows, columns = np.append(moves.rows, out[0]), np.append(moves.columns, np.full(out[0].size, n))
        channels = np.append(np.asarray(moves.channels), out[1])
        columns, _ = without_record(network, self._data, columns, channels, n + 1)
        windows = ceil(self._left * float(moves.exits.max(initial=0.0)) / STEPS)
        if windows > 1:
            length, everywhere = self._left / windows, np.arange(n)
            return PanelStep(-1, length, states, begins, everywhere, rows, columns, channels, None, states, True)
        ends, jumps, seen = ends_at(network, self._data, run, look, states)
        return PanelStep(look, self._left, states, begins, ends, rows, columns, channels, jumps, seen, True)


def _extend(search: Search, chosen: Mask, layers: int, is_out: Callable[[Ints], Mask]) -> None:
    """Add what the chosen states (N,) lead to in so many events, none of them after a state that is out of reach."""
    begin, is_stopped = 0, ~chosen
    for _ in range(layers):
        end = len(search)
        is_stopped[begin:] |= is_out(search.states[begin:])
        search.go_on(begin, end, is_stopped)
        begin, is_stopped = end, np.zeros(len(search), dtype=bool)


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
