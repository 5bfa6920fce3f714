"""Gillespie's direct method (1977) over general mass action.

A channel's propensity is its coefficient times a product of factors. Factor j of channel r reads the species
`factors[0, r, j]`, subtracts `factors[1, r, j]` copies, and is 0 below `factors[2, r, j]` copies; a species index of S
stands for the constant 1. So s(s-1)/2 is the coefficient k/2 with factors s and s - 1, and no channel can fire below
its reactants.

Random numbers: xoshiro256++ (Blackman & Vigna 2021), 53 bits a double. The stream of a run is keyed by its number, so
it does not matter which thread makes the run, or when.
"""

import numpy as np
from numba import njit

# Outcomes of a run
REACHED_END = 0  # also where nothing can happen any more
BUFFER_FULL = 1  # resume with the same arguments
STALLED_CLOCK = 2  # waits are so short that t + wait == t
OVERFLOW = 3  # a count beyond int64, or a propensity beyond double

GOLDEN = np.uint64(0x9E3779B97F4A7C15)


@njit(cache=True, nogil=True)
def start_stream(key, run, stream):
    """Fill the four words of `stream` for this run: SplitMix64's mixing of each key word with the run's number."""
    for i in range(4):
        z = key[i] + np.uint64(run + 1) * GOLDEN
        z = (z ^ (z >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
        z = (z ^ (z >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
        stream[i] = z ^ (z >> np.uint64(31))


@njit(cache=True, nogil=True)
def next_word(s0, s1, s2, s3):
    """One step of xoshiro256++: 64 random bits, then the new state."""
    mixed = s0 + s3
    word = ((mixed << np.uint64(23)) | (mixed >> np.uint64(41))) + s0
    shifted = s1 << np.uint64(17)
    s2 ^= s0
    s3 ^= s1
    s1 ^= s2
    s0 ^= s3
    s2 ^= shifted
    s3 = (s3 << np.uint64(45)) | (s3 >> np.uint64(19))
    return word, s0, s1, s2, s3


@njit(cache=True, nogil=True)
def advance(coefficients, factors, stoichiometry, counts, clock, end, stream, times, channels):
    """Run one trajectory on until `end`, or until the buffers of events are full.

    coefficients : (R,) 1/tu
    factors : (3, R, K) int64, see above; K at least 2
    stoichiometry : (R, S) int64
    counts : (S + 1,) int64, the last one 1; changed in place
    clock : (1,) tu; changed in place
    stream : (4,) uint64, state of the random stream; changed in place
    times, channels : (B,) buffers that receive the events

    Returns the outcome and the number of events written.
    """
    n_channels, n_species = stoichiometry.shape
    n_factors = factors.shape[2]
    cumulative = np.empty(n_channels)
    s0, s1, s2, s3 = stream[0], stream[1], stream[2], stream[3]
    t = clock[0]
    n_events = 0
    outcome = BUFFER_FULL
    while n_events < times.size:
        total = 0.0
        for r in range(n_channels):
            # Two factors without a loop, and unsigned indices, which need no check for negative ones: a fifth quicker.
            one = counts[np.uint64(factors[0, r, 0])]
            two = counts[np.uint64(factors[0, r, 1])]
            propensity = coefficients[r]
            propensity *= (one - factors[1, r, 0]) if one >= factors[2, r, 0] else 0
            propensity *= (two - factors[1, r, 1]) if two >= factors[2, r, 1] else 0
            for j in range(2, n_factors):
                more = counts[np.uint64(factors[0, r, j])]
                propensity *= (more - factors[1, r, j]) if more >= factors[2, r, j] else 0
            total += propensity
            cumulative[r] = total
        if total == 0.0:
            t = end
            outcome = REACHED_END
            break
        if not total < np.inf:
            outcome = OVERFLOW
            break

        word, s0, s1, s2, s3 = next_word(s0, s1, s2, s3)
        while word >> np.uint64(11) == 0:  # a wait of exactly 0 would look like a stalled clock
            word, s0, s1, s2, s3 = next_word(s0, s1, s2, s3)
        wait = -np.log(1.0 - float(word >> np.uint64(11)) * 2.0**-53) / total
        if t + wait == t:
            outcome = STALLED_CLOCK
            break
        t += wait
        if t > end:
            t = end
            outcome = REACHED_END
            break

        word, s0, s1, s2, s3 = next_word(s0, s1, s2, s3)
        target = float(word >> np.uint64(11)) * 2.0**-53 * total
        chosen = 0
        while cumulative[chosen] <= target and cumulative[chosen] < total:
            chosen += 1
        overflowed = False
        for s in range(n_species):
            counts[s] += stoichiometry[chosen, s]
            overflowed |= counts[s] < 0
        if overflowed:
            outcome = OVERFLOW
            break
        times[n_events] = t
        channels[n_events] = chosen
        n_events += 1
    stream[0], stream[1], stream[2], stream[3] = s0, s1, s2, s3
    clock[0] = t
    return outcome, n_events


@njit(cache=True, nogil=True)
def ensemble(coefficients, factors, stoichiometry, initial, grid, key, first_run, out):
    """Counts of many runs on a grid of times.

    coefficients, factors, stoichiometry : see `advance`
    initial : (S,) int64
    grid : (T,) tu, rising
    key : (4,) uint64
    first_run : number of the first run; the others follow
    out : (runs, T, S) int64, receives the counts

    Returns the outcome and the number of the last run begun: the one that failed where the outcome says so.
    """
    n_species = initial.size
    n_times = grid.size
    counts = np.ones(n_species + 1, dtype=np.int64)
    state = np.empty(n_species, dtype=np.int64)
    clock = np.zeros(1)
    stream = np.empty(4, dtype=np.uint64)
    times = np.empty(1024)
    channels = np.empty(1024, dtype=np.int64)
    for i in range(out.shape[0]):
        start_stream(key, first_run + i, stream)
        counts[:n_species] = initial
        state[:] = initial
        clock[0] = 0.0
        seen = 0
        outcome = BUFFER_FULL
        while outcome == BUFFER_FULL:
            outcome, n_events = advance(
                coefficients, factors, stoichiometry, counts, clock, grid[-1], stream, times, channels
            )
            for event in range(n_events):
                while grid[seen] < times[event]:
                    out[i, seen] = state
                    seen += 1
                for s in range(n_species):
                    state[s] += stoichiometry[channels[event], s]
        if outcome != REACHED_END:
            return outcome, first_run + i
        for j in range(seen, n_times):
            out[i, j] = state
    return REACHED_END, first_run + out.shape[0] - 1
