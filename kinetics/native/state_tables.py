"""Tables of states by their hashes, in which a search looks up and adds states: in C, else by `kernels.exploration`."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from kinetics import kernels
from kinetics.native.library import (
    HashedStates,
    SearchProgress,
    SparseRows,
    StateVerdicts,
    call,
    filled,
    given,
    is_built,
)

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Words = NDArray[np.uint64]
Entries = tuple[Ints, Ints, Ints]  # starts, columns and values of a sparse table
Channels = tuple[Entries, Entries, Words]  # what each needs, what it changes, and how that changes a key
Table = tuple[Ints, Words, Ints]  # states (n, S), their keys (n,), and the slots in which rows of them lie
Verdicts = tuple[NDArray[np.bool_], NDArray[np.bool_], Ints]  # of states: stops (n,), laws at work (n, L); law of (R,)

COMPLETE, TOO_MANY, UNJUDGED, FULL = 0, 1, 2, -1  # outcomes of an exploration; FULL: go on in more room
OUTSIDE = -2  # where a channel leads out of a table of states
# Bytes: a larger table of states gets all the room that it may have; memory is taken as states come.
ALL_AT_ONCE = 2**25
MOST_LEVELS = 1024  # for which there is room at first


def tabulate(keys: Words, n: int, size: int) -> Ints:
    """Hash table of `size` slots that hold the rows of the first n keys: `exploration.tabulate`."""
    if is_built():
        slots = np.empty(size, np.int64)
        call("tabulate", keys, n, slots, size)
        return slots

    return np.asarray(kernels.exploration.tabulate(keys, n, size))


def find(asked: Ints, asked_keys: Words, table: Table) -> Ints:
    """Rows (n,) of the states asked for; -1 where there is none: `exploration.find`."""
    if not is_built():
        return np.asarray(kernels.exploration.find(asked, asked_keys, *table))
    rows = np.empty(len(asked), np.int64)
    space = _space(table)
    call("find", given(asked, np.int64), given(asked_keys, np.uint64), len(asked), space, rows)
    return rows


def insert(new: Ints, new_keys: Words, table: Table, n: int, rows: Ints) -> int:
    """Add to the first n states those that are new, for which there is room; how many there are then:
    `exploration.insert`."""
    if not is_built():
        return int(kernels.exploration.insert(new, new_keys, *table, n, rows))
    space = _space(table)
    return int(call("insert", given(new, np.int64), given(new_keys, np.uint64), len(new), space, n, rows))


def explore(
    channels: Channels, table: Table, n: int, begin: int, end: int, level_end: int, is_stopped: NDArray[np.bool_],
    judged: Table, verdicts: Verdicts, most: int,
) -> tuple[Table, int, int, int, int, Ints]:  # fmt: skip
    """Add to the first n states all to which those from `begin` on lead: `exploration.explore`."""
    if not is_built():
        found = kernels.exploration.explore(
            *channels, *table, n, begin, end, level_end, is_stopped, judged, verdicts, most
        )
        return found[:3], *found[3:]
    wants, does = (filled(SparseRows, *each) for each in channels[:2])
    key_changes = channels[2]
    stopped, sizes = given(is_stopped, np.bool_), np.zeros(MOST_LEVELS, np.int64)
    known, told = _space(judged), filled(StateVerdicts, *verdicts, verdicts[1].shape[1])
    progress = SearchProgress(begin, n, 0, level_end)
    while True:
        outcome = call(
            "explore", wants, does, key_changes, key_changes.size, _space(table), end, stopped, stopped.size, known,
            told, most, sizes, sizes.size, progress,
        )  # fmt: skip
        n, levels = progress.n, progress.n_levels
        if outcome != FULL:
            break
        states, keys, _ = table
        if n == keys.size:
            table = enlarged(table, n, most if states.nbytes > ALL_AT_ONCE else min(2 * n, most))
        else:
            sizes = np.append(sizes, np.zeros_like(sizes))
    return table, n, progress.i, progress.level_end, outcome, sizes[:levels]


def enlarged(table: Table, n: int, room: int) -> Table:
    """A table of the first n states, with room for more."""
    states, keys = (np.empty((room, *array.shape[1:]), dtype=array.dtype) for array in table[:2])
    states[:n], keys[:n] = table[0][:n], table[1][:n]
    return states, keys, tabulate(keys, n, slots_for(room))


def slots_for(n: int) -> int:
    """Size of a table, a power of two, that n states fill to a half at most."""
    return int(2 ** max(4, (2 * n - 1).bit_length()))


def neighbours(begin: int, propensities: Floats, changes: Entries, key_changes: Words, table: Table) -> Ints:
    """Row (n, R) to which each channel leads from the states begin, begin + 1, ...: `exploration.neighbours`."""
    if not is_built():
        return np.asarray(kernels.exploration.neighbours(begin, propensities, changes, key_changes, *table))
    n, n_channels = propensities.shape
    ends = np.empty((n, n_channels), np.int64)
    space = _space(table)
    rates = given(propensities, float)
    call("neighbours", begin, rates, n, n_channels, filled(SparseRows, *changes), key_changes, space, ends)
    return ends


def _space(table: Table) -> Any:
    states, keys, slots = table
    return filled(HashedStates, states, keys, slots, keys.size, slots.size, states.shape[1])
