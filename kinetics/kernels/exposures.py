"""Events and exposures of every channel in runs of the direct method, without the counts on a grid."""

import numpy as np

from kinetics.kernels.blocks import factored
from kinetics.kernels.compiled import compiled
from kinetics.kernels.direct import advance
from kinetics.kernels.members import member_at, start_naming
from kinetics.kernels.outcomes import REACHED_END, UNFINISHED
from kinetics.kernels.streams import start_stream


@compiled(inline="always")
def add_exposures(units, plain, has_general, counts, copies, wait, exposures):
    """Add to `exposures` (R,) what `wait` tu at `counts` (S + 1,) contribute.

    units : `sampling.mass_action.MassAction` for rate constants of 1
    plain : (R,) its coefficients, with 0 for channels by factors
    copies : the counts as floats
    """
    first, second, less = units.first, units.second, units.less
    for r in range(np.uint64(plain.size)):  # unsigned indices need no check for negative ones
        pair = plain[r] * copies[np.uint64(first[r])]
        exposures[r] += wait * (pair * (copies[np.uint64(second[r])] - less[r]))
    if has_general:
        for r in range(plain.size):
            if units.is_general[r]:
                exposures[r] += wait * factored(units.coefficients[r], units.factors, r, counts)


@compiled
def ensemble(model, members, units, changes, initial, end, key, first_run, events, exposures):
    """Events and exposures (runs, R) until `end`, tu; the runs are those of `direct.ensemble`, to the last bit.

    members : see `members.Members`; units : see `add_exposures`
    Other arguments and result as of `direct.ensemble`; exposures are integrals of ways * combinations, tu.
    """
    n_species = initial.size
    counts, state = np.ones(n_species + 1, dtype=np.int64), np.ones(n_species + 1, dtype=np.int64)
    copies = np.ones(n_species + 1)
    has_general = np.any(units.is_general)
    plain = np.where(units.is_general, 0.0, units.coefficients)
    clock = np.zeros(1)
    stream, naming = np.empty(4, dtype=np.uint64), np.empty(4, dtype=np.uint64)
    times = np.empty(1024)
    chosen = np.empty(1024, dtype=np.int64)
    events[:] = 0
    exposures[:] = 0.0
    for i in range(events.shape[0]):
        start_stream(key, first_run + i, stream)
        start_naming(key, first_run + i, naming)
        counts[:n_species] = initial
        state[:n_species] = initial
        copies[:n_species] = initial
        clock[0] = 0.0
        t = 0.0
        outcome = UNFINISHED
        while outcome == UNFINISHED:
            outcome, n_events = advance(model, changes, counts, clock, end, stream, times, chosen)
            for event in range(n_events):
                wait = times[event] - t
                add_exposures(units, plain, has_general, state, copies, wait, exposures[i])
                t = times[event]
                g = chosen[event]
                events[i, member_at(members, g, copies, naming)] += 1
                for s in range(n_species):
                    state[s] += changes[g, s]
                    copies[s] = state[s]
        if outcome != REACHED_END:
            return outcome, first_run + i
        add_exposures(units, plain, has_general, state, copies, end - t, exposures[i])
    return REACHED_END, first_run + events.shape[0] - 1
