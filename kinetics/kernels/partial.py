"""The partial-propensity method (Ramaswamy et al. 2009, doi:10.1063/1.3154624): many channels among few species.

Each channel of at most two reactants is owned by one of them. Its propensity is the owner's count times a partial
propensity, which depends on the partner only, so that an event changes one row of a table for each species whose count
it changes, however many channels there are:

    sum over the channels of owner i = n_i (L_i + p_i),   L_i = u_i + sum_j C_ij n_j,   p_i = c_i (n_i - less_i)

with u_i the coefficients of channels of i alone, C_ij of pairs i, j and c_i of like pairs. Channels without a reactant
belong to an owner of their own, number S, of which there is always one copy.

An event renews the sums of the owners that it changes, and with them those of their blocks of 8 owners and of 64: the
channel's owner is found from the largest down, and the channel by a walk over the exact partial propensities of its
owner, eight at a time.

L_i is carried from event to event, so it gathers rounding. It therefore starts a little too large, by more than all
that rounding could take away until it is next made afresh: it bounds the true value from above. A walk that ends
without a channel is an event at which nothing happens (thinning), so rounding cannot let a channel fire that could not,
nor bias the others.

A step uses one of `waits` (unit exponentials) and one of `uniforms`; see `streams.draw`.
"""

from typing import NamedTuple

import numpy as np

from kinetics.kernels.blocks import BLOCK
from kinetics.kernels.clock import move_on
from kinetics.kernels.compiled import compiled
from kinetics.kernels.outcomes import OVERFLOW, STOPPED, UNFINISHED
from kinetics.kernels.stopping import holds

REFRESH = 1024  # steps after which L is made afresh
UNIT = 2.0**-53  # largest relative error of one rounding


class PartialModel(NamedTuple):
    """Owners are the species, then the one of channels without reactants; blocks are filled up with empty owners.

    couplings (S, W) : C_ij at [j, i], W owners with those that fill up the last block of blocks
    reach (S, 2) int64 : first and last + 1 of the owners i that are coupled to species j
    alone (W,) : u_i
    like (W,), less (W,) : c_i and less_i of like pairs, which need two copies
    owned_starts (W + 1,) : first channel of each owner; channels are in the order of their owners
    partners (R,) int32 : species j of a pair, S for the constant 1, W + i for a like pair
    coefficients (R,)
    change_starts (R + 1,), change_owners, change_copies : what a channel changes
    species (S + 1,) : of the network, for each owner
    largest_gain, most_changes : the most copies that one event adds of a species, and species that it changes
    """

    couplings: np.ndarray
    reach: np.ndarray
    alone: np.ndarray
    like: np.ndarray
    less: np.ndarray
    owned_starts: np.ndarray
    partners: np.ndarray
    coefficients: np.ndarray
    change_starts: np.ndarray
    change_owners: np.ndarray
    change_copies: np.ndarray
    species: np.ndarray
    largest_gain: float
    most_changes: int


class PartialWork(NamedTuple):
    """State of one run between calls.

    copies (2 W,) : counts of the owners as doubles, then what a like pair takes beside one copy: n_i - less_i, or 0
    partials (W,) : L, a bound from above
    sums (W,), blocks (W / 8,), spans (W / 64,) : sums over the channels of an owner, and of 8 and 64 owners
    age (1,) : steps since L was made afresh
    """

    copies: np.ndarray
    partials: np.ndarray
    sums: np.ndarray
    blocks: np.ndarray
    spans: np.ndarray
    age: np.ndarray


@compiled
def refresh(model, work):
    """Make L afresh, with its margin; the true total of all propensities but for one rounding each.

    An update of L_i adds a product: two roundings of numbers up to B_i, the largest that L_i can come to before the
    next refresh. An event updates it once for each species that it changes, at most `most_changes` times.
    """
    n_species, width = model.couplings.shape
    work.partials[:] = model.alone
    gained = REFRESH * model.largest_gain
    reached = model.alone.copy()
    for j in range(n_species):
        count = work.copies[j]
        for i in range(model.reach[j, 0], model.reach[j, 1]):
            work.partials[i] += model.couplings[j, i] * count
            reached[i] += model.couplings[j, i] * (count + gained)
    total = 0.0
    updates = 2.0 * (REFRESH * model.most_changes + n_species + 2)
    for i in range(width):
        like = model.like[i] * work.copies[width + i]
        total += work.copies[i] * (work.partials[i] + like)
        work.partials[i] += updates * UNIT * reached[i]
        work.sums[i] = work.copies[i] * (work.partials[i] + like)
    for block in range(work.blocks.size):
        work.blocks[block] = eight(work.sums, np.uint64(BLOCK * block))
    for span in range(work.spans.size):
        work.spans[span] = eight(work.blocks, np.uint64(BLOCK * span))
    work.age[0] = 0
    return total


@compiled(inline="always")
def eight(parts, i):
    """Sum of eight parts from i (unsigned) on; in pairs, so that no sum waits for the one before."""
    low = (parts[i] + parts[i + np.uint64(1)]) + (parts[i + np.uint64(2)] + parts[i + np.uint64(3)])
    high = (parts[i + np.uint64(4)] + parts[i + np.uint64(5)]) + (parts[i + np.uint64(6)] + parts[i + np.uint64(7)])
    return low + high


@compiled
def advance(model, work, counts, seen, clock, waits, uniforms, grid, out, times, fired, stop):
    """Run one trajectory on until it has passed the last time of the grid, or until the draws are used up.

    Arguments and result as of `kernels.grouped.advance`.
    """
    couplings, reach, like, less = model.couplings, model.reach, model.like, model.less
    partners, coefficients, owned_starts = model.partners, model.coefficients, model.owned_starts
    change_starts, change_owners, change_copies = model.change_starts, model.change_owners, model.change_copies
    species = model.species
    copies, partials, sums, blocks, spans = work.copies, work.partials, work.sums, work.blocks, work.spans
    affects_stop, table = stop.affects_stop, stop.table
    # Unsigned: indices need no check for negative ones.
    one, side, width, n_spans = np.uint64(1), np.uint64(BLOCK), np.uint64(sums.size), np.uint64(spans.size)
    t, passed, n_events, age = clock[0], seen[0], 0, work.age[0]
    is_frozen = is_over = False
    chosen = np.uint64(0)
    outcome = UNFINISHED
    for draw in range(waits.size):
        if age == REFRESH:
            refresh(model, work)
            age = 0
        age += 1
        total = 0.0
        for i in range(n_spans):
            total += spans[i]
        wait = np.inf if is_frozen else waits[draw]
        t, passed, outcome = move_on(t, wait, total, clock, counts, grid, passed, out)
        if outcome != UNFINISHED:
            break

        # The owner, from spans of 64 to blocks of 8 to single owners, by the uniform share of the total bound.
        target = uniforms[draw] * total
        span = np.uint64(0)
        while span + one < n_spans and spans[span] <= target:
            target -= spans[span]
            span += one
        block = span * side
        last = block + side - one
        while block < last and blocks[block] <= target:
            target -= blocks[block]
            block += one
        owner = block * side
        last = owner + side - one
        while owner < last and sums[owner] <= target:
            target -= sums[owner]
            owner += one
        # The channel: a walk over the exact partial propensities of the owner.
        share = target / copies[owner]
        chosen, end = np.uint64(owned_starts[owner]), np.uint64(owned_starts[owner + one])
        part = 0.0
        while chosen + side <= end:
            more = 0.0
            for k in range(BLOCK):
                r = chosen + np.uint64(k)
                more += coefficients[r] * copies[np.uint64(partners[r])]
            if part + more > share:
                break
            part += more
            chosen += side
        while chosen < end:
            part += coefficients[chosen] * copies[np.uint64(partners[chosen])]
            if part > share:
                break
            chosen += one
        # Thinning: the share lies in the margin between bound and true sum, so nothing happens. If the true total is
        # 0, only margins are left, and the run is frozen.
        if not part > share:
            is_frozen = refresh(model, work) == 0.0
            age = 0
            continue

        for k in range(np.uint64(change_starts[chosen]), np.uint64(change_starts[chosen + one])):
            s = np.uint64(change_owners[k])
            count = counts[np.uint64(species[s])] + change_copies[k]
            counts[np.uint64(species[s])] = count
            is_over |= count < 0
            copies[s] = count
            copies[width + s] = count - less[s] if count >= 2 else 0.0
            sums[s] = copies[s] * (partials[s] + like[s] * copies[width + s])
            block = s // side
            blocks[block] = eight(sums, block * side)
            spans[block // side] = eight(blocks, (block // side) * side)
            begin, end = np.uint64(reach[s, 0]), np.uint64(reach[s, 1])
            if begin == end:
                continue
            # L_i += C_is * change for every owner i coupled to the changed species, then the sums above it.
            gained = float(change_copies[k])
            for i in range(begin, end):
                partials[i] += couplings[s, i] * gained
                sums[i] = copies[i] * (partials[i] + like[i] * copies[width + i])
            first, last = begin // side, (end - one) // side
            for i in range(first, last + one):
                blocks[i] = eight(sums, i * side)
            for i in range(first // side, last // side + one):
                spans[i] = eight(blocks, i * side)
        if is_over:
            outcome = OVERFLOW
            break
        if times.size > 0:
            times[n_events] = t
            fired[n_events] = chosen
        n_events += 1
        if affects_stop[chosen] and holds(stop, table, counts):
            outcome = STOPPED
            break
    if is_over:  # the event has not been
        for k in range(np.uint64(change_starts[chosen]), np.uint64(change_starts[chosen + one])):
            counts[np.uint64(species[np.uint64(change_owners[k])])] -= change_copies[k]
    seen[0], seen[1] = passed, n_events
    clock[0], work.age[0] = t, age
    return outcome
