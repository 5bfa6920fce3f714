"""The direct method for many runs side by side: each does the arithmetic of `direct.advance` in a lane of vectors."""

import numpy as np

from kinetics.kernels.blocks import BLOCK
from kinetics.kernels.compiled import compiled
from kinetics.kernels.direct import ensemble
from kinetics.kernels.outcomes import REACHED_END
from kinetics.kernels.streams import exponential, next_word, start_stream, uniform

LANES = 64  # runs side by side
GATHERED = 8  # up to so many species, all are updated whichever channel fired: quicker than its own few
LARGEST_EXACT = 2.0**52  # lanes count in doubles, which are exact up to 2**53


@compiled
def begin_lane(lane, i, initial, grid, key, first_run, counts, t, upcoming, words, run, seen, stream):
    """Put the i-th run of the ensemble into a lane of `lockstep`."""
    start_stream(key, first_run + i, stream)
    words[:, lane] = stream
    counts[: initial.size, lane] = initial
    t[lane], upcoming[lane] = 0.0, grid[0]
    run[lane], seen[lane] = i, 0


@compiled
def factored_lanes(coefficient, factors, r, counts, propensities, active):
    """`blocks.factored` in the lanes of `lockstep`."""
    propensities[:active] = coefficient
    for j in range(factors.shape[1]):
        for lane in range(active):
            copies = counts[factors[r, j, 0], lane]
            propensities[lane] *= (copies - factors[r, j, 1]) if copies >= factors[r, j, 2] else 0.0


@compiled
def lockstep(model, changes, initial, grid, key, first_run, out):
    """`ensemble`, with `LANES` runs side by side: each does the arithmetic of `advance`, in a lane of vectors.

    Arguments and result as of `ensemble`. A lane that ends its run takes up the next one. Runs that come to counts
    which a double cannot hold, or to a clock that stands still, are made again by `ensemble`.
    """
    n_channels, n_species = changes.shape
    terms = model.terms
    n_blocks = (n_channels + BLOCK - 1) // BLOCK
    runs, n_times, _ = out.shape
    flat = out.ravel()  # no copy
    state = np.empty(n_species, dtype=np.int64)
    counts = np.ones((n_species + 1 + np.count_nonzero(terms[:, 3]), LANES))
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
    change[:, :n_channels] = changes.T
    starts, species_of = np.zeros(n_channels + 2, dtype=np.int64), np.nonzero(changes)[1]
    for r in range(n_channels):
        starts[r + 1] = starts[r] + np.count_nonzero(changes[r])
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

        n_crossed = 0
        for lane in range(lanes):
            s0, s1, s2, s3 = words[0, lane], words[1, lane], words[2, lane], words[3, lane]
            first, s0, s1, s2, s3 = next_word(s0, s1, s2, s3)
            second, s0, s1, s2, s3 = next_word(s0, s1, s2, s3)
            words[0, lane], words[1, lane], words[2, lane], words[3, lane] = s0, s1, s2, s3
            target[lane] = uniform(second) * total[lane]
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
        outcome, failed = ensemble(model, changes, initial, grid, key, first_run + i, out[i : i + 1])
        if outcome != REACHED_END:
            return outcome, failed
    return REACHED_END, first_run + runs - 1
