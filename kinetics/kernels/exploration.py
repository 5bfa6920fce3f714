"""States in a hash table: the discovery of new ones, and the state that each channel leads to.

A state's key is the product of its counts with random odd numbers, wrapping at 2**64; a channel adds a constant to it.
Equal keys are never trusted: the counts themselves are compared.
"""

import numpy as np

from kinetics.kernels.compiled import compiled
from kinetics.kernels.outcomes import OVERFLOW

# Outcomes of an exploration, beside OVERFLOW
COMPLETE = 0
TOO_MANY = 1
UNJUDGED = 2

EMPTY = -1
OUTSIDE = -2
ALL_AT_ONCE = 2**25  # bytes; as in `native.state_tables`
MIX = np.uint64(0x9E3779B97F4A7C15)


@compiled
def first_slot(key, size):
    """The slot at which the search for a key begins, in a hash table of a power of two slots."""
    mixed = (key ^ (key >> np.uint64(29))) * MIX
    return np.int64((mixed ^ (mixed >> np.uint64(32))) & np.uint64(size - 1))


@compiled
def tabulate(keys, n, size):
    """Table of `size` slots that hold the rows of the first n keys."""
    table = np.full(size, EMPTY, dtype=np.int64)
    for i in range(n):
        slot = first_slot(keys[i], size)
        while table[slot] != EMPTY:
            slot = (slot + 1) & (size - 1)
        table[slot] = i
    return table


@compiled
def find(asked, asked_keys, states, keys, table):
    """Rows (n,) of the states `asked` (n, S); -1 if there is none."""
    rows = np.full(asked.shape[0], -1, dtype=np.int64)
    for i in range(asked.shape[0]):
        slot = first_slot(asked_keys[i], table.size)
        while table[slot] != EMPTY:
            row = table[slot]
            if keys[row] == asked_keys[i]:
                same = True
                for s in range(states.shape[1]):
                    same &= states[row, s] == asked[i, s]
                if same:
                    rows[i] = row
                    break
            slot = (slot + 1) & (table.size - 1)
    return rows


@compiled
def insert(new, new_keys, states, keys, table, n, rows):
    """Add to the first n states those of `new` (m, S) that are not among them; `rows` (m,) receives where each is.

    There must be room for all of them. Returns how many states there are then.
    """
    for i in range(new.shape[0]):
        slot = first_slot(new_keys[i], table.size)
        rows[i] = EMPTY
        while table[slot] != EMPTY and rows[i] == EMPTY:
            row = table[slot]
            if keys[row] == new_keys[i]:
                same = True
                for s in range(states.shape[1]):
                    same &= states[row, s] == new[i, s]
                if same:
                    rows[i] = row
            slot = (slot + 1) & (table.size - 1)
        if rows[i] == EMPTY:
            states[n] = new[i]
            keys[n] = new_keys[i]
            table[slot] = n
            rows[i] = n
            n += 1
    return n


@compiled(inline="always")
def leads_to(states, i, row, first, last, species, copies):
    """Whether state i becomes state `row` by the changes `first` to `last`, whose species rise in number."""
    same = True
    e = first
    for s in range(states.shape[1]):
        count = states[i, s]
        if e < last and species[e] == s:
            count += copies[e]
            e += 1
        same &= states[row, s] == count
    return same


@compiled
def explore(
    needed, changes, key_changes, states, keys, table, n, begin, end, level_end, is_stopped, judged, verdicts, most
):
    """Add to the first n states all to which those from `begin` on, but before `end`, lead.

    needed, changes : starts, species and copies of the reactants and the stoichiometry of the channels that work
    key_changes : (R,) uint64, what a channel adds to the key
    states, keys, table : room for states; if it does not suffice, larger copies come back
    level_end : row at which a level ends, all states that one event more leads to
    is_stopped : states that lead nowhere, of the first ones
    judged : states, keys and table of those of which `verdicts` are known; without any, all channels obey mass action
    verdicts : stops (n,), where the chain stops; works (n, L), which laws are above 0; law_of (R,), of a channel, or -1
    most : more states than that end the search

    Returns states, keys, table, their number, the first row that is not done, the end of its level, the outcome, and
    the sizes (L,) of the levels that began. UNJUDGED: nothing is known of that row; go on with larger tables.
    """
    need_starts, need_species, need_copies = needed
    starts, species, copies = changes
    known_states, known_keys, known_table = judged
    stops, works, law_of = verdicts
    n_species = states.shape[1]
    sizes = np.zeros(64, dtype=np.int64)
    n_levels = 0
    i = begin
    place = np.zeros(1, dtype=np.int64)
    while i < min(n, end):
        if i == level_end:
            if n_levels == sizes.size:
                sizes = np.append(sizes, np.zeros_like(sizes))
            sizes[n_levels] = n - level_end
            n_levels += 1
            level_end = n
        if i < is_stopped.size and is_stopped[i]:
            i += 1
            continue
        if known_table.size:
            place = find(states[i : i + 1], keys[i : i + 1], known_states, known_keys, known_table)
            if place[0] == EMPTY:
                return states, keys, table, n, i, level_end, UNJUDGED, sizes[:n_levels]
            if stops[place[0]]:
                i += 1
                continue
        for r in range(key_changes.size):
            able = True
            if known_table.size and law_of[r] >= 0:
                able = works[place[0], law_of[r]]
            else:
                for e in range(need_starts[r], need_starts[r + 1]):
                    able &= states[i, need_species[e]] >= need_copies[e]
            if not able:
                continue
            key = keys[i] + key_changes[r]
            slot = first_slot(key, table.size)
            known = False
            while table[slot] != EMPTY and not known:
                row = table[slot]
                known = keys[row] == key and leads_to(states, i, row, starts[r], starts[r + 1], species, copies)
                slot = (slot + 1) & (table.size - 1)
            if known:
                continue
            if n >= most:
                return states, keys, table, n, i, level_end, TOO_MANY, sizes[:n_levels]
            if n == keys.size:
                room = most if states.nbytes > ALL_AT_ONCE else min(2 * n, most)
                larger = np.empty((room, n_species), dtype=np.int64)
                larger[:n] = states
                states = larger
                more = np.empty(room, dtype=np.uint64)
                more[:n] = keys
                keys = more
                n_slots = 16
                while n_slots < 2 * room:
                    n_slots *= 2
                table = tabulate(keys, n, n_slots)
            for s in range(n_species):
                states[n, s] = states[i, s]
            for e in range(starts[r], starts[r + 1]):
                states[n, species[e]] += copies[e]
                if states[n, species[e]] < 0:
                    return states, keys, table, n, i, level_end, OVERFLOW, sizes[:n_levels]
            keys[n] = key
            slot = first_slot(key, table.size)
            while table[slot] != EMPTY:
                slot = (slot + 1) & (table.size - 1)
            table[slot] = n
            n += 1
        i += 1
    return states, keys, table, n, i, level_end, COMPLETE, sizes[:n_levels]


@compiled
def neighbours(begin, propensities, changes, key_changes, states, keys, table):
    """Row (n, R) to which each channel leads from the states begin, begin + 1, ...

    changes : starts, species and copies of the stoichiometry
    propensities : (n, R); -1 is given where one is 0, OUTSIDE where the channel leads out of the table
    """
    starts, species, copies = changes
    n, n_channels = propensities.shape
    columns = np.full((n, n_channels), -1, dtype=np.int64)
    for i in range(n):
        for r in range(n_channels):
            if propensities[i, r] == 0.0:
                continue
            columns[i, r] = OUTSIDE
            key = keys[begin + i] + key_changes[r]
            slot = first_slot(key, table.size)
            while table[slot] != EMPTY:
                row = table[slot]
                if keys[row] == key and leads_to(states, begin + i, row, starts[r], starts[r + 1], species, copies):
                    columns[i, r] = row
                    break
                slot = (slot + 1) & (table.size - 1)
    return columns


@compiled
def reach(begins, ends, queue, n_queued, is_found):
    """Mark all states (N,) to which some way leads from the first `n_queued` of `queue` (N,), marked before.

    ends (K,) : of the moves out of state i, from begins[i] to begins[i + 1]
    """
    while n_queued > 0:
        n_queued -= 1
        i = queue[n_queued]
        for k in range(begins[i], begins[i + 1]):
            if not is_found[ends[k]]:
                is_found[ends[k]] = True
                queue[n_queued] = ends[k]
                n_queued += 1
