"""States packed into one integer each, in rising order, and steps of their Markov chain without a stored matrix.

A channel adds the same number to every key, so a channel's sources are found by going through the sorted keys twice at
once. A step p <- p P, P = 1 + Q / q (Jensen 1953, doi:10.1080/03461238.1953.10419459), computes every propensity anew
from the counts in the keys.

channels : as `native.library.PackedChannels` has them, without their numbers
"""

import numpy as np

from kinetics.kernels.compiled import compiled

TILE = 128  # rows, as in packed.c


@compiled
def count_of(shifts, masks, key, s):
    """Copies of species s in a key."""
    return (key >> shifts[s]) & masks[s]


@compiled
def rate_of(channels, coefficients, r, key, table, i):
    """The propensity of channel r in row i, which has this key."""
    shifts, masks, starts, species, _, _, _, _, _, laws, less, _ = channels
    rate = coefficients[r]
    if laws[r] >= 0:
        return rate * table[laws[r], i]
    for f in range(starts[r], starts[r + 1]):
        rate *= float(count_of(shifts, masks, key, species[f])) - less[f]
    return rate


@compiled
def is_held(channels, r, key, times, is_needed):
    """Whether the counts, changed `times` times by the channel, are at least what it needs and have room in a key."""
    shifts, masks, _, _, begins, checked, needed, changes, _, _, _, _ = channels
    for c in range(begins[r], begins[r + 1]):
        count = count_of(shifts, masks, key, checked[c]) + times * changes[c]
        if count < (needed[c] if is_needed else 0) or count > masks[checked[c]]:
            return False
    return True


@compiled
def sources(channels, first, last, keys, is_stopped, table, sources, inside):
    """For channels first to before last, the row from which each leads to every state; N where there is none.

    keys : (N,), rising; is_stopped : (N,), states that lead nowhere
    table : (L, N + 1) values of laws
    sources : (R, N) int32, filled; inside : (N, W) uint64, gets the bit of each channel whose end is among these states
    """
    offsets, laws, n = channels[8], channels[9], keys.size
    for r in range(first, last):
        j = 0
        for i in range(n):
            sources[r, i] = n
            if not is_held(channels, r, keys[i], -1, True):
                continue
            key = keys[i] - offsets[r]
            while j < n and keys[j] < key:
                j += 1
            if j < n and keys[j] == key and not is_stopped[j] and (laws[r] < 0 or table[laws[r], j] > 0.0):
                sources[r, i] = j
                inside[j, r // 64] |= np.uint64(1) << np.uint64(r % 64)


@compiled
def exits(channels, coefficients, keys, begin, end, is_stopped, table, exits, able):
    """Of rows begin to before end: the sum (N,) of all propensities, and the bits (N, W) of those above 0."""
    for i in range(begin, end):
        total = 0.0
        if not is_stopped[i]:
            for r in range(coefficients.size):
                rate = rate_of(channels, coefficients, r, keys[i], table, i)
                total += rate
                if rate > 0.0:
                    able[i, r // 64] |= np.uint64(1) << np.uint64(r % 64)
        exits[i] = total


@compiled
def spill(channels, coefficients, start, vector, exits, leads, table, floor, keys, ends, flows):
    """What leads out of the set `keys` from the rows of `start` by channels whose bits in `leads` (n, W) are set.

    Key and flow, at least `floor`, of each end. How many ends there are, of which as many are written as there is room
    for; -1 if a count has no room in a key.
    """
    offsets, found = channels[8], 0
    for i in range(start.size):
        if vector[i] * exits[i] < floor:
            continue
        for r in range(coefficients.size):
            if not (leads[i, r // 64] >> np.uint64(r % 64)) & np.uint64(1):
                continue
            flow = vector[i] * rate_of(channels, coefficients, r, start[i], table, i)
            if not (flow > 0.0 and flow >= floor):
                continue
            if not is_held(channels, r, start[i], 1, False):
                return -1
            key = start[i] + offsets[r]
            low, high = 0, keys.size
            while low < high:
                middle = low + (high - low) // 2
                if keys[middle] < key:
                    low = middle + 1
                else:
                    high = middle
            if low < keys.size and keys[low] == key:
                continue
            if found < ends.size:
                ends[found] = key
                flows[found] = flow
            found += 1
    return found


@compiled
def steps(channels, coefficients, keys, sources, exits, table, begin, end, weights, tails, b, n_steps, vector, other,
          sums, events):  # fmt: skip
    """Steps b to before b + n_steps for rows begin to before end, all rows unless there is one step.

    coefficients, exits : divided by q
    weights : (T, B); before each step sums[t] (T, N) grow by weights[t, b] times the vector
    vector, other : (N + 1,), the last 0 for all states outside; steps in pairs end in `vector`, one alone in `other`
    events : (tiles,) grow by tails[b] times what left its state
    """
    _, _, starts, _, _, _, _, _, _, laws, _, moved = channels
    shifts, masks, species, less = channels[0], channels[1], channels[3], channels[10]
    now, after = vector, other
    for step in range(b, b + n_steps):
        for start in range(begin, end, TILE):
            left = 0.0
            for i in range(start, min(start + TILE, end)):
                inflow = 0.0
                for r in range(coefficients.size):
                    source = sources[r, i]
                    rate = coefficients[r]
                    if laws[r] >= 0:
                        rate *= table[laws[r], source]
                    else:
                        for f in range(starts[r], starts[r + 1]):
                            rate *= float(count_of(shifts, masks, keys[i], species[f])) - (moved[f] + less[f])
                    inflow += rate * now[source]
                # Not negative: a rounded product with exits <= 1 is no larger than the probability itself.
                outflow = exits[i] * now[i]
                left += outflow
                after[i] = now[i] + (inflow - outflow)
            events[start // TILE] += tails[step] * left
            for t in range(len(weights)):
                weight = weights[t, step]
                if weight != 0.0:
                    for i in range(start, min(start + TILE, end)):
                        sums[t, i] += weight * now[i]
        now, after = after, now
    if n_steps > 1 and n_steps % 2 == 1:
        vector[:] = now
