"""Runs under any rate law, with thinning where rates depend on time, and with events.

Rate laws, conditions and new counts are programs of one stack machine: `programs` runs them at a moment, `intervals`
over a stretch of time, which bounds them.

If rate laws depend on the time, candidates come at the rate of an upper bound that holds until the end of a window,
and each is kept with the probability that the propensity at its moment has of that bound (Lewis & Shedler 1979,
doi:10.1002/nav.3800260304; Ogata 1981 for bounds that depend on the past). This is exact for any bound. A window is so
long that about one candidate is wasted in it; its length depends on the run's past alone. Without such rate laws this
is the direct method with the sums of `blocks`, and its runs are the same to the last bit. A step uses one of `waits`
(unit exponentials) and one of `uniforms`, see `streams.draw`.
"""

from typing import NamedTuple

import numpy as np

from kinetics.kernels.blocks import BLOCK, channel_at
from kinetics.kernels.clock import next_time, record
from kinetics.kernels.compiled import compiled
from kinetics.kernels.events import first_due, happen, has_turned, next_due, next_turn
from kinetics.kernels.intervals import ranges
from kinetics.kernels.outcomes import (
    BAD_LAW,
    BROKEN_BOUND,
    OVERFLOW,
    REACHED_END,
    STALLED_CLOCK,
    STOPPED,
    UNBOUNDED,
    UNDECIDED,
    UNFINISHED,
)
from kinetics.kernels.programs import Programs, values
from kinetics.kernels.stopping import holds

LONGEST = 2.0**80  # window, tu


class GeneralModel(NamedTuple):
    """A network as `advance` reads it; events in the order in which they act.

    programs : see `Programs`
    change_starts (R + 1,), changed, copies (n,) : species and copies gained by each channel
    steady, timed (n,) : channels whose rate law does not depend on the time, and those whose does
    reader_starts (R + 1,), readers (n,) : steady channels whose propensity a firing changes, rising
    is_reopening, is_waking (R,) bool : a firing changes what a timed rate law or condition reads; what
        any condition reads
    conditions (E,), new_counts (A,), delays (E,) : their programs
    clocked (n,) : events whose condition depends on the time
    was_true, from_trigger, is_persistent, is_delayed (E,) bool : see `network.laws.events.Event`
    assign_starts (E + 1,), assigned (A,) : which counts each event sets
    """

    programs: Programs
    change_starts: np.ndarray
    changed: np.ndarray
    copies: np.ndarray
    steady: np.ndarray
    timed: np.ndarray
    reader_starts: np.ndarray
    readers: np.ndarray
    is_reopening: np.ndarray
    is_waking: np.ndarray
    conditions: np.ndarray
    new_counts: np.ndarray
    delays: np.ndarray
    clocked: np.ndarray
    was_true: np.ndarray
    from_trigger: np.ndarray
    is_persistent: np.ndarray
    is_delayed: np.ndarray
    assign_starts: np.ndarray
    assigned: np.ndarray


class GeneralWork(NamedTuple):
    """State of one run between calls.

    results (P,) : of every program; the first R are the propensities
    lows, highs (P,) : of ranges; the first R highs are the bounds of timed channels, and what steady ones are
    sums, caps, upto (B,) : of blocks of propensities, of bounds, and running
    stack (2, depth)
    is_true (E,) bool, held (A,) : conditions; new counts that are about to be set
    moments (Q,), owners (Q,) int64, planned (Q, W) : the calendar: when which events are due, and their new counts
    window (3,) : its end, the length of the next one, sum of the bounds in it
    notes (3,) int64 : 0 before the run begins, 2 if events may have set counts since its stop condition was read, else
        1; what an outcome speaks of; entries of the calendar
    """

    results: np.ndarray
    lows: np.ndarray
    highs: np.ndarray
    sums: np.ndarray
    caps: np.ndarray
    upto: np.ndarray
    stack: np.ndarray
    is_true: np.ndarray
    held: np.ndarray
    moments: np.ndarray
    owners: np.ndarray
    planned: np.ndarray
    window: np.ndarray
    notes: np.ndarray


@compiled
def add_up(which, begin, end, n_channels, numbers, sums):
    """Sums afresh of the blocks that hold the channels which[begin:end], rising, in the order of `blocks`."""
    last = -1
    for i in range(begin, end):
        block = which[i] // BLOCK
        if block == last:
            continue
        part = 0.0
        for r in range(BLOCK * block, min(BLOCK * (block + 1), n_channels)):
            part += numbers[r]
        sums[block] = part
        last = block


@compiled
def first_bad(which, begin, end, results):
    """The first of the channels which[begin:end] whose propensity is none; -1 if all are well."""
    for i in range(begin, end):
        if not 0.0 <= results[which[i]] < np.inf:
            return which[i]
    return -1


@compiled
def open_window(model, work, counts, t):
    """Bounds of the timed rate laws until the end of a window, also if a condition turns or an event is due."""
    timed, results, highs, window = model.timed, work.results, work.highs, work.window
    n_channels = model.change_starts.size - 1
    values(model.programs, timed, 0, timed.size, counts, t, work.stack, results)
    work.notes[1] = first_bad(timed, 0, timed.size, results)
    if work.notes[1] >= 0:
        return BAD_LAW
    length, is_shorter = window[1], False
    while True:
        if not t + length > t:
            return UNBOUNDED if work.notes[1] >= 0 else STALLED_CLOCK
        ranges(model.programs, timed, 0, timed.size, counts, t, t + length, work.stack, work.lows, highs)
        wasted = 0.0  # candidates, were the propensities to stay as they are
        for i in range(timed.size):
            r = timed[i]
            highs[r] = max(highs[r], 0.0)
            wasted += length * (highs[r] - results[r])
            if not highs[r] < np.inf:
                work.notes[1] = r
        if wasted <= 1.0:
            break
        length *= 0.5
        is_shorter = True
    window[0] = t + length
    window[1] = min(2.0 * length, LONGEST) if wasted < 0.25 and not is_shorter else length
    add_up(timed, 0, timed.size, n_channels, highs, work.caps)
    window[2] = 0.0
    for block in range(work.caps.size):
        window[2] += work.caps[block]
    for i in range(model.clocked.size):
        turn = next_turn(model, work, counts, model.clocked[i], t, window[0])
        if np.isnan(turn):
            work.notes[1] = model.clocked[i]
            return UNDECIDED
        window[0] = min(window[0], turn)
    window[0] = min(window[0], next_due(work))
    return REACHED_END


@compiled
def settle(model, work, counts, t):
    """Events, then all propensities and bounds afresh."""
    outcome = happen(model, work, counts, t)
    if outcome != REACHED_END:
        return outcome
    steady, n_channels = model.steady, model.change_starts.size - 1
    values(model.programs, steady, 0, steady.size, counts, t, work.stack, work.results)
    work.notes[1] = first_bad(steady, 0, steady.size, work.results)
    if work.notes[1] >= 0:
        return BAD_LAW
    work.highs[:n_channels] = work.results[:n_channels]
    add_up(steady, 0, steady.size, n_channels, work.results, work.sums)
    add_up(steady, 0, steady.size, n_channels, work.highs, work.caps)
    return open_window(model, work, counts, t)


@compiled
def advance(model, work, counts, seen, clock, waits, uniforms, grid, out, times, fired, stop):
    """Run one trajectory on until it has passed the last time of the grid, or until the draws are used up.

    Arguments and result as of `kernels.grouped.advance`.
    """
    n_channels, n_times, n_blocks = model.change_starts.size - 1, grid.size, work.sums.size
    timed, readers, results, sums, upto = model.timed, model.readers, work.results, work.sums, work.upto
    is_timed, has_windows = timed.size > 0, timed.size + model.clocked.size + np.sum(model.is_delayed) > 0
    affects_stop, table = stop.affects_stop, stop.table
    t = clock[0]
    passed, n_events = seen[0], 0
    is_over, chosen = False, 0
    outcome = REACHED_END  # here: nothing went wrong so far
    if work.notes[0] == 0:
        work.notes[0] = 2
        outcome = settle(model, work, counts, t)
    for draw in range(waits.size):
        if work.notes[0] == 2:  # events may have set counts
            work.notes[0] = 1
            if outcome == REACHED_END and holds(stop, table, counts):
                outcome = STOPPED
        if outcome != REACHED_END:
            break
        # A candidate at the rate of the bound: of the window for timed laws, else the total itself.
        if is_timed:
            bound = work.window[2]
        else:
            bound = 0.0
            for block in range(n_blocks):
                bound += sums[block]
                upto[block] = bound
        later, state = next_time(t, waits[draw], bound, clock)
        if state != UNFINISHED:
            outcome = state
            break
        # A candidate beyond the window is dropped, which the exponential forgets; the next window opens at its end.
        is_candidate = not has_windows or later < work.window[0]
        moment = later if is_candidate else work.window[0]
        passed = record(counts, moment, grid, passed, out)
        if passed == n_times:
            break
        t = moment
        if not is_candidate:
            is_turn = first_due(work, t) >= 0 or (model.clocked.size > 0 and has_turned(model, work, counts, t))
            outcome = settle(model, work, counts, t) if is_turn else open_window(model, work, counts, t)
            if is_turn:
                work.notes[0] = 2
            continue

        # Thinning (Lewis & Shedler 1979): the candidate is an event with probability total / bound.
        total = bound
        if is_timed:
            values(model.programs, timed, 0, timed.size, counts, t, work.stack, results)
            work.notes[1] = first_bad(timed, 0, timed.size, results)
            if work.notes[1] >= 0:
                outcome = BAD_LAW
                break
            add_up(timed, 0, timed.size, n_channels, results, sums)
            total = 0.0
            for block in range(n_blocks):
                total += sums[block]
                upto[block] = total
            # A bound that does not hold would bias the run: an error, never ignored.
            if total > bound:
                outcome = BROKEN_BOUND
                break
        target = uniforms[draw] * bound
        if is_timed and target >= total:
            if (bound - total) * (work.window[0] - t) > 1.0:  # the propensities fell since the window was opened
                outcome = open_window(model, work, counts, t)
            continue
        chosen = channel_at(results, sums, upto, target, total)

        for k in range(model.change_starts[chosen], model.change_starts[chosen + 1]):
            s = model.changed[k]
            counts[s] += model.copies[k]
            is_over |= counts[s] < 0
        if is_over:
            outcome = OVERFLOW
            break
        if times.size > 0:
            times[n_events] = t
            fired[n_events] = chosen
        n_events += 1
        if affects_stop[chosen] and not model.is_waking[chosen] and holds(stop, table, counts):
            outcome = STOPPED
            break
        # Renew the laws that read a changed count, and their bounds: steady ones bound themselves.
        first, last = model.reader_starts[chosen], model.reader_starts[chosen + 1]
        values(model.programs, readers, first, last, counts, t, work.stack, results)
        work.notes[1] = first_bad(readers, first, last, results)
        if work.notes[1] >= 0:
            outcome = BAD_LAW
            break
        add_up(readers, first, last, n_channels, results, sums)
        if is_timed and last > first:
            for i in range(first, last):
                work.highs[readers[i]] = results[readers[i]]
            add_up(readers, first, last, n_channels, work.highs, work.caps)
            work.window[2] = 0.0
            for block in range(n_blocks):
                work.window[2] += work.caps[block]
        if model.is_waking[chosen] and has_turned(model, work, counts, t):
            outcome = settle(model, work, counts, t)
        elif model.is_reopening[chosen]:
            outcome = open_window(model, work, counts, t)
        if model.is_waking[chosen]:
            work.notes[0] = 2  # after the events that this firing has set off
    if is_over:  # the event has not been
        for k in range(model.change_starts[chosen], model.change_starts[chosen + 1]):
            counts[model.changed[k]] -= model.copies[k]
    seen[0], seen[1] = passed, n_events
    clock[0] = t
    return UNFINISHED if outcome == REACHED_END and passed < n_times else outcome
