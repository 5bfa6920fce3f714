"""Gillespie's direct method (1977) over general mass action: one run at a time, or many in lockstep.

A channel's propensity is its coefficient times a product of factors, see `methods.mass_action`. So s(s-1)/2 is the
coefficient k/2 with factors s and s - 1, and no channel can fire below its reactants.

Random numbers: xoshiro256++ (Blackman & Vigna 2021), 53 bits a double, one word for the wait and one for the choice of
each event. The stream of a run is keyed by its number, so it does not matter which thread makes the run, or when.

Propensities are added up in blocks of `BLOCK` channels, and every kernel of the direct method does the same sums in
the same order: their runs agree to the last bit.
"""

import math

import numpy as np
from numba import njit

# Outcomes of a run
REACHED_END = 0  # also where nothing can happen any more
BUFFER_FULL = 1  # resume with the same arguments
STALLED_CLOCK = 2  # waits are so short that t + wait == t
OVERFLOW = 3  # a count beyond int64, or a propensity beyond double

BLOCK = 8
LANES = 64  # runs side by side in lockstep
GATHERED = 8  # up to so many species, all are updated whichever channel fired: quicker than its own few
LARGEST_EXACT = 2.0**52  # lanes count in doubles, which are exact up to 2**53
LN2 = math.log(2.0)
HALF_ROOT = 0x3FE6A09E667F3BCD  # the bits of the double sqrt(1/2)
GOLDEN = np.uint64(0x9E3779B97F4A7C15)


@njit(cache=True, nogil=True, error_model="numpy")
def start_stream(key, run, stream):
    """Fill the four words of `stream` for this run: SplitMix64's mixing of each key word with the run's number."""
    for i in range(4):
        z = key[i] + np.uint64(run + 1) * GOLDEN
        z = (z ^ (z >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
        z = (z ^ (z >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
        stream[i] = z ^ (z >> np.uint64(31))


@njit(cache=True, nogil=True, error_model="numpy")
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


@njit(cache=True, nogil=True, error_model="numpy")
def exponential(word):
    """Unit exponential variate -log(1 - u) from 64 random bits; never 0. Within 4 units in the last place.

    Plain arithmetic, so that it gives the same bits alone and in vector lanes: 1 - u = m 2**k with m next to 1, and
    log m = 2 artanh(s), s = (m - 1)/(m + 1), |s| < 0.172, by eleven terms of its series.
    """
    bits = max(np.int64(word >> np.uint64(11)), np.int64(1))
    shifted = np.float64(1.0 - float(bits) * 2.0**-53).view(np.int64) + np.int64(0x3FF0000000000000 - HALF_ROOT)
    k = (shifted >> np.int64(52)) - np.int64(1023)
    m = np.int64((shifted & np.int64(0x000FFFFFFFFFFFFF)) + np.int64(HALF_ROOT)).view(np.float64)
    s = (m - 1.0) / (m + 1.0)
    z = s * s
    z2 = z * z
    z4 = z2 * z2
    low = (1.0 + z * (1 / 3)) + z2 * ((1 / 5) + z * (1 / 7))
    middle = ((1 / 9) + z * (1 / 11)) + z2 * ((1 / 13) + z * (1 / 15))
    high = ((1 / 17) + z * (1 / 19)) + z2 * (1 / 21)
    return -(float(k) * LN2 + 2.0 * s * (low + z4 * (middle + z4 * high)))


@njit(cache=True, nogil=True, error_model="numpy")
def draw(stream, waits, uniforms):
    """Fill `waits` with unit exponentials and `uniforms` with numbers in [0, 1), as `advance` would draw them."""
    s0, s1, s2, s3 = stream[0], stream[1], stream[2], stream[3]
    words = waits.view(np.uint64)
    for i in range(waits.size):
        words[i], s0, s1, s2, s3 = next_word(s0, s1, s2, s3)
        second, s0, s1, s2, s3 = next_word(s0, s1, s2, s3)
        uniforms[i] = float(second >> np.uint64(11)) * 2.0**-53
    for i in range(waits.size):  # a loop of its own, for it runs in vector lanes, and the words cannot
        waits[i] = exponential(words[i])
    stream[0], stream[1], stream[2], stream[3] = s0, s1, s2, s3


@njit(cache=True, nogil=True, error_model="numpy")
def general_propensity(coefficient, factors, r, counts):
    """Propensity of channel r by its factors."""
    propensity = coefficient
    for j in range(factors.shape[1]):
        copies = counts[factors[r, j, 0]]
        propensity *= (copies - factors[r, j, 1]) if copies >= factors[r, j, 2] else 0
    return propensity


@njit(cache=True, nogil=True, error_model="numpy")
def advance(model, stoichiometry, counts, clock, end, stream, times, channels):
    """Run one trajectory on until `end`, or until the buffers of events are full.

    model : see `methods.mass_action.MassAction`
    stoichiometry : (R, S) int64
    counts : (S + 1,) int64, the last one 1; changed in place
    clock : (1,) tu; changed in place
    stream : (4,) uint64, state of the random stream; changed in place
    times, channels : (B,) buffers that receive the events

    Returns the outcome and the number of events written.
    """
    coefficients, first, second, less = model.coefficients, model.first, model.second, model.less
    n_channels, n_species = stoichiometry.shape
    n_blocks = (n_channels + BLOCK - 1) // BLOCK
    has_general = np.any(model.is_general)
    copies = counts.astype(np.float64)  # so that each count is converted once, not once a channel
    propensities = np.zeros(n_blocks * BLOCK)
    within = np.empty(n_blocks * BLOCK)  # sums of propensities from the start of the block
    upto = np.empty(n_blocks)  # sums over whole blocks
    s0, s1, s2, s3 = stream[0], stream[1], stream[2], stream[3]
    t = clock[0]
    n_events = 0
    outcome = BUFFER_FULL
    while n_events < times.size:
        for r in range(np.uint64(n_channels)):  # unsigned indices need no check for negative ones
            pair = coefficients[r] * copies[np.uint64(first[r])]
            propensities[r] = pair * (copies[np.uint64(second[r])] - less[r])
        if has_general:
            for r in range(n_channels):
                if model.is_general[r]:
                    propensities[r] = general_propensity(coefficients[r], model.factors, r, counts)
        total = 0.0
        for block in range(np.uint64(n_blocks)):
            part = 0.0
            for r in range(BLOCK * block, BLOCK * (block + 1)):
                part += propensities[r]
                within[r] = part
            total += part
            upto[block] = total
        if total == 0.0:
            t = end
            outcome = REACHED_END
            break
        if not total < np.inf:
            outcome = OVERFLOW
            break

        word, s0, s1, s2, s3 = next_word(s0, s1, s2, s3)
        wait = exponential(word) / total
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
        block = 0
        while upto[block] <= target and upto[block] < total:
            block += 1
        if block > 0:
            target -= upto[block - 1]
        chosen = BLOCK * block
        part = within[chosen + BLOCK - 1]
        while within[chosen] <= target and within[chosen] < part:
            chosen += 1
        overflowed = False
        for s in range(n_species):
            counts[s] += stoichiometry[chosen, s]
            overflowed |= counts[s] < 0
            copies[s] = counts[s]
        if overflowed:
            outcome = OVERFLOW
            break
        times[n_events] = t
        channels[n_events] = chosen
        n_events += 1
    stream[0], stream[1], stream[2], stream[3] = s0, s1, s2, s3
    clock[0] = t
    return outcome, n_events


@njit(cache=True, nogil=True, error_model="numpy")
def ensemble(model, stoichiometry, initial, grid, key, first_run, out):
    """Counts of many runs on a grid of times.

    model, stoichiometry : see `advance`
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
            outcome, n_events = advance(model, stoichiometry, counts, clock, grid[-1], stream, times, channels)
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


@njit(cache=True, nogil=True, error_model="numpy")
def begin_lane(lane, i, initial, grid, key, first_run, counts, t, upcoming, words, run, seen, stream):
    """Put the i-th run of the ensemble into a lane of `lockstep`."""
    start_stream(key, first_run + i, stream)
    words[:, lane] = stream
    counts[: initial.size, lane] = initial
    t[lane], upcoming[lane] = 0.0, grid[0]
    run[lane], seen[lane] = i, 0


@njit(cache=True, nogil=True, error_model="numpy")
def general_propensities(coefficient, factors, r, counts, propensities, active):
    """`general_propensity` in the lanes of `lockstep`."""
    propensities[:active] = coefficient
    for j in range(factors.shape[1]):
        for lane in range(active):
            copies = counts[factors[r, j, 0], lane]
            propensities[lane] *= (copies - factors[r, j, 1]) if copies >= factors[r, j, 2] else 0.0


@njit(cache=True, nogil=True, error_model="numpy")
def lockstep(model, stoichiometry, initial, grid, key, first_run, out):
    """`ensemble`, with `LANES` runs side by side: each does the arithmetic of `advance`, in a lane of vectors.

    Arguments and result as of `ensemble`. A lane that ends its run takes up the next one. Runs that come to counts
    which a double cannot hold, or to a clock that stands still, are made again by `ensemble`.
    """
    n_channels, n_species = stoichiometry.shape
    n_blocks = (n_channels + BLOCK - 1) // BLOCK
    runs, n_times, _ = out.shape
    flat = out.ravel()  # no copy
    state = np.empty(n_species, dtype=np.int64)
    counts = np.ones((n_species + 1, LANES))
    within, upto = np.empty((n_channels, LANES)), np.empty((n_blocks, LANES))
    total, part, target = np.empty(LANES), np.empty(LANES), np.empty(LANES)
    t, upcoming = np.empty(LANES), np.empty(LANES)
    words = np.empty((4, LANES), dtype=np.uint64)
    run, seen = np.empty(LANES, dtype=np.int64), np.empty(LANES, dtype=np.int64)
    chosen = np.empty(LANES, dtype=np.int64)
    is_odd = np.zeros(runs, dtype=np.bool_)
    stream = np.empty(4, dtype=np.uint64)
    # Channel n_channels changes nothing: what a lane does that has just ended its run.
    change = np.zeros((n_species, n_channels + 1))
    change[:, :n_channels] = stoichiometry.T
    starts, species_of = np.zeros(n_channels + 2, dtype=np.int64), np.nonzero(stoichiometry)[1]
    for r in range(n_channels):
        starts[r + 1] = starts[r] + np.count_nonzero(stoichiometry[r])
    starts[n_channels + 1] = starts[n_channels]
    active = min(LANES, runs)
    begun = 0
    for lane in range(active):
        begin_lane(lane, begun, initial, grid, key, first_run, counts, t, upcoming, words, run, seen, stream)
        begun += 1
    steps = 0
    while active > 0:
        lanes = np.uint64(active)  # unsigned: indices need no check for negative ones
        for lane in range(lanes):
            total[lane] = 0.0
        for block in range(n_blocks):
            for lane in range(lanes):
                part[lane] = 0.0
            for r in range(BLOCK * block, min(BLOCK * (block + 1), n_channels)):
                coefficient, less = model.coefficients[r], model.less[r]
                first, second = np.uint64(model.first[r]), np.uint64(model.second[r])
                if model.is_general[r]:
                    general_propensities(coefficient, model.factors, r, counts, target, active)
                else:
                    for lane in range(lanes):
                        target[lane] = coefficient * counts[first, lane] * (counts[second, lane] - less)
                for lane in range(lanes):
                    part[lane] += target[lane]
                    within[np.uint64(r), lane] = part[lane]
            for lane in range(lanes):
                total[lane] += part[lane]
                upto[np.uint64(block), lane] = total[lane]

        n_crossed = 0
        for lane in range(lanes):
            s0, s1, s2, s3 = words[0, lane], words[1, lane], words[2, lane], words[3, lane]
            first, s0, s1, s2, s3 = next_word(s0, s1, s2, s3)
            second, s0, s1, s2, s3 = next_word(s0, s1, s2, s3)
            words[0, lane], words[1, lane], words[2, lane], words[3, lane] = s0, s1, s2, s3
            target[lane] = float(second >> np.uint64(11)) * 2.0**-53 * total[lane]
            later = t[lane] + exponential(first) / total[lane]
            later = later if later > t[lane] else np.inf  # a clock that stands still, or a total beyond double
            n_crossed += later > upcoming[lane]
            t[lane] = later

        steps += 1
        if steps % 1024 == 0:  # with changes below 2**40, no count can pass 2**53 in between
            for s in range(n_species):
                for lane in range(lanes):
                    if counts[s, lane] > LARGEST_EXACT:
                        t[lane], total[lane] = np.inf, np.inf
                        n_crossed += 1
        n_ended = 0
        if n_crossed > 0:
            for lane in range(lanes):
                if not t[lane] > upcoming[lane]:
                    continue
                for s in range(n_species):
                    state[s] = np.int64(counts[s, lane])
                k = seen[lane]
                place = np.uint64((run[lane] * n_times + k) * n_species)
                while k < n_times and grid[k] < t[lane]:
                    for s in range(n_species):
                        flat[place] = state[s]
                        place += np.uint64(1)
                    k += 1
                seen[lane] = k
                if k < n_times:
                    upcoming[lane] = grid[k]
                    continue
                is_odd[run[lane]] = t[lane] == np.inf and total[lane] != 0.0
                target[lane], total[lane] = np.inf, np.inf
                if begun < runs:
                    begin_lane(
                        lane, begun, initial, grid, key, first_run, counts, t, upcoming, words, run, seen, stream
                    )
                    begun += 1
                else:
                    run[lane] = -1
                    n_ended += 1

        for lane in range(lanes):
            chosen[lane] = 0
        if n_blocks == 1:
            for r in range(np.uint64(n_channels)):
                for lane in range(lanes):
                    chosen[lane] += (within[r, lane] <= target[lane]) & (within[r, lane] < total[lane])
        else:
            for block in range(np.uint64(n_blocks)):
                for lane in range(lanes):
                    chosen[lane] += (upto[block, lane] <= target[lane]) & (upto[block, lane] < total[lane])
            for lane in range(lanes):
                block = chosen[lane]
                if block == n_blocks:
                    chosen[lane] = n_channels
                    continue
                aim = target[lane] - (upto[block - 1, lane] if block > 0 else 0.0)
                begin, end = BLOCK * block, min(BLOCK * (block + 1), n_channels)
                chosen[lane] = begin
                for r in range(begin, end):
                    chosen[lane] += (within[r, lane] <= aim) & (within[r, lane] < within[end - 1, lane])
        if n_species <= GATHERED:
            for s in range(np.uint64(n_species)):
                for lane in range(lanes):
                    counts[s, lane] += change[s, np.uint64(chosen[lane])]
        else:
            for lane in range(lanes):
                for k in range(starts[chosen[lane]], starts[chosen[lane] + 1]):
                    counts[species_of[k], lane] += change[species_of[k], chosen[lane]]

        if n_ended > 0:  # close the ranks
            kept = 0
            for lane in range(lanes):
                if run[lane] >= 0:
                    counts[:, kept], words[:, kept] = counts[:, lane], words[:, lane]
                    t[kept], upcoming[kept] = t[lane], upcoming[lane]
                    run[kept], seen[kept] = run[lane], seen[lane]
                    kept += 1
            active = kept

    for i in np.flatnonzero(is_odd):
        outcome, failed = ensemble(model, stoichiometry, initial, grid, key, first_run + i, out[i : i + 1])
        if outcome != REACHED_END:
            return outcome, failed
    return REACHED_END, first_run + runs - 1
