"""The direct method for many runs side by side: each does the arithmetic of `direct.advance` in a lane of vectors."""

from typing import NamedTuple

import numpy as np

from kinetics.kernels.blocks import BLOCK
from kinetics.kernels.clock import MOST_STILL
from kinetics.kernels.compiled import compiled
from kinetics.kernels.stopping import holds
from kinetics.kernels.streams import exponential, next_word, start_stream, uniform
from kinetics.kernels.thinning import add_candidates, keep_candidates

LANES = 64  # runs side by side
GATHERED = 8  # up to so many species, all are updated whichever channel fired: quicker than its own few
LARGEST_EXACT = 2.0**52  # lanes count in doubles, which are exact up to 2**53
LEAST_TOTAL = 1e-290  # below, a wait may itself be infinite


ACTIVE, RUNS, STEPS = 0, 1, 2  # in `LockstepWork.notes`


class LockstepWork(NamedTuple):
    """State of the runs between calls. The arrays of the lanes are (LANES,) unless stated.

    counts (S + 1 + sums, LANES), within (G, LANES), upto (blocks, LANES) : copies, and running sums of propensities
    change (S, G + 1) : of the counts by each channel; channel G changes nothing: what a lane does that has just ended
        its run. starts (G + 2,), species_of (n,) int64 : the species that each channel changes
    total, part, target : sums of propensities, scratch and, after a step, the times before it; where in the total the
        event falls
    t, upcoming : the clock, and the next time of the grid
    words (4, LANES) uint64 : random streams
    run, seen, needed int64 : the run in the lane by its place in the ensemble, -1 if there is none, the times of the
        grid that it has passed, and those that are needed of it
    begun, looks int64 : steps at which the run began, and at which it is to be looked at
    still, stood int64 : events in a row that did not move the clock, and the step of the last such
    chosen int64 : the channel that fires
    notes (3,) int64 : lanes in use, runs begun, steps made
    """

    counts: np.ndarray
    within: np.ndarray
    upto: np.ndarray
    change: np.ndarray
    starts: np.ndarray
    species_of: np.ndarray
    total: np.ndarray
    part: np.ndarray
    target: np.ndarray
    t: np.ndarray
    upcoming: np.ndarray
    words: np.ndarray
    run: np.ndarray
    seen: np.ndarray
    needed: np.ndarray
    begun: np.ndarray
    looks: np.ndarray
    still: np.ndarray
    stood: np.ndarray
    chosen: np.ndarray
    notes: np.ndarray


@compiled
def begin_lane(lane, work, initial, grid, key, first_run, limits, stream):
    """Put the next run of the ensemble into a lane of `lockstep`."""
    i = work.notes[RUNS]
    work.notes[RUNS] = i + 1
    start_stream(key, first_run + i, stream)
    work.words[:, lane] = stream
    work.counts[: initial.size, lane] = initial
    work.run[lane], work.seen[lane] = i, 0
    work.needed[lane] = limits[0] if i < limits[2] else limits[1]
    work.t[lane], work.upcoming[lane] = 0.0, grid[0] if work.needed[lane] > 0 else -np.inf
    work.begun[lane], work.looks[lane] = work.notes[STEPS], work.notes[STEPS] + limits[3]
    work.still[lane], work.stood[lane] = 0, -1


@compiled
def is_stuck(work, lane, steps):
    """Whether a lane cannot go on: its clock has stalled, or its total or a count are beyond what it holds.

    A lane whose clock stands still comes with an infinite time, and takes that before it.
    """
    total = work.total[lane]
    if work.t[lane] < np.inf or total == 0.0 or work.seen[lane] >= work.needed[lane]:
        return False
    work.t[lane] = work.part[lane]
    work.still[lane] = work.still[lane] + 1 if work.stood[lane] == steps - 1 else 1
    work.stood[lane] = steps
    return not LEAST_TOTAL < total < np.inf or work.still[lane] >= MOST_STILL


@compiled
def factored_lanes(coefficient, factors, r, counts, propensities, active):
    """`blocks.factored` in the lanes of `lockstep`."""
    propensities[:active] = coefficient
    for j in range(factors.shape[1]):
        for lane in range(active):
            copies = counts[factors[r, j, 0], lane]
            propensities[lane] *= (copies - factors[r, j, 1]) if copies >= factors[r, j, 2] else 0.0


@compiled
def lockstep(model, changes, work, initial, grid, key, first_run, limits, out, is_odd, most, stop, reached):
    """`direct.ensemble`, with `LANES` runs side by side: each does the arithmetic of `advance`, in a lane of vectors.

    work : see `LockstepWork`; changed in place
    is_odd : (runs,) bool, set for runs that come to counts which a double cannot hold, to propensities beyond double,
        or to a clock that stands still: they are to be made again, by `direct.ensemble`
    most : events of each lane in this call

    Other arguments as of `direct.ensemble`. A lane that ends its run takes up the next one. All runs are made where no
    lane is in use any more.
    """
    n_channels, n_species = changes.shape
    terms = model.terms
    n_blocks = (n_channels + BLOCK - 1) // BLOCK
    runs, n_times, _ = out.shape
    flat = out.ravel()  # no copy
    state = np.empty(n_species, dtype=np.int64)
    stream = np.empty(4, dtype=np.uint64)
    counts, within, upto, change = work.counts, work.within, work.upto, work.change
    starts, species_of = work.starts, work.species_of
    total, part, target, t, upcoming = work.total, work.part, work.target, work.t, work.upcoming
    words, run, seen, needed, chosen = work.words, work.run, work.seen, work.needed, work.chosen
    active, steps = work.notes[ACTIVE], work.notes[STEPS]
    last = steps + most
    affects_stop, table, may_stop = stop.affects_stop, stop.table, np.any(stop.affects_stop)
    if work.notes[RUNS] == 0:
        active = min(LANES, runs)
        for lane in range(active):
            begin_lane(lane, work, initial, grid, key, first_run, limits, stream)
    for lane in range(active):
        needed[lane] = limits[0] if run[lane] < limits[2] else limits[1]
        if seen[lane] >= needed[lane]:
            upcoming[lane] = -np.inf  # its run is over
    while active > 0 and steps < last:
        lanes = np.uint64(active)  # unsigned: indices need no check for negative ones
        # Step 1 of the direct method in every lane: propensities and their running sums, as in `direct.advance`.
        for lane in range(lanes):
            total[lane], part[lane] = 0.0, 0.0
        for k in range(len(terms)):
            weight, partner, taken, place = terms[k, 0], np.uint64(terms[k, 1]), terms[k, 2], np.uint64(terms[k, 3])
            for lane in range(lanes):
                part[lane] += weight * (counts[partner, lane] - taken)
            if place > 0:
                for lane in range(lanes):
                    counts[place, lane], part[lane] = part[lane], 0.0
        for block in range(n_blocks):
            for lane in range(lanes):
                part[lane] = 0.0
            for r in range(BLOCK * block, min(BLOCK * (block + 1), n_channels)):
                coefficient, less = model.coefficients[r], model.less[r]
                first, second = np.uint64(model.first[r]), np.uint64(model.second[r])
                if model.is_general[r]:
                    factored_lanes(coefficient, model.factors, r, counts, target, active)
                    for lane in range(lanes):
                        part[lane] += target[lane]
                        within[np.uint64(r), lane] = part[lane]
                else:
                    for lane in range(lanes):
                        part[lane] += coefficient * counts[first, lane] * (counts[second, lane] - less)
                        within[np.uint64(r), lane] = part[lane]
            for lane in range(lanes):
                total[lane] += part[lane]
                upto[np.uint64(block), lane] = total[lane]
        add_candidates(model.thinning, within, upto, part, total, active)

        # Step 2: the waits (eq. 21a); both words of an event are drawn at once.
        n_crossed = 0
        for lane in range(lanes):
            s0, s1, s2, s3 = words[0, lane], words[1, lane], words[2, lane], words[3, lane]
            first, s0, s1, s2, s3 = next_word(s0, s1, s2, s3)
            second, s0, s1, s2, s3 = next_word(s0, s1, s2, s3)
            words[0, lane], words[1, lane], words[2, lane], words[3, lane] = s0, s1, s2, s3
            target[lane] = uniform(second) * total[lane]
            later = t[lane] + exponential(first) / total[lane]
            part[lane] = t[lane]
            later = later if later > t[lane] else np.inf  # a clock that stands still, or a total beyond double
            n_crossed += later > upcoming[lane]
            t[lane] = later

        steps += 1
        work.notes[STEPS] = steps
        if steps % 1024 == 0:  # with changes below 2**40, no count can pass 2**53 in between
            for s in range(n_species):
                for lane in range(lanes):
                    if counts[s, lane] > LARGEST_EXACT:
                        t[lane], total[lane] = np.inf, np.inf
                        n_crossed += 1
        # Lanes that passed a time of the grid write their counts; lanes that ended or are stuck take up the next run.
        n_ended = 0
        if n_crossed > 0:
            for lane in range(lanes):
                stuck = is_stuck(work, lane, steps)
                if not stuck and not t[lane] > upcoming[lane]:
                    continue
                k = seen[lane]
                if not stuck:
                    for s in range(n_species):
                        state[s] = np.int64(counts[s, lane])
                    place = np.uint64((run[lane] * n_times + k) * n_species)
                    while k < needed[lane] and grid[k] < t[lane]:
                        for s in range(n_species):
                            flat[place] = state[s]
                            place += np.uint64(1)
                        k += 1
                    seen[lane] = k
                    if k < needed[lane]:
                        upcoming[lane] = grid[k]
                        continue
                else:
                    is_odd[run[lane]] = True
                target[lane], total[lane] = np.inf, np.inf
                if work.notes[RUNS] < runs:
                    begin_lane(lane, work, initial, grid, key, first_run, limits, stream)
                else:
                    run[lane] = -1
                    n_ended += 1

        # Step 3: the channel (eq. 21b), counted without branches as the number of running sums not above the target.
        # A lane without an event has an infinite target, and channel R, which changes nothing.
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
        keep_candidates(model.thinning, model.first, within, upto, counts, target, chosen, active)
        # Step 4: fire, by whole rows for few species.
        if n_species <= GATHERED:
            for s in range(np.uint64(n_species)):
                for lane in range(lanes):
                    counts[s, lane] += change[s, np.uint64(chosen[lane])]
        else:
            for lane in range(lanes):
                for k in range(starts[chosen[lane]], starts[chosen[lane] + 1]):
                    counts[species_of[k], lane] += change[species_of[k], chosen[lane]]

        for lane in range(lanes if may_stop else 0):
            if run[lane] < 0 or not affects_stop[chosen[lane]] or not holds(stop, table, counts[:, lane]):
                continue
            reached[run[lane]] = t[lane]
            for k in range(seen[lane], n_times):
                for s in range(n_species):
                    out[run[lane], k, s] = np.int64(counts[s, lane])
            if work.notes[RUNS] < runs:
                begin_lane(lane, work, initial, grid, key, first_run, limits, stream)
            else:
                run[lane] = -1
                n_ended += 1
        if n_ended > 0:  # close the ranks
            kept = 0
            for lane in range(lanes):
                if run[lane] >= 0:
                    counts[:, kept], words[:, kept] = counts[:, lane], words[:, lane]
                    t[kept], upcoming[kept] = t[lane], upcoming[lane]
                    run[kept], seen[kept], needed[kept] = run[lane], seen[lane], needed[lane]
                    work.begun[kept], work.looks[kept] = work.begun[lane], work.looks[lane]
                    work.still[kept], work.stood[kept] = work.still[lane], work.stood[lane]
                    kept += 1
            active = kept
    work.notes[ACTIVE] = active
