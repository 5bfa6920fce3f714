"""Composition and rejection over groups of channels with partial propensities: very many channels, weakly coupled.

Channels that share a reactant, their owner, form a group (Ramaswamy & Sbalzarini 2010). Its propensities sum to

    n (L + like (n - 1)),   L = sum over its channels of coefficient * (rest of the reactants),

n the owner's count and `like` the coefficients of pairs of owners. So a change of the owner costs one product, however
many channels it has; a change of a partner makes L afresh.

Groups lie in bins by their sum, four to an octave (Slepoy, Thompson & Plimpton 2008). A group of a bin is taken at
random and kept with probability sum / upper end of the bin. The bins' weights are whole numbers times powers of two and
bound the true total from above, so a rejection is an event at which nothing happens (thinning), no rounding ever builds
up, and the cost does not grow with the number of channels. Within the group, the channel is found by a walk over
partial propensities made afresh from the counts: nothing can go stale, drift, or dip below zero.

A step uses one of `waits` (unit exponentials) and one of `uniforms`; see `kernels.ssa.draw`.
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
MOST_GROUPS = 2**18  # with 8 a group at most, the weights then make an exact sum over all octaves in a double


class Model(NamedTuple):
    """Channels in the order of their groups.

    What is read together lies together, and in flat arrays, row after row: cache lines and the products that places
    in tables ask for are much of what an event costs. Species S stands for the constant 1.

    coefficients (R,), factors (R, K, 3) int32 : see `methods.mass_action`; the first factor is the owner's
    channels (5 R,) int32 : partner, less, is_general, start, end. The partial propensity is the coefficient times
        (x[partner] - less), or takes the factors where is_general is not 0. Its changes are rows start to end
    changes (2 n,) int64 : species, and copies gained
    groups (3 G,) int32 : owner, and start and end of its channels
    likes (G,) : coefficients of the plain like pairs, which L leaves out
    species (2 (S + 1),) int32 : start and end in `touched`
    touched (2 n,) int32 : a group that reads the species, and whether its L does
    """

    coefficients: np.ndarray
    factors: np.ndarray
    channels: np.ndarray
    changes: np.ndarray
    groups: np.ndarray
    likes: np.ndarray
    species: np.ndarray
    touched: np.ndarray


class Work(NamedTuple):
    """What one run keeps between calls.

    partials, sums (G,) : L, and the sum of the propensities of each group
    lodgings (2 G,) int32 : bin of each group, and where in the bin it lies
    members (N_BINS G,) int32, sizes (N_BINS,) : groups in each bin; bin 4 o + m has sums below (5 + m) quarters
    weights, quarters (N_OCTAVES,) : sum of 5 + m over the groups of an octave, and a quarter of its lower end, 1/tu
    octaves (3,) : binary exponent of the first octave as a double has it, lowest and highest octave in use
    total (1,) : sum of weights times quarters; exact, for it is a whole number of the lowest quarters below 2**53
    """

    partials: np.ndarray
    sums: np.ndarray
    lodgings: np.ndarray
    members: np.ndarray
    sizes: np.ndarray
    weights: np.ndarray
    quarters: np.ndarray
    octaves: np.ndarray
    total: np.ndarray


@njit(cache=True, nogil=True, error_model="numpy")
def start(model, work, counts):
    """L, sums and bins for a run that begins at `counts` (S + 1,), the last one 1."""
    for group in range(work.sums.size):
        part = 0.0
        for r in range(model.groups[3 * group + 1], model.groups[3 * group + 2]):
            if model.channels[5 * r + 2] != 0:
                part += general_partial(model.coefficients[r], model.factors, r, counts)
            elif model.channels[5 * r + 1] == 0:
                part += model.coefficients[r] * counts[model.channels[5 * r]]
        work.partials[group] = part
        copies = float(counts[model.groups[3 * group]])
        work.sums[group] = copies * (part + model.likes[group] * (copies - 1.0))
    fill_bins(work)


@njit(cache=True, nogil=True, error_model="numpy")
def general_partial(coefficient, factors, r, counts):
    """Propensity of a channel of any order, divided by its owner's count. Slow: kept out of the common path."""
    if counts[factors[r, 0, 0]] < factors[r, 0, 2]:
        return 0.0
    propensity = coefficient
    for j in range(1, factors.shape[1]):
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
def advance(model, work, counts, seen, clock, waits, uniforms, grid, out, times, fired):
    """Run one trajectory on until it has passed the last time of the grid, or until the draws are used up.

    Arguments and result as of `kernels.grouped.advance`.
    """
    coefficients, factors, likes, species = model.coefficients, model.factors, model.likes, model.species
    channels, changes, groups, touched = model.channels, model.changes, model.groups, model.touched
    partials, sums, lodgings, members, sizes = work.partials, work.sums, work.lodgings, work.members, work.sizes
    weights, quarters = work.weights, work.quarters
    n_groups, n_species, n_times = sums.size, out.shape[1], grid.size
    base, lowest, highest = work.octaves[0], work.octaves[1], work.octaves[2]
    t, total = clock[0], work.total[0]
    passed, n_events = seen[0], 0
    outcome = DRAWS_USED
    for draw in range(waits.size):
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
        if target >= sums[group] or which < 0:  # no such place only where rounding led beyond the last bin
            if highest == 0:  # all sums have fallen below the bins
                fill_bins(work)
                base, lowest, highest = work.octaves[0], work.octaves[1], work.octaves[2]
                total = work.total[0]
            continue
        share = target / counts[groups[3 * group]]
        chosen = np.int64(groups[3 * group + 1])
        end = np.int64(groups[3 * group + 2])
        part = 0.0
        while chosen < end:
            if channels[5 * chosen + 2] == 0:
                part += coefficients[chosen] * (counts[channels[5 * chosen]] - channels[5 * chosen + 1])
            else:
                part += general_partial(coefficients[chosen], factors, chosen, counts)
            if part > share:
                break
            chosen += 1
        if not part > share:  # the sum was rounded up
            continue

        is_over = False
        first, last = channels[5 * chosen + 3], channels[5 * chosen + 4]
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
            for i in range(species[2 * s], species[2 * s + 1]):
                group = np.int64(touched[2 * i])
                if touched[2 * i + 1] != 0:
                    part = 0.0
                    for r in range(np.int64(groups[3 * group + 1]), np.int64(groups[3 * group + 2])):
                        if channels[5 * r + 2] != 0:
                            part += general_partial(coefficients[r], factors, r, counts)
                        elif channels[5 * r + 1] == 0:
                            part += coefficients[r] * counts[channels[5 * r]]
                    partials[group] = part
                copies = float(counts[groups[3 * group]])
                part = copies * (partials[group] + likes[group] * (copies - 1.0))
                sums[group] = part
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
