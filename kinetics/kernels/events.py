"""Events: when their conditions turn true, and what they then do. The arguments are those of `general`."""

import numpy as np

from kinetics.kernels.compiled import compiled
from kinetics.kernels.intervals import ranges
from kinetics.kernels.outcomes import BAD_COUNT, ENDLESS, REACHED_END
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
    """Let all events happen whose condition has turned true, and those that these set off in turn."""
    for _ in range(MOST_EVENTS):
        values(model.programs, model.conditions, 0, model.conditions.size, counts, t, work.stack, work.results)
        due = -1
        for event in range(model.conditions.size):
            is_true = work.results[model.conditions[event]] != 0.0
            if is_true and not work.is_true[event] and not work.is_due[event]:
                work.is_due[event] = True
                if model.from_trigger[event]:
                    hold(model, work, counts, event, t)
            work.is_true[event] = is_true
            if work.is_due[event] and due < 0:
                due = event
        if due < 0:
            return REACHED_END
        if not model.from_trigger[due]:
            hold(model, work, counts, due, t)
        work.is_due[due] = False
        for a in range(model.assign_starts[due], model.assign_starts[due + 1]):
            new = work.held[a]
            if not (0.0 <= new <= LARGEST_COUNT and new == np.floor(new)):
                work.notes[1] = a
                return BAD_COUNT
        for a in range(model.assign_starts[due], model.assign_starts[due + 1]):
            counts[model.assigned[a]] = np.int64(work.held[a])
    work.notes[1] = due
    return ENDLESS


@compiled
def hold(model, work, counts, event, t):
    """Note the new counts of an event as they follow from the counts now."""
    begin, end = model.assign_starts[event], model.assign_starts[event + 1]
    values(model.programs, model.new_counts, begin, end, counts, t, work.stack, work.results)
    for a in range(begin, end):
        work.held[a] = work.results[model.new_counts[a]]
