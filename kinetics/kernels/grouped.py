"""The direct method with a dependency graph: an event updates only what it changed.

Channels are kept in the blocks of `blocks`, each with its sum. Sums are made afresh from their channels, and
propensities from the counts, in the same order as there: the runs are the same to the last bit, and nothing can go
stale, drift, or dip below zero. A step uses one of `waits` (unit exponentials) and one of `uniforms`; see
`streams.draw`.
"""

from typing import NamedTuple

import numpy as np

from kinetics.kernels.blocks import BLOCK, channel_at, factored
from kinetics.kernels.clock import move_on
from kinetics.kernels.compiled import compiled
from kinetics.kernels.outcomes import OVERFLOW, STOPPED, UNFINISHED
from kinetics.kernels.stopping import holds


class GroupedModel(NamedTuple):
    """Channels in blocks.

    What is read together lies together, and in flat arrays, row after row: cache lines and the products that places
    in tables ask for are much of what an event costs.

    coefficients (R,), factors (R, K, 3) int32 : see `sampling.mass_action`
    channels (6 R,) int32 : a, b, less, is_general, start, end. The propensity is the coefficient times x[a] times
        (x[b] - less), or takes the factors where is_general is not 0. Rows start to end of `changes` are its changes
    changes (2 n,) int64 : species, and copies gained
    species (4 S,) int32 : start and end in `readers`, start and end in `touched`
    readers (n,) int32 : channels that read the species
    touched (n,) int32 : blocks with such channels
    """

    coefficients: np.ndarray
    factors: np.ndarray
    channels: np.ndarray
    changes: np.ndarray
    species: np.ndarray
    readers: np.ndarray
    touched: np.ndarray


class GroupedWork(NamedTuple):
    """State of one run between calls.

    propensities (R,), sums (B,), upto (B,) : of channels, of blocks, and running over blocks
    """

    propensities: np.ndarray
    sums: np.ndarray
    upto: np.ndarray


@compiled
def start(model, work, counts):
    """Propensities and sums for a run that begins at `counts` (S + 1,), the last one 1."""
    n_channels = work.propensities.size
    for block in range(work.sums.size):
        part = 0.0
        for r in range(BLOCK * block, min(BLOCK * (block + 1), n_channels)):
            work.propensities[r] = factored(model.coefficients[r], model.factors, r, counts)
            part += work.propensities[r]
        work.sums[block] = part


@compiled
def advance(model, work, counts, seen, clock, waits, uniforms, grid, out, times, fired, stop):
    """Run one trajectory on until it has passed the last time of the grid, or until the draws are used up.

    model, work : see `GroupedModel` and `GroupedWork`; work is changed in place
    counts : (S + 1,), the last one 1; changed in place
    seen : (2,) times of the grid that were passed, events so far in this call; changed in place
    clock : (3,) the time, tu, and what `clock.stands_still` notes; changed in place
    waits, uniforms : (D,) draws
    grid, out : (T,) tu and (T, S), receives the counts
    times, fired : receive the events; (D,), or (0,) if none are asked for
    stop : see `Stop`

    Returns the outcome.
    """
    coefficients, factors, channels, changes = model.coefficients, model.factors, model.channels, model.changes
    species, readers, touched = model.species, model.readers, model.touched
    propensities, sums, upto = work.propensities, work.sums, work.upto
    n_blocks, n_channels = sums.size, propensities.size
    affects_stop, table = stop.affects_stop, stop.table
    t = clock[0]
    passed, n_events = seen[0], 0
    outcome = UNFINISHED
    is_over, chosen = False, 0
    for draw in range(waits.size):
        # Steps 2 and 3 of the direct method, from the sums of blocks: see `direct.advance`.
        total = 0.0
        for i in range(np.uint64(n_blocks)):
            total += sums[i]
            upto[i] = total
        t, passed, outcome = move_on(t, waits[draw], total, clock, counts, grid, passed, out)
        if outcome != UNFINISHED:
            break
        chosen = channel_at(propensities, sums, upto, uniforms[draw] * total, total)

        # Step 4: fire; a count beyond 63 bits wraps to a negative one.
        first, last = channels[6 * chosen + 4], channels[6 * chosen + 5]
        for k in range(first, last):
            s = changes[2 * k]
            counts[s] += changes[2 * k + 1]
            is_over |= counts[s] < 0
        if is_over:
            outcome = OVERFLOW
            break
        # Step 1 for the next event: renew only the channels that read a changed count, then the sums of their blocks.
        for k in range(first, last):
            s = changes[2 * k]
            for i in range(species[4 * s], species[4 * s + 1]):
                reader = np.int64(readers[i])
                propensity = coefficients[reader]
                if channels[6 * reader + 3] == 0:
                    propensity *= counts[np.uint64(channels[6 * reader])]
                    propensity *= counts[np.uint64(channels[6 * reader + 1])] - channels[6 * reader + 2]
                else:
                    propensity = factored(propensity, factors, reader, counts)
                propensities[reader] = propensity
            for i in range(species[4 * s + 2], species[4 * s + 3]):
                block = np.int64(touched[i])
                part = 0.0
                for r in range(np.uint64(BLOCK * block), np.uint64(min(BLOCK * (block + 1), n_channels))):
                    part += propensities[r]
                sums[block] = part
        if times.size > 0:
            times[n_events] = t
            fired[n_events] = chosen
        n_events += 1
        if affects_stop[chosen] and holds(stop, table, counts):
            outcome = STOPPED
            break
    if is_over:  # the event has not been
        for k in range(channels[6 * chosen + 4], channels[6 * chosen + 5]):
            counts[changes[2 * k]] -= changes[2 * k + 1]
    seen[0], seen[1] = passed, n_events
    clock[0] = t
    return outcome
