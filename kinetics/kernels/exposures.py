"""Events and exposures of every channel in runs of the direct method, without the counts on a grid."""

from typing import NamedTuple

import numpy as np

from kinetics.kernels.blocks import factored
from kinetics.kernels.compiled import compiled
from kinetics.kernels.direct import BUFFER, advance
from kinetics.kernels.ensemble_work import BEFORE, EVENTS, LOOK, RUN, EnsembleWork
from kinetics.kernels.members import member_at, start_naming
from kinetics.kernels.outcomes import REACHED_END, UNFINISHED
from kinetics.kernels.streams import start_stream


class Crowd(NamedTuple):
    """The factors of a crowd, see `network.Crowding`: those of `channels` (C,), coefficients (C, D)."""

    channels: np.ndarray
    weights: np.ndarray
    volumes: np.ndarray
    coefficients: np.ndarray


@compiled(inline="always")
def add_exposures(units, plain, has_general, crowd, counts, copies, wait, exposures):
    """Add to `exposures` (R,) what `wait` tu at `counts` (S + 1,) contribute.

    units : `sampling.mass_action.MassAction` for rate constants of 1
    plain : (R,) its coefficients, with 0 for channels by factors
    crowd : see `Crowd`; None without one
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
    if crowd is not None:
        surface, free = 0.0, 1.0
        for s in range(crowd.weights.size):
            surface += crowd.weights[s] * copies[s]
            free -= crowd.volumes[s] * copies[s]
        for c in range(crowd.channels.size):
            r, more = crowd.channels[c], 0.0
            for d in range(crowd.coefficients.shape[1] - 1, 0, -1):  # Horner's rule
                more = more * (surface / free) + crowd.coefficients[c, d]
            more = more / free + crowd.coefficients[c, 0] - 1.0
            if units.is_general[r]:
                exposures[r] += wait * more * factored(units.coefficients[r], units.factors, r, counts)
            else:
                pair = plain[r] * copies[first[r]] * (copies[second[r]] - less[r])
                exposures[r] += wait * more * pair


class ExposureWork(NamedTuple):
    """State of the runs between calls: `EnsembleWork`, then the stream and clock of exposures.

    naming (4,) uint64 : see `members.start_naming`; at (1,) : the time up to which exposures are added up
    """

    runs: EnsembleWork
    naming: np.ndarray
    at: np.ndarray


@compiled
def ensemble(model, members, units, crowd, changes, work, initial, end, key, first_run, events, exposures, most):
    """Events and exposures (runs, R) until `end`, tu; the runs are those of `direct.ensemble`, to the last bit.

    members : see `members.Members`; units, crowd : see `add_exposures`; work : see `ExposureWork`
    events, exposures : filled with 0 before the first call
    Other arguments and result as of `direct.ensemble`; exposures are integrals of ways * combinations, and of the
    factors of the crowd times these, tu.
    """
    n_species = initial.size
    counts, clock, stream, notes = work.runs.counts, work.runs.clock, work.runs.stream, work.runs.notes
    state, copies = counts.copy(), np.ones(n_species + 1)
    has_general = np.any(units.is_general)
    plain = np.where(units.is_general, 0.0, units.coefficients)
    naming = work.naming
    times = np.empty(BUFFER)
    chosen = np.empty(BUFFER, dtype=np.int64)
    while notes[RUN] < events.shape[0]:
        i = notes[RUN]
        if notes[EVENTS] == BEFORE:
            start_stream(key, first_run + i, stream)
            start_naming(key, first_run + i, naming)
            counts[:n_species] = initial
            clock[:] = 0.0
            work.at[0] = 0.0
            notes[EVENTS] = 0
        state[:] = counts
        copies[:n_species] = counts[:n_species]
        t = work.at[0]
        outcome = UNFINISHED
        while outcome == UNFINISHED:
            room = min(BUFFER, most, notes[LOOK] - notes[EVENTS])
            if room <= 0:
                work.at[0] = t
                return UNFINISHED
            outcome, n_events = advance(model, changes, counts, clock, end, stream, times[:room], chosen[:room], None)
            most -= n_events
            notes[EVENTS] += n_events
            for event in range(n_events):
                g = chosen[event]
                if model.thinning is not None and g == changes.shape[0]:
                    continue  # a candidate that was not kept
                wait = times[event] - t
                add_exposures(units, plain, has_general, crowd, state, copies, wait, exposures[i])
                t = times[event]
                events[i, member_at(members, g, copies, naming)] += 1
                for s in range(n_species):
                    state[s] += changes[g, s]
                    copies[s] = state[s]
        if outcome != REACHED_END:
            return outcome
        add_exposures(units, plain, has_general, crowd, state, copies, end - t, exposures[i])
        most -= 1
        notes[RUN], notes[EVENTS] = i + 1, BEFORE
    return REACHED_END
