"""Gillespie's direct method under mass action, with every propensity recomputed at every event.

Gillespie (1977), doi:10.1021/j100540a008: a wait by eq. 21a, a channel by eq. 21b. A channel's
propensity is its coefficient times a product of factors, see `sampling.mass_action`. So s(s-1)/2 is the coefficient
k/2 with factors s and s - 1, and no channel can fire below its reactants. Channels that change the same are merged, see
`sampling.merging`.
"""

import numpy as np

from kinetics.kernels.blocks import BLOCK, block_at, factored
from kinetics.kernels.clock import next_time, record
from kinetics.kernels.compiled import compiled
from kinetics.kernels.ensemble_work import BEFORE, EVENTS, LOOK, PASSED, RUN
from kinetics.kernels.outcomes import OVERFLOW, REACHED_END, STOPPED, UNFINISHED
from kinetics.kernels.stopping import holds
from kinetics.kernels.streams import exponential, next_word, start_stream, uniform
from kinetics.kernels.thinning import candidates, kept_channel

BUFFER = 1024  # events that are kept before they are written to the grid


@compiled
def advance(model, changes, counts, clock, end, stream, times, fired, stop):
    """Run one trajectory on until `end`, or until the buffers of events are full.

    model : see `sampling.merging.MergedChannels`
    changes : (G, S) int64, of the counts by each of the model's channels
    counts : (S + 1,) int64, the last one 1; changed in place
    clock : (3,) the time, tu, and what `clock.stands_still` notes; changed in place
    stream : (4,) uint64, state of the random stream; changed in place
    times, fired : (B,) buffers that receive the events, by the model's channels; G for a candidate that is not kept
    stop : see `Stop`; None if nothing ends the run before

    Returns the outcome and the number of events written.
    """
    coefficients, first, second, less = model.coefficients, model.first, model.second, model.less
    terms = model.terms
    n_channels, n_species = changes.shape
    n_blocks = (n_channels + BLOCK - 1) // BLOCK
    has_sums = len(terms) > 0
    in_crowd = model.thinning is not None  # known when this is compiled
    ratio, crowded = candidates(model.thinning)
    has_general = np.any(model.is_general)
    copies = np.empty(n_species + 1 + len(terms))  # so that each count is converted once, not once a channel
    for s in range(n_species + 1):
        copies[s] = counts[s]
    propensities = np.zeros(n_blocks * BLOCK)
    within = np.empty(n_blocks * BLOCK)  # sums of propensities from the start of the block
    upto = np.empty(n_blocks)  # sums over whole blocks
    s0, s1, s2, s3 = stream[0], stream[1], stream[2], stream[3]
    if stop is not None:
        affects_stop, table = stop.affects_stop, stop.table
    t = clock[0]
    n_events = 0
    outcome = UNFINISHED
    while n_events < times.size:
        # Sums over partners that merged channels share; their channels read them like counts.
        if has_sums:
            part = 0.0
            for k in range(np.uint64(len(terms))):
                part += terms[k, 0] * (copies[np.uint64(terms[k, 1])] - terms[k, 2])
                if terms[k, 3] > 0.0:
                    copies[np.uint64(terms[k, 3])] = part
                    part = 0.0
        # Step 1: all propensities a_r, and their running sums by blocks.
        for r in range(np.uint64(n_channels)):  # unsigned indices need no check for negative ones
            pair = coefficients[r] * copies[np.uint64(first[r])]
            propensities[r] = pair * (copies[np.uint64(second[r])] - less[r])
        if has_general:
            for r in range(n_channels):
                if model.is_general[r]:
                    propensities[r] = factored(coefficients[r], model.factors, r, counts)
        total = 0.0
        for block in range(np.uint64(n_blocks)):
            part = 0.0
            for r in range(BLOCK * block, BLOCK * (block + 1)):
                part += propensities[r]
                within[r] = part
            total += part
            upto[block] = total
        surely = total
        if in_crowd:
            before = 0.0
            if crowded > 0:
                before = within[crowded - 1] + (upto[(crowded - 1) // BLOCK - 1] if crowded > BLOCK else 0.0)
            total += ratio * (total - before)
        # Step 2: the wait, an exponential of rate a_0 = sum of a_r (eq. 21a).
        word, s0, s1, s2, s3 = next_word(s0, s1, s2, s3)
        later, outcome = next_time(t, exponential(word), total, clock)
        if outcome != UNFINISHED:
            break
        if later > end:
            t = end
            outcome = REACHED_END
            break
        t = later

        # Step 3: the channel, the first whose running sum exceeds u a_0 (eq. 21b). If rounding makes the target too
        # large, the second comparison stops at the last positive propensity: none without reactants fires.
        word, s0, s1, s2, s3 = next_word(s0, s1, s2, s3)
        aim = uniform(word) * total
        if in_crowd and aim >= surely and surely < total:
            chosen = kept_channel(model.thinning, first, within, copies, aim - surely, n_channels)
        else:
            block, target = block_at(upto, aim, total)
            chosen = BLOCK * block
            part = within[chosen + BLOCK - 1]
            while within[chosen] <= target and within[chosen] < part:
                chosen += 1
        # Step 4: fire. A count beyond 63 bits wraps to a negative one; the event is then undone. A candidate that is
        # not kept has the channel G, which changes nothing.
        overflowed = False
        if not in_crowd or chosen < n_channels:
            for s in range(n_species):
                counts[s] += changes[chosen, s]
                overflowed |= counts[s] < 0
                copies[s] = counts[s]
        if overflowed:
            for s in range(n_species):
                counts[s] -= changes[chosen, s]
            outcome = OVERFLOW
            break
        times[n_events] = t
        fired[n_events] = chosen
        n_events += 1
        if stop is not None and affects_stop[chosen] and holds(stop, table, counts):
            outcome = STOPPED
            break
    stream[0], stream[1], stream[2], stream[3] = s0, s1, s2, s3
    clock[0] = t
    return outcome, n_events


@compiled
def ensemble(model, changes, work, initial, grid, key, first_run, limits, out, most, stop, reached):
    """Counts of many runs on a grid of times: go on with them until about `most` events were made.

    model, changes : see `advance`
    work : see `EnsembleWork`; changed in place
    initial : (S,) int64
    grid : (T,) tu, rising
    key : (4,) uint64
    first_run : number of the first run; the others follow
    limits : (4,) int64, the times of the grid that are needed of runs before a place in the ensemble, and of the
        others; that place; and the number of events at which a run is first looked at
    out : (runs, T, S) int64, receives the counts
    stop, reached : see `Stop`, and (runs,), which receives the times at which runs end by it, tu; from there on their
        counts stay as they are

    Returns the outcome: REACHED_END where all runs have, UNFINISHED where the events are made or the run at hand is to
    be looked at, or that which stopped the run at hand.
    """
    counts, clock, stream, notes = work.counts, work.clock, work.stream, work.notes
    n_species, in_crowd = initial.size, model.thinning is not None
    times = np.empty(BUFFER)
    fired = np.empty(BUFFER, dtype=np.int64)
    state = np.empty(n_species, dtype=np.int64)
    while notes[RUN] < out.shape[0]:
        i = notes[RUN]
        if notes[EVENTS] == BEFORE:
            start_stream(key, first_run + i, stream)
            counts[:n_species] = initial
            clock[:] = 0.0
            notes[PASSED], notes[EVENTS], notes[LOOK] = 0, 0, limits[3]
        n_times = limits[0] if i < limits[2] else limits[1]
        outcome, seen = UNFINISHED, notes[PASSED]
        if seen >= n_times:
            outcome = REACHED_END
        state[:] = counts[:n_species]
        while outcome == UNFINISHED:
            room = min(BUFFER, most, notes[LOOK] - notes[EVENTS])
            if room <= 0:
                return UNFINISHED
            end = grid[n_times - 1]
            outcome, n_events = advance(model, changes, counts, clock, end, stream, times[:room], fired[:room], stop)
            for event in range(n_events):
                seen = record(state, times[event], grid, seen, out[i])
                if not in_crowd or fired[event] < len(changes):
                    for s in range(n_species):
                        state[s] += changes[fired[event], s]
            notes[PASSED] = seen
            notes[EVENTS] += n_events
            most -= n_events
        if outcome == STOPPED:
            reached[i] = clock[0]
            outcome = REACHED_END
        if outcome != REACHED_END:
            return outcome
        for j in range(seen, n_times):
            out[i, j] = state
        most -= 1
        notes[RUN], notes[EVENTS] = i + 1, BEFORE
    return REACHED_END
