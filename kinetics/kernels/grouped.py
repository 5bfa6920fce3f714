"""The direct method with a dependency graph: an event updates only what it changed.

Channels are kept in the blocks of `kernels.ssa`, each with its sum. Sums are made afresh from their channels, and
propensities from the counts, in the same order as there: the runs are the same to the last bit, and nothing can go
stale, drift, or dip below zero. A step uses one of `waits` (unit exponentials) and one of `uniforms`; see
`kernels.ssa.draw`.
"""

from typing import NamedTuple

import numpy as np
from numba import njit

# Outcomes of a run, as in `kernels.ssa`
REACHED_END = 0
DRAWS_USED = 1  # resume with fresh waits and uniforms
STALLED_CLOCK = 2
OVERFLOW = 3

BLOCK = 8  # as in `kernels.ssa`


class Model(NamedTuple):
    """Channels in blocks.

    What is read together lies together, and in flat arrays, row after row: cache lines and the products that places
    in tables ask for are much of what an event costs.

    coefficients (R,), factors (R, K, 3) int32 : see `methods.mass_action`
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


class Work(NamedTuple):
    """What one run keeps between calls.

    propensities (R,), sums (B,), upto (B,) : of channels, of blocks, and running over blocks
    """

    propensities: np.ndarray
    sums: np.ndarray
    upto: np.ndarray


@njit(cache=True, nogil=True, error_model="numpy")
def start(model, work, counts):
    """Propensities and sums for a run that begins at `counts` (S + 1,), the last one 1."""
    n_channels = work.propensities.size
    for block in range(work.sums.size):
        part = 0.0
        for r in range(BLOCK * block, min(BLOCK * (block + 1), n_channels)):
            work.propensities[r] = general(model.coefficients[r], model.factors, r, counts)
            part += work.propensities[r]
        work.sums[block] = part


@njit(cache=True, nogil=True, error_model="numpy")
def general(coefficient, factors, r, counts):
    """Propensity of a channel of any order. Slow: kept out of the common path."""
    propensity = coefficient
    for j in range(factors.shape[1]):
        copies = counts[factors[r, j, 0]]
        propensity *= (copies - factors[r, j, 1]) if copies >= factors[r, j, 2] else 0
    return propensity


@njit(cache=True, nogil=True, error_model="numpy")
def advance(model, work, counts, seen, clock, waits, uniforms, grid, out, times, fired):
    """Run one trajectory on until it has passed the last time of the grid, or until the draws are used up.

    model, work : see `Model` and `Work`; work is changed in place
    counts : (S + 1,), the last one 1; changed in place
    seen : (2,) times of the grid that were passed, events so far in this call; changed in place
    clock : (1,) tu; changed in place
    waits, uniforms : (D,) draws
    grid, out : (T,) tu and (T, S), receives the counts
    times, fired : receive the events; (D,), or (0,) where nobody asks for them

    Returns the outcome.
    """
    coefficients, factors, channels, changes = model.coefficients, model.factors, model.channels, model.changes
    species, readers, touched = model.species, model.readers, model.touched
    propensities, sums, upto = work.propensities, work.sums, work.upto
    n_blocks, n_channels, n_species, n_times = sums.size, propensities.size, out.shape[1], grid.size
    t = clock[0]
    passed, n_events = seen[0], 0
    outcome = DRAWS_USED
    for draw in range(waits.size):
        total = 0.0
        for i in range(np.uint64(n_blocks)):
            total += sums[i]
            upto[i] = total
        if not total < np.inf:
            outcome = OVERFLOW
            break
        later = t + waits[draw] / total if total > 0.0 else np.inf
        if later == t:
            outcome = STALLED_CLOCK
            break
        while passed < n_times and grid[passed] < later:
            for s in range(n_species):
                out[passed, s] = counts[s]
            passed += 1
        if passed == n_times:
            outcome = REACHED_END
            break
        t = later

        target = uniforms[draw] * total
        block = np.int64(0)
        while upto[block] <= target and upto[block] < total:
            block += 1
        if block > 0:
            target -= upto[block - 1]
        chosen = BLOCK * block
        part = propensities[chosen]
        while part <= target and part < sums[block]:
            chosen += 1
            part += propensities[chosen]

        is_over = False
        first, last = channels[6 * chosen + 4], channels[6 * chosen + 5]
        for k in range(first, last):
            s = changes[2 * k]
            counts[s] += changes[2 * k + 1]
            is_over |= counts[s] < 0
        if is_over:
            outcome = OVERFLOW
            break
        for k in range(first, last):
            s = changes[2 * k]
            for i in range(species[4 * s], species[4 * s + 1]):
                reader = np.int64(readers[i])
                propensity = coefficients[reader]
                if channels[6 * reader + 3] == 0:
                    propensity *= counts[np.uint64(channels[6 * reader])]
                    propensity *= counts[np.uint64(channels[6 * reader + 1])] - channels[6 * reader + 2]
                else:
                    propensity = general(propensity, factors, reader, counts)
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
    seen[0], seen[1] = passed, n_events
    clock[0] = t
    return outcome
