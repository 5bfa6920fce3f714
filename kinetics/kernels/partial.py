"""The partial-propensity method (Ramaswamy et al. 2009, doi:10.1063/1.3154624): many channels among few species.

Each channel of at most two reactants is owned by one of them. Its propensity is the owner's count times a partial
propensity, which depends on the partner only, so that an event changes one row of a table for each species whose count
it changes, however many channels there are:

    sum over the channels of owner i = n_i (L_i + p_i),   L_i = u_i + sum_j C_ij n_j,   p_i = c_i (n_i - less_i)

with u_i the coefficients of channels of i alone, C_ij of pairs i, j and c_i of like pairs. Channels without a reactant
belong to an owner of their own, number S, of which there is always one copy.

L_i is carried from event to event, so it gathers rounding. It therefore starts a little too large, by more than all
that rounding could take away until it is next made afresh: it bounds the true value from above. The channel is then
found by a walk over the exact partial propensities of its owner; a walk that ends without one is an event at which
nothing happens (thinning), so rounding cannot let a channel fire that could not, nor bias the others.

A step uses one of `waits` (unit exponentials) and one of `uniforms`; see `streams.draw`.
"""

from typing import NamedTuple

import numpy as np

from kinetics.kernels.blocks import BLOCK, block_at
from kinetics.kernels.clock import move_on
from kinetics.kernels.compiled import compiled
from kinetics.kernels.outcomes import OVERFLOW, UNFINISHED

REFRESH = 1024  # steps after which L is made afresh
UNIT = 2.0**-53  # largest relative error of one rounding


class PartialModel(NamedTuple):
    """Owners are the species, then the one of channels without reactants; blocks are filled up with empty owners.

    couplings (S, W) : C_ij at [j, i], W owners with those that fill up the last block
    reach (S, 2) int64 : first and last + 1 of the owners i that are coupled to species j
    alone (W,) : u_i
    like (W,), less (W,) : c_i and less_i of like pairs, which need two copies
    owned_starts (W + 1,) : first channel of each owner; channels are in the order of their owners
    partners (R,) int64 : species j of a pair, S for the constant 1
    lessened (R,) int64 : 1 for a like pair that is counted as n (n - 1)
    needed (R,) int64 : copies of the partner below which the channel cannot fire
    coefficients (R,)
    change_starts (R + 1,), change_species, change_copies : what a channel changes
    largest_gain, most_changes : the most copies that one event adds of a species, and species that it changes
    """

    couplings: np.ndarray
    reach: np.ndarray
    alone: np.ndarray
    like: np.ndarray
    less: np.ndarray
    owned_starts: np.ndarray
    partners: np.ndarray
    lessened: np.ndarray
    needed: np.ndarray
    coefficients: np.ndarray
    change_starts: np.ndarray
    change_species: np.ndarray
    change_copies: np.ndarray
    largest_gain: float
    most_changes: int


class PartialWork(NamedTuple):
    """What one run keeps between calls.

    copies (W,) : counts of the owners as doubles
    partials (W,) : L, a bound from above
    sums (W,), upto (W / BLOCK,) : sums over the channels of an owner, and running over blocks of owners
    age (1,) : steps since L was made afresh
    """

    copies: np.ndarray
    partials: np.ndarray
    sums: np.ndarray
    upto: np.ndarray
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
        like = model.like[i] * (work.copies[i] - model.less[i]) if work.copies[i] >= 2.0 else 0.0
        total += work.copies[i] * (work.partials[i] + like)
        work.partials[i] += updates * UNIT * reached[i]
    work.age[0] = 0
    return total


@compiled
def advance(model, work, counts, seen, clock, waits, uniforms, grid, out, times, fired):
    """Run one trajectory on until it has passed the last time of the grid, or until the draws are used up.

    Arguments and result as of `kernels.grouped.advance`.
    """
    couplings, reach, like, less = model.couplings, model.reach, model.like, model.less
    partners, lessened, needed, coefficients = model.partners, model.lessened, model.needed, model.coefficients
    change_starts, change_species, change_copies = model.change_starts, model.change_species, model.change_copies
    copies, partials, sums, upto = work.copies, work.partials, work.sums, work.upto
    width, n_blocks = copies.size, upto.size
    t, passed, n_events, age = clock[0], seen[0], 0, work.age[0]
    is_frozen = False
    outcome = UNFINISHED
    for draw in range(waits.size):
        if age == REFRESH:
            refresh(model, work)
            age = 0
        age += 1
        for i in range(width):
            alike = like[i] * (copies[i] - less[i]) if copies[i] >= 2.0 else 0.0
            sums[i] = copies[i] * (partials[i] + alike)
        total = 0.0
        for block in range(n_blocks):
            i = BLOCK * block
            total += ((sums[i] + sums[i + 1]) + (sums[i + 2] + sums[i + 3])) + (
                (sums[i + 4] + sums[i + 5]) + (sums[i + 6] + sums[i + 7])
            )
            upto[block] = total
        t, passed, outcome = move_on(t, np.inf if is_frozen else waits[draw], total, counts, grid, passed, out)
        if outcome != UNFINISHED:
            break

        block, target = block_at(upto, uniforms[draw] * total, total)
        owner = BLOCK * block
        last = owner + BLOCK - 1
        while owner < last and sums[owner] <= target:
            target -= sums[owner]
            owner += 1
        share = target / copies[owner]
        chosen = model.owned_starts[owner]
        end = model.owned_starts[owner + 1]
        part = 0.0
        while chosen < end:
            others = counts[np.uint64(partners[chosen])]
            part += coefficients[chosen] * (others - lessened[chosen] if others >= needed[chosen] else 0)
            if part > share:
                break
            chosen += 1
        if not part > share:
            is_frozen = refresh(model, work) == 0.0
            age = 0
            continue

        is_over = False
        for k in range(change_starts[chosen], change_starts[chosen + 1]):
            s = change_species[k]
            counts[s] += change_copies[k]
            is_over |= counts[s] < 0
            copies[s] = counts[s]
            gained = float(change_copies[k])
            row = couplings[s]
            for i in range(np.uint64(reach[s, 0]), np.uint64(reach[s, 1])):
                partials[i] += row[i] * gained
        if is_over:
            outcome = OVERFLOW
            break
        if times.size > 0:
            times[n_events] = t
            fired[n_events] = chosen
        n_events += 1
    seen[0], seen[1] = passed, n_events
    clock[0], work.age[0] = t, age
    return outcome
