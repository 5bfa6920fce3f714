"""Events: when their conditions turn true, and what they then do. The arguments are those of `general`.

What is due now or later waits in a calendar: moments, owners (their events) and planned new counts.
"""

import numpy as np

from kinetics.kernels.compiled import compiled
from kinetics.kernels.intervals import ranges
from kinetics.kernels.outcomes import BAD_COUNT, BAD_DELAY, CROWDED, ENDLESS, REACHED_END
from kinetics.kernels.programs import values

MOST_STEPS = 20_000  # to find when a condition turns
MOST_EVENTS = 10_000  # at one moment
LARGEST_COUNT = 2.0**53  # that an event may set: beyond it doubles skip whole numbers


@compiled
def next_turn(model, work, counts, event, since, until):
    """First moment after `since` at which a condition is not what it was; inf: not by `until`, nan: undecided."""
    p, was_true = model.conditions[event], work.is_true[event]
    left, width = since, until - since
    for _ in range(MOST_STEPS):
        if left >= until:
            return np.inf
        tick = np.nextafter(left, np.inf)
        right = max(min(left + width, until), tick)
        ranges(
            model.programs, model.conditions, event, event + 1, counts, left, right, work.stack, work.lows, work.highs
        )
        if (was_true and work.lows[p] == 1.0) or (not was_true and work.highs[p] == 0.0):
            left = right
            width *= 2.0
        elif right > tick:
            width = 0.5 * (right - left)
        else:
            values(model.programs, model.conditions, event, event + 1, counts, right, work.stack, work.results)
            if (work.results[p] != 0.0) != was_true:
                return right
            left = right
    return np.nan


@compiled
def has_turned(model, work, counts, t):
    """Whether any condition is not what it was."""
    values(model.programs, model.conditions, 0, model.conditions.size, counts, t, work.stack, work.results)
    for event in range(model.conditions.size):
        if (work.results[model.conditions[event]] != 0.0) != work.is_true[event]:
            return True
    return False


@compiled
def happen(model, work, counts, t):
    """Plan all events whose condition has turned true, let those happen that are due, and those that these set off."""
    place = -1
    for _ in range(MOST_EVENTS):
        values(model.programs, model.conditions, 0, model.conditions.size, counts, t, work.stack, work.results)
        for event in range(model.conditions.size):
            is_true = work.results[model.conditions[event]] != 0.0
            if is_true and not work.is_true[event]:
                outcome = plan(model, work, counts, event, t)
                if outcome != REACHED_END:
                    return outcome
            elif not (is_true or model.is_persistent[event]):
                drop(work, event)
            work.is_true[event] = is_true
        place = first_due(work, t)
        if place < 0:
            return REACHED_END
        due = work.owners[place]
        begin, end = model.assign_starts[due], model.assign_starts[due + 1]
        if model.from_trigger[due]:
            work.held[begin:end] = work.planned[place, : end - begin]
        else:
            hold(model, work, counts, due, t)
        remove(work, place)
        work.notes[1] = due
        for a in range(begin, end):
            new = work.held[a]
            if not (0.0 <= new <= LARGEST_COUNT and new == np.floor(new)):
                work.notes[1] = a
                return BAD_COUNT
        for a in range(begin, end):
            counts[model.assigned[a]] = np.int64(work.held[a])
    return ENDLESS


@compiled
def plan(model, work, counts, event, t):
    """Note in the calendar when an event is due, and its new counts where they follow from those now."""
    values(model.programs, model.delays, event, event + 1, counts, t, work.stack, work.results)
    delay, n = work.results[model.delays[event]], work.notes[2]
    work.notes[1] = event
    if not 0.0 <= delay < np.inf:
        return BAD_DELAY
    if n == work.moments.size:
        return CROWDED
    work.moments[n], work.owners[n] = t + delay, event
    if model.from_trigger[event]:
        hold(model, work, counts, event, t)
        begin, end = model.assign_starts[event], model.assign_starts[event + 1]
        work.planned[n, : end - begin] = work.held[begin:end]
    work.notes[2] = n + 1
    return REACHED_END


@compiled
def next_due(work):
    """The next moment of the calendar; inf if it is empty."""
    moment = np.inf
    for place in range(work.notes[2]):
        moment = min(moment, work.moments[place])
    return moment


@compiled
def first_due(work, t):
    """The place in the calendar of the first event due, by priority and order; -1 if none is."""
    found = -1
    for place in range(work.notes[2]):
        if work.moments[place] <= t and (found < 0 or work.owners[place] < work.owners[found]):
            found = place
    return found


@compiled
def drop(work, event):
    """Remove an event from the calendar."""
    for place in range(work.notes[2] - 1, -1, -1):
        if work.owners[place] == event:
            remove(work, place)


@compiled
def remove(work, place):
    """Take one entry out of the calendar; the others keep their order."""
    last = work.notes[2] - 1
    for other in range(place, last):
        work.moments[other], work.owners[other] = work.moments[other + 1], work.owners[other + 1]
        work.planned[other] = work.planned[other + 1]
    work.notes[2] = last


@compiled
def hold(model, work, counts, event, t):
    """Note the new counts of an event as they follow from the counts now."""
    begin, end = model.assign_starts[event], model.assign_starts[event + 1]
    values(model.programs, model.new_counts, begin, end, counts, t, work.stack, work.results)
    for a in range(begin, end):
        work.held[a] = work.results[model.new_counts[a]]
