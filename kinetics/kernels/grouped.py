"""Direct methods that update only what an event changed. Channels are kept in groups, each with its sum.

Two ways to choose the group, then the channel within it by its share of the group's sum:

    in turn     the groups' sums are added up and searched: the direct method, to the last bit as in `kernels.ssa` where
                the groups are its blocks; quick up to some hundred channels
    in bins     composition and rejection (Slepoy, Thompson & Plimpton 2008): groups lie in bins by their sum, four to
                an octave; a group of a bin is taken at random and kept with probability sum / upper end of the bin.
                The bins' weights are whole numbers times powers of two and bound the true total from above, so a
                rejection is an event at which nothing happens (thinning), no rounding ever builds up, and the cost
                does not grow with the number of channels.

Sums are always made afresh from their channels, and propensities from the counts: nothing can go stale, drift, or dip
below zero. A step uses one of `waits` (unit exponentials) and one of `uniforms`; see `kernels.ssa.draw`.
"""

from typing import NamedTuple

import numpy as np
from numba import njit

# Outcomes of a run, as in `kernels.ssa`
REACHED_END = 0
DRAWS_USED = 1  # resume with fresh waits and uniforms
STALLED_CLOCK = 2
OVERFLOW = 3

N_OCTAVES = 32
HEADROOM = 8  # octaves above the largest sum when the bins are laid out
N_BINS = 4 * N_OCTAVES
NO_BIN = -1


class Model(NamedTuple):
    """Channels in the order of their groups.

    What is read together lies together, and in flat arrays, row after row: cache lines and the products that places
    in tables ask for are much of what an event costs.

    coefficients (R,), factors (R, K, 3) int32 : see `kernels.ssa`
    channels (6 R,) int32 : a, b, less, is_general, start, end. The propensity is the coefficient times x[a] times
        (x[b] - less), or takes the factors where is_general is not 0. Rows start to end of `changes` are its changes
    changes (2 n,) int64 : species, and copies gained
    groups (2 G,) int32 : start and end of its channels
    species (4 S,) int32 : start and end in `readers`, start and end in `touched`
    touched (2 n,) int32 : a group with channels that read the species, and whether all its channels do
    readers (n,) int32 : the channels that read the species, of groups in which not all do
    """

    coefficients: np.ndarray
    factors: np.ndarray
    channels: np.ndarray
    changes: np.ndarray
    groups: np.ndarray
    species: np.ndarray
    touched: np.ndarray
    readers: np.ndarray


class Work(NamedTuple):
    """What one run keeps between calls.

    propensities (R,), sums (G,), upto (G,) : of channels, of groups, and running over groups
    lodgings (2 G,) int32 : bin of each group, and where in the bin it lies
    members (N_BINS G,) int32, sizes (N_BINS,) : groups in each bin; bin 4 o + m has sums below (5 + m) quarters
    weights, quarters (N_OCTAVES,) : sum of 5 + m over the groups of an octave, and a quarter of its lower end, 1/tu
    octaves (3,) : binary exponent of the first octave as a double has it, lowest and highest octave in use
    total (1,) : sum of weights times quarters; exact, for it is a whole number of the lowest quarters below 2**53
    """

    propensities: np.ndarray
    sums: np.ndarray
    upto: np.ndarray
    lodgings: np.ndarray
    members: np.ndarray
    sizes: np.ndarray
    weights: np.ndarray
    quarters: np.ndarray
    octaves: np.ndarray
    total: np.ndarray


@njit(cache=True, nogil=True, error_model="numpy")
def start(model, work, counts, in_bins):
    """Propensities, sums and bins for a run that begins at `counts` (S + 1,), the last one 1."""
    for group in range(work.sums.size):
        part = 0.0
        for r in range(model.groups[2 * group], model.groups[2 * group + 1]):
            work.propensities[r] = general(model.coefficients[r], model.factors, r, counts)
            part += work.propensities[r]
        work.sums[group] = part
    if in_bins:
        fill_bins(work)


@njit(cache=True, nogil=True, error_model="numpy")
def general(coefficient, factors, r, counts):
    """Propensity of a channel of any order, see `kernels.ssa`. Slow: kept out of the common path."""
    propensity = coefficient
    for j in range(factors.shape[1]):
        copies = counts[factors[r, j, 0]]
        propensity *= (copies - factors[r, j, 1]) if copies >= factors[r, j, 2] else 0
    return propensity


@njit(cache=True, nogil=True, error_model="numpy")
def fill_bins(work):
    """Lay the bins out anew around the largest sum."""
    largest = 0.0
    for value in work.sums:
        largest = max(largest, value)
    exponent = np.float64(largest).view(np.int64) >> np.int64(52)
    base = max(exponent - np.int64(N_OCTAVES - 1 - HEADROOM), np.int64(1))
    lowest, highest = np.int64(N_OCTAVES - 1), np.int64(0)
    work.sizes[:] = 0
    work.weights[:] = 0.0
    for group in range(work.sums.size):
        work.lodgings[2 * group] = NO_BIN
        if work.sums[group] > 0.0:
            # The exponent and the first two bits after the leading one.
            bin_ = max((np.float64(work.sums[group]).view(np.int64) >> np.int64(50)) - 4 * base, np.int64(0))
            work.lodgings[2 * group], work.lodgings[2 * group + 1] = bin_, work.sizes[bin_]
            work.members[bin_ * work.sums.size + work.sizes[bin_]] = group
            work.sizes[bin_] += 1
            work.weights[bin_ >> 2] += 5 + (bin_ & 3)
            lowest, highest = min(lowest, bin_ >> np.int64(2)), max(highest, bin_ >> np.int64(2))
    work.total[0] = 0.0
    for octave in range(N_OCTAVES):
        work.quarters[octave] = 2.0 ** (base + octave - 1025)
        work.total[0] += work.weights[octave] * work.quarters[octave]
    work.octaves[0], work.octaves[1], work.octaves[2] = base, lowest, highest


@njit(cache=True, nogil=True, error_model="numpy")
def advance(model, work, counts, in_bins, seen, clock, waits, uniforms, grid, out, times, fired):
    """Run one trajectory on until it has passed the last time of the grid, or until the draws are used up.

    model, work : see `Model` and `Work`; work is changed in place
    counts : (S + 1,), the last one 1; changed in place
    in_bins : choose the group in bins, or in turn
    seen : (2,) times of the grid that were passed, events so far in this call; changed in place
    clock : (1,) tu; changed in place
    waits, uniforms : (D,) draws
    grid, out : (T,) tu and (T, S), receives the counts
    times, fired : receive the events; (D,), or (0,) where nobody asks for them

    Returns the outcome.
    """
    coefficients, factors, species, readers = model.coefficients, model.factors, model.species, model.readers
    channels, changes, groups, touched = model.channels, model.changes, model.groups, model.touched
    propensities, sums, upto = work.propensities, work.sums, work.upto
    lodgings, members, sizes = work.lodgings, work.members, work.sizes
    weights, quarters = work.weights, work.quarters
    n_groups, n_species, n_times = sums.size, out.shape[1], grid.size
    base, lowest, highest = work.octaves[0], work.octaves[1], work.octaves[2]
    t = clock[0]
    passed, n_events = seen[0], 0
    total = work.total[0]
    outcome = DRAWS_USED
    for draw in range(waits.size):
        if not in_bins:
            total = 0.0
            for i in range(n_groups):
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
        if in_bins:
            while weights[highest] == 0.0 and highest > lowest:
                highest -= 1
            octave = highest
            above = 0.0
            while octave > lowest and above + weights[octave] * quarters[octave] <= target:
                above += weights[octave] * quarters[octave]
                octave -= 1
            share = (target - above) / quarters[octave]
            bin_ = 4 * octave + 3
            width = 8
            while width > 5 and share >= width * sizes[bin_]:
                share -= width * sizes[bin_]
                bin_ -= 1
                width -= 1
            which = min(np.int64(share) // width, sizes[bin_] - 1)
            group = np.int64(members[bin_ * n_groups + which])
            target = (share - which * width) * quarters[octave]
            if target >= sums[group]:
                if highest == 0:  # all sums have fallen below the bins
                    fill_bins(work)
                    base, lowest, highest = work.octaves[0], work.octaves[1], work.octaves[2]
                    total = work.total[0]
                continue
        else:
            group = np.int64(0)
            while upto[group] <= target and upto[group] < total:
                group += 1
            if group > 0:
                target -= upto[group - 1]
        chosen = np.int64(groups[2 * group])
        part = propensities[chosen]
        while part <= target and part < sums[group]:
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
        is_beyond = False
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
                group = np.int64(touched[2 * i])
                is_whole = touched[2 * i + 1] != 0
                part = 0.0
                for r in range(np.int64(groups[2 * group]), np.int64(groups[2 * group + 1])):
                    if is_whole:
                        propensity = coefficients[r]
                        if channels[6 * r + 3] == 0:
                            propensity *= counts[np.uint64(channels[6 * r])]
                            propensity *= counts[np.uint64(channels[6 * r + 1])] - channels[6 * r + 2]
                        else:
                            propensity = general(propensity, factors, r, counts)
                        propensities[r] = propensity
                    part += propensities[r]
                sums[group] = part
                if in_bins:
                    bin_ = np.int64(NO_BIN)
                    if part > 0.0:
                        bin_ = max((np.float64(part).view(np.int64) >> np.int64(50)) - 4 * base, np.int64(0))
                    old = np.int64(lodgings[2 * group])
                    if bin_ == old:
                        continue
                    if bin_ >= N_BINS:
                        is_beyond = True
                        continue
                    if old != NO_BIN:  # the last of the old bin fills the gap
                        sizes[old] -= 1
                        weights[old >> 2] -= 5 + (old & 3)
                        total -= (5 + (old & 3)) * quarters[old >> 2]
                        last_one = members[old * n_groups + sizes[old]]
                        members[old * n_groups + lodgings[2 * group + 1]] = last_one
                        lodgings[2 * last_one + 1] = lodgings[2 * group + 1]
                    lodgings[2 * group] = bin_
                    if bin_ != NO_BIN:
                        members[bin_ * n_groups + sizes[bin_]] = group
                        lodgings[2 * group + 1] = sizes[bin_]
                        sizes[bin_] += 1
                        weights[bin_ >> 2] += 5 + (bin_ & 3)
                        total += (5 + (bin_ & 3)) * quarters[bin_ >> 2]
                        lowest, highest = min(lowest, bin_ >> np.int64(2)), max(highest, bin_ >> np.int64(2))
        if is_beyond:
            fill_bins(work)
            base, lowest, highest = work.octaves[0], work.octaves[1], work.octaves[2]
            total = work.total[0]
        if times.size > 0:
            times[n_events] = t
            fired[n_events] = chosen
        n_events += 1
    work.octaves[1], work.octaves[2], work.total[0] = lowest, highest, total
    seen[0], seen[1] = passed, n_events
    clock[0] = t
    return outcome
