"""Composition-rejection over groups of channels with partial propensities: very many channels, weakly coupled.

Channels that share a reactant, their owner, form a group (Ramaswamy & Sbalzarini 2010). Its propensities sum to

    n (L + like (n - 1)),   L = sum over its channels of coefficient * (rest of the reactants),

n the owner's count and `like` the coefficients of pairs of owners. So a change of the owner costs one product, however
many channels it has; a change of a partner makes L afresh.

Groups lie in bins by their sum, two to an octave (Slepoy et al. 2008, doi:10.1063/1.2919546). A group of a bin is taken
at random and kept with probability sum / upper end of the bin. The bins' masses, size times upper end, bound the true
total from above, so a rejection is an event at which nothing happens (thinning); upper ends are whole numbers of one
power of two, so no rounding ever builds up; and the cost does not grow with the number of channels. Within the group,
the channel is found by a walk over partial propensities made afresh from the counts: nothing can go stale, drift, or
dip below zero.

The group of the next event is picked before this one renews anything: its lines come from memory meanwhile. If a
group then moves to another bin, it is picked again, from the same draw; else bins and total are those it was picked by.

A step uses one of `waits` (unit exponentials) and one of `uniforms`; see `streams.draw`.
"""

from typing import NamedTuple

import numpy as np

from kinetics.kernels.clock import move_on
from kinetics.kernels.compiled import compiled
from kinetics.kernels.outcomes import OVERFLOW, STOPPED, UNFINISHED
from kinetics.kernels.stopping import holds

N_OCTAVES = 32
HEADROOM = 8  # octaves above the largest sum when the bins are laid out
N_BINS = 2 * N_OCTAVES
BIN_BITS = np.int64(51)  # of a double below its exponent and the first bit after the leading one
NO_BIN = NO_GROUP = -1
LARGEST_SUM = 2.0**1000  # so that all upper ends are finite

# What an event reads together lies together, and little of it: cache lines are much of what it costs.
CHANNEL = np.dtype([("coefficient", "f8"), ("partner", "u4"), ("event", "u4")], align=True)
PLAIN, LIKE, GENERAL = 0, 1, 2  # a channel's kind, in the two lowest bits of its partner
GROUP = np.dtype(
    [
        ("owners", "f8"),
        ("partial", "f8"),
        ("like", "f8"),
        ("owner", "u4"),
        ("start", "u4"),
        ("end", "u4"),
        ("bin", "i4"),
    ],
    align=True,
)


class RejectionModel(NamedTuple):
    """Channels in the order of their groups. Species S stands for the constant 1.

    channels (R,) CHANNEL : partner is 4 * species + kind. The partial propensity is coefficient * x[species], or
        coefficient * (x[species] - 1) for a like pair, or takes the factors. `event` is the word where its event begins
    factors (R, K, 3) int32 : see `sampling.mass_action`; the first factor is the owner's
    words (n,) uint32 : of an event, the number of species that it changes and the end of its list, or 0 if the lists
        of these species are to be taken one after the other; of each species its number, and the lower and the upper
        half of the copies gained; then the list. Of a species, the end of its list, then the list. A list names the
        groups to renew: 2 * group, and 1 more where L must be renewed
    lists (S,) uint32 : the word where the list of each species begins
    groups (G,) GROUP : owner, first channel and end, coefficients of the plain like pairs, which L leaves out. The rest
        is for `RejectionWork`
    """

    channels: np.ndarray
    factors: np.ndarray
    words: np.ndarray
    lists: np.ndarray
    groups: np.ndarray


class RejectionWork(NamedTuple):
    """State of one run between calls.

    groups (G,) GROUP : count of each group's owner, partial (L) and bin
    places (G,) uint32 : where in its bin each group lies
    members (N_BINS G,) uint32, sizes (N_BINS,) : groups in each bin
    uppers, inverses, masses (N_BINS,) : upper end of each bin, 1/tu, one over it, and it times the bin's size
    bins (3,) : what the bits of a double have for the first bin, lowest and highest bin in use
    total (1,) : sum of the masses; exact, for it is a whole number of the lowest bins' units below 2**53
    """

    groups: np.ndarray
    places: np.ndarray
    members: np.ndarray
    sizes: np.ndarray
    uppers: np.ndarray
    inverses: np.ndarray
    masses: np.ndarray
    bins: np.ndarray
    total: np.ndarray


@compiled
def start(model, work, counts):
    """L, sums and bins for a run that begins at `counts` (S + 1,), the last one 1."""
    channels, groups = model.channels, work.groups
    for g in range(groups.size):
        part = 0.0
        for r in range(groups[g].start, groups[g].end):
            kind, partner = channels[r].partner & 3, channels[r].partner >> 2
            if kind == GENERAL:
                part += general_partial(channels[r].coefficient, model.factors, r, counts)
            elif kind == PLAIN:
                part += channels[r].coefficient * float(counts[partner])
        groups[g].partial = part
        groups[g].owners = counts[groups[g].owner]
    fill_bins(work)


@compiled
def general_partial(coefficient, factors, r, counts):
    """Propensity of a channel of any order, divided by its owner's count. Slow: kept out of the common path."""
    if counts[factors[r, 0, 0]] < factors[r, 0, 2]:
        return 0.0
    propensity = coefficient
    for j in range(1, factors.shape[1]):
        copies = counts[factors[r, j, 0]]
        propensity *= (copies - factors[r, j, 1]) if copies >= factors[r, j, 2] else 0
    return propensity


@compiled
def sum_of(group):
    """Sum of the propensities of a group, from what its record holds."""
    return group.owners * (group.partial + group.like * (group.owners - 1.0))


@compiled
def fill_bins(work):
    """Lay the bins out anew around the largest sum; a total beyond double where that is beyond `LARGEST_SUM`."""
    groups = work.groups
    largest = 0.0
    for g in range(groups.size):
        largest = max(largest, sum_of(groups[g]))
    if largest > LARGEST_SUM:
        work.total[0] = np.inf
        return
    exponent = np.float64(largest).view(np.int64) >> np.int64(52)
    base = 2 * max(exponent - np.int64(N_OCTAVES - 1 - HEADROOM), np.int64(1))
    lowest, highest = np.int64(N_BINS - 1), np.int64(0)
    work.sizes[:] = 0
    for g in range(groups.size):
        groups[g].bin = NO_BIN
        total = sum_of(groups[g])
        if total > 0.0:
            bin_ = max((np.float64(total).view(np.int64) >> BIN_BITS) - base, np.int64(0))
            groups[g].bin, work.places[g] = bin_, work.sizes[bin_]
            work.members[bin_ * groups.size + work.sizes[bin_]] = g
            work.sizes[bin_] += 1
            lowest, highest = min(lowest, bin_), max(highest, bin_)
    work.total[0] = 0.0
    for b in range(N_BINS):
        work.uppers[b] = np.int64((base + b + 1) << BIN_BITS).view(np.float64)
        work.inverses[b] = 1.0 / work.uppers[b]
        work.masses[b] = work.sizes[b] * work.uppers[b]
        work.total[0] += work.masses[b]
    work.bins[0], work.bins[1], work.bins[2] = base, lowest, highest


@compiled(inline="always")
def pick(target, lowest, highest, sizes, uppers, inverses, masses, members, groups):
    """A group by the uniform share `target` of the total: highest bin in use, what is left, group, first channel.

    It is kept if what is left is below its sum. NO_GROUP where rounding led beyond the last bin, to an empty one. The
    arrays are of `RejectionWork`, one by one: taken out of it here, they would nearly double what an event costs.
    """
    while highest > lowest and sizes[np.uint64(highest)] == 0:
        highest -= 1
    bin_ = np.uint64(highest)
    while bin_ > np.uint64(lowest) and masses[bin_] <= target:
        target -= masses[bin_]
        bin_ -= np.uint64(1)
    which = min(np.int64(target * inverses[bin_]), sizes[bin_] - 1)
    if which < 0:
        return highest, target, np.int64(NO_GROUP), np.uint64(0)
    group = np.uint64(members[bin_ * np.uint64(groups.size) + np.uint64(which)])
    target = max(target - which * uppers[bin_], 0.0)
    return highest, target, np.int64(group), np.uint64(groups[group].start)


@compiled
def advance(model, work, counts, seen, clock, waits, uniforms, grid, out, times, fired, stop):
    """Run one trajectory on until it has passed the last time of the grid, or until the draws are used up.

    Arguments and result as of `kernels.grouped.advance`.
    """
    channels, factors, words, lists = model.channels, model.factors, model.words, model.lists
    groups, places, members, sizes = work.groups, work.places, work.members, work.sizes
    uppers, inverses, masses = work.uppers, work.inverses, work.masses
    affects_stop, table = stop.affects_stop, stop.table
    # Unsigned: indices need no check for negative ones.
    one, two, three, n_groups = np.uint64(1), np.uint64(2), np.uint64(3), np.uint64(groups.size)
    base, lowest, highest = work.bins[0], work.bins[1], work.bins[2]
    t, total = clock[0], work.total[0]
    passed, n_events = seen[0], 0
    outcome = UNFINISHED
    target, picked, chosen, is_stale = 0.0, np.int64(NO_GROUP), np.uint64(0), True
    is_over, event = False, np.uint64(0)
    for draw in range(np.uint64(waits.size)):
        t, passed, outcome = move_on(t, waits[draw], total, clock, counts, grid, passed, out)
        if outcome != UNFINISHED:
            break

        if is_stale:
            highest, target, picked, chosen = pick(
                uniforms[draw] * total, lowest, highest, sizes, uppers, inverses, masses, members, groups
            )
        is_stale = True
        if picked == NO_GROUP:
            continue
        group = np.uint64(picked)
        owners = groups[group].owners
        whole = owners * (groups[group].partial + groups[group].like * (owners - 1.0))
        # Rejection: the point lies between the group's sum and the upper edge of its bin.
        if target >= whole:
            if highest == 0:  # all sums have fallen below the bins
                fill_bins(work)
                base, lowest, highest = work.bins[0], work.bins[1], work.bins[2]
                total = work.total[0]
            continue
        # Composition: the point below the sum falls on a channel of the group.
        end = np.uint64(groups[group].end)
        part = 0.0
        while chosen < end:
            partner = channels[chosen].partner
            kind = partner & np.uint32(3)
            if kind != GENERAL:
                part += channels[chosen].coefficient * (float(counts[partner >> np.uint32(2)]) - float(kind))
            else:
                part += general_partial(channels[chosen].coefficient, factors, chosen, counts)
            if owners * part > target:
                break
            chosen += one
        if not owners * part > target:  # the sum was rounded up
            continue

        # Pick the group of the next step before the updates; it is stale, and picked again, if they move a group to
        # another bin.
        fires, event = chosen, np.uint64(channels[chosen].event)
        is_stale = draw + one == np.uint64(waits.size)
        if not is_stale:
            highest, target, picked, chosen = pick(
                uniforms[draw + one] * total, lowest, highest, sizes, uppers, inverses, masses, members, groups
            )
        first = event + two
        begin = first + three * np.uint64(words[event])
        for k in range(first, begin, three):
            s = words[k]
            gain = (np.uint64(words[k + two]) << np.uint64(32)) | np.uint64(words[k + one])
            count = counts[s] + np.int64(gain)
            counts[s] = count
            is_over |= count < 0
        if is_over:
            outcome = OVERFLOW
            break
        # Renew the partial sums, and the bins, of all groups that read a changed count.
        is_beyond = False
        list_end = np.uint64(words[event + one])
        is_joint = list_end > 0
        while True:
            if not is_joint:
                if first == begin:
                    break
                head = np.uint64(lists[words[first]])
                first += three
                list_end = np.uint64(words[head])
            for i in range(begin if is_joint else head + one, list_end):
                code = words[i]
                group = np.uint64(code >> np.uint32(1))
                part = groups[group].partial
                if code & np.uint32(1):
                    part = 0.0
                    for r in range(np.uint64(groups[group].start), np.uint64(groups[group].end)):
                        partner = channels[r].partner
                        kind = partner & np.uint32(3)
                        if kind == PLAIN:
                            part += channels[r].coefficient * float(counts[partner >> np.uint32(2)])
                        elif kind == GENERAL:
                            part += general_partial(channels[r].coefficient, factors, r, counts)
                    groups[group].partial = part
                owners = float(counts[groups[group].owner])
                groups[group].owners = owners
                part = owners * (part + groups[group].like * (owners - 1.0))
                new = np.int64(NO_BIN)
                if part > 0.0:
                    new = max((np.float64(part).view(np.int64) >> BIN_BITS) - base, np.int64(0))
                old = np.int64(groups[group].bin)
                if new == old:
                    continue
                is_stale = True
                if new >= N_BINS:
                    is_beyond = True
                    continue
                if old != NO_BIN:  # the last of the old bin fills the gap
                    left = np.uint64(old)
                    size = sizes[left] - 1
                    sizes[left] = size
                    masses[left] -= uppers[left]
                    total -= uppers[left]
                    last_one = members[left * n_groups + np.uint64(size)]
                    members[left * n_groups + np.uint64(places[group])] = last_one
                    places[last_one] = places[group]
                groups[group].bin = new
                if new != NO_BIN:
                    entered = np.uint64(new)
                    size = sizes[entered]
                    sizes[entered] = size + 1
                    masses[entered] += uppers[entered]
                    total += uppers[entered]
                    members[entered * n_groups + np.uint64(size)] = group
                    places[group] = size
                    lowest, highest = min(lowest, new), max(highest, new)
            if is_joint:
                break
        if is_beyond:
            fill_bins(work)
            base, lowest, highest = work.bins[0], work.bins[1], work.bins[2]
            total = work.total[0]
        if times.size > 0:
            times[n_events] = t
            fired[n_events] = fires
        n_events += 1
        if affects_stop[fires] and holds(stop, table, counts):
            outcome = STOPPED
            break
    if is_over:  # the event has not been; undone out here, it costs the others nothing
        for k in range(event + two, event + two + three * np.uint64(words[event]), three):
            gain = (np.uint64(words[k + two]) << np.uint64(32)) | np.uint64(words[k + one])
            counts[words[k]] -= np.int64(gain)
    work.bins[1], work.bins[2], work.total[0] = lowest, highest, total
    seen[0], seen[1] = passed, n_events
    clock[0] = t
    return outcome
