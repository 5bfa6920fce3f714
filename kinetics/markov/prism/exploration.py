"""The states that a model can reach, and its transitions between them.

States are taken many at once. Where few are waiting, as of a chain of 100,000 states in a row, states near to them are
taken along before they are known to be reached: what leads on from those that turn out not to be is forgotten, and so
is what is wrong with them.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from kinetics.markov.prism.moves import Moves, moves_of
from kinetics.markov.prism.system import System
from kinetics.markov.transient.search import MAX_BYTES, TooManyStatesError, key_multipliers, keys_of, state_bytes
from kinetics.native import state_tables, twins
from kinetics.support.arrays import Floats, Ints

Mask = NDArray[np.bool_]
BATCH = 2**14  # states at a time
FEW = 2**10  # waiting states, to which others are added
LEAST_AHEAD, MOST_AHEAD = 2**6, 2**13  # states that are added to those, twice
AGAIN = 50  # so often few are waiting until it is tried again, after it was not worth it
SOME = 2**6  # moves whose steps are tried again
ADVICE = "Choose smaller ranges or constants, or raise max_states (--max-states) if the memory allows it"


class Explored(NamedTuple):
    """N states and K transitions, those of a state to itself included.

    states : (N, V), the first is where the chain starts
    rows, columns : (K,) from which state to which
    rates, actions : (K,) 1/tu, and the number of the action behind each
    roundings : bound on the relative errors of all rates, in 2**-53
    """

    states: Ints
    rows: Ints
    columns: Ints
    rates: Floats
    actions: Ints
    roundings: float


def explored(system: System, start: Ints, max_states: int) -> Explored:
    """All states that are reached from one (V,). Cost: linear in states times commands.

    TooManyStatesError: there are more than `max_states`, or than memory holds; ModelTextError: as `moves_of` has it, in
    a state that is reached

    >>> from kinetics.markov.prism.exploration import explored
    >>> from kinetics.markov.prism.parsing import model_text
    >>> from kinetics.markov.prism.resolving import system_of
    >>> text = "ctmc module pump up : [0..9] init 2; [] up > 0 -> 0.1 * up : (up'=up-1); endmodule"
    >>> pump = system_of(model_text(text), {})
    >>> explored(pump, pump.starts, 100).states.tolist()
    [[2], [0], [1]]
    """
    search = _Exploring(system, start, max_states)
    while search.goes_on():
        pass
    return search.found()


class _Exploring:
    def __init__(self, system: System, start: Ints, max_states: int) -> None:
        self._system, n_variables = system, start.size
        self._most = min(max_states, MAX_BYTES // state_bytes(n_variables))
        self._asked = max_states
        self._multipliers = key_multipliers(n_variables)
        self._table: state_tables.Table = (
            np.empty((0, n_variables), dtype=np.int64),
            np.empty(0, dtype=np.uint64),
            np.empty(0, dtype=np.int64),
        )
        self._n = 0
        self._is_done = np.zeros(0, dtype=bool)
        self._waiting = 0  # the first row that may wait
        self._parts: list[tuple[Ints, Ints, Moves]] = []
        self._ahead, self._narrow = LEAST_AHEAD, 0  # narrow: how often few were waiting
        self._steps = np.empty((0, n_variables), dtype=np.int64)  # what some of the last moves changed
        self._add(start[np.newaxis])

    def goes_on(self) -> bool:
        """Take some of the waiting states; False if there are none."""
        rows = self._waiting + np.flatnonzero(~self._is_done[self._waiting : self._n])[:BATCH]
        if not rows.size:
            return False
        front = self._table[0][rows]
        taken, moves = self._taken(front)
        if len(taken) > len(front):
            reached, moves = _reached(taken, len(front), moves, self._multipliers)
            # Few of those taken along were needed: take fewer; else more.
            is_worth_it = 4 * (len(reached) - len(front)) >= len(taken) - len(front)
            self._ahead = min(2 * self._ahead, MOST_AHEAD) if is_worth_it else self._ahead // 2
            taken = reached
        some = moves.picked(np.arange(min(moves.rows.size, SOME)))
        self._steps = np.unique(some.targets - taken[some.rows], axis=0)
        places = self._add(taken)
        self._is_done[places] = True
        columns = self._add(moves.targets)
        self._parts.append((places[moves.rows], columns, moves._replace(targets=moves.targets[:0])))
        self._waiting = int(rows[-1]) + 1
        return True

    def found(self) -> Explored:
        """What was found."""
        rows, columns, moves = zip(*self._parts, strict=True)
        whole = [
            np.concatenate(arrays) for arrays in zip(*((m.rates, m.actions, m.roundings) for m in moves), strict=True)
        ]
        return Explored(
            self._table[0][: self._n].copy(),
            np.concatenate(rows),
            np.concatenate(columns),
            whole[0],
            whole[1],
            float(whole[2].max(initial=0.0)),
        )

    def _taken(self, front: Ints) -> tuple[Ints, Moves]:
        """States (n, V), those of the front first, and their moves."""
        if len(front) < FEW:
            self._narrow += 1
            if self._narrow % AGAIN == 0:
                self._ahead = max(self._ahead, LEAST_AHEAD)
        if len(front) < FEW and self._ahead >= LEAST_AHEAD:
            near = self._near(front)
            if len(near):
                taken = np.concatenate([front, near])
                failed = np.zeros(len(taken), dtype=bool)
                moves = moves_of(self._system, taken, failed)
                if not failed[: len(front)].any():
                    kept = moves.picked(~failed[moves.rows])
                    return taken[~failed], kept._replace(rows=(np.cumsum(~failed) - 1)[kept.rows])
        return front, moves_of(self._system, front)

    def _near(self, front: Ints) -> Ints:
        """Unknown states near those of the front: in a cube of values around each, and on along the last steps."""
        low, high = self._system.ranges.T
        most, widths = self._ahead // len(front), high - low + 1
        width = 1
        while np.prod(np.minimum(widths, 2 * width), dtype=np.float64) <= most and width < widths.max():
            width *= 2
        sizes = np.minimum(widths, width)
        parts = []
        if 1 < np.prod(sizes, dtype=np.float64) <= most:
            cube = np.stack([axis.ravel() for axis in np.indices(sizes)], axis=1)
            begin = np.clip(front - sizes // 2, low, high + 1 - sizes)  # within the ranges as a whole
            parts.append(begin[:, np.newaxis] + cube)
        far = np.arange(1, 1 + most // max(len(self._steps), 1))[:, np.newaxis]
        parts += [front[:, np.newaxis] + far * step for step in self._steps]
        around = np.concatenate([part.reshape(-1, low.size) for part in [front[:0], *parts]])
        around = around[((around >= low) & (around <= high)).all(axis=1)]
        keys = keys_of(around, self._multipliers)
        _, first = np.unique(keys, return_index=True)
        around, keys = around[first], keys[first]
        known = state_tables.find(around, keys, self._table)
        return np.asarray(around[known < 0])

    def _add(self, states: Ints) -> Ints:
        """Rows (n,) of states (n, V), which are added where they are new."""
        keys, room = keys_of(states, self._multipliers), self._n + len(states)
        if room > self._table[1].size:
            room = max(room, 2 * self._n)
            self._table = state_tables.enlarged(self._table, self._n, room)
            self._is_done = np.append(self._is_done, np.zeros(room - self._is_done.size, dtype=bool))
        rows = np.empty(len(states), dtype=np.int64)
        self._n = state_tables.insert(states, keys, self._table, self._n, rows)
        if self._n > self._most:
            held = "" if self._most == self._asked else f", all that {MAX_BYTES // 2**20} MB hold"
            raise TooManyStatesError.of(f"over {self._most} states are reachable{held}", ADVICE)
        return rows


def _reached(taken: Ints, n_front: int, moves: Moves, multipliers: NDArray[np.uint64]) -> tuple[Ints, Moves]:
    """The states that are reached from the first ones by way of those taken, and their moves."""
    keys = keys_of(taken, multipliers)
    table = taken, keys, state_tables.tabulate(keys, keys.size, state_tables.slots_for(keys.size))
    inside = state_tables.find(moves.targets, keys_of(moves.targets, multipliers), table)
    order = np.argsort(moves.rows, kind="stable")
    order = order[inside[order] >= 0]
    begins = np.searchsorted(moves.rows[order], np.arange(len(taken) + 1)).astype(np.int64)
    found = np.arange(len(taken)) < n_front
    queue = np.arange(len(taken), dtype=np.int64)
    twins.reach(begins, inside[order].astype(np.int64), queue, n_front, found)
    place = np.cumsum(found) - 1
    kept = moves.picked(found[moves.rows])
    return taken[found], kept._replace(rows=place[kept.rows])
