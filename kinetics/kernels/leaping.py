"""Exact leaping: many events at once from a bounded Poisson process, refined by bisection where that does not decide.

While all counts stay in a box, the propensity of channel j lies between its values `low` and `high` at the corners.
Candidate events come at rate `high`, each with a mark, uniform below `high`; a candidate happens if its mark is below
the propensity at its time (thinning: Lewis & Shedler 1979, doi:10.1002/nav.3800260304). Those below `low` are sure,
whatever the others do; the others are open. A leap draws how many there are of both, and no times. If none are open
and no order of the events leaves the box, their sum is the change. Elsewhere the leap is cut into halves, and the
numbers with it; a half holds fewer events, so its box is smaller, and of its open events most are now sure or rejected.
A cell of one event is decided. The first event that leaves the box of the leap ends it at its time, a stopping time,
and all that was drawn beyond is dropped.

Every cell of this tree has random words of its own, keyed by the leap and the cell's place, so the tree can be followed
to a time of the output, or to all events, without another word being drawn differently.

If a leap would hold few events, the direct method draws the next `STRETCH` of them.
"""

import numpy as np

from kinetics.kernels.clock import record, stands_still
from kinetics.kernels.compiled import compiled
from kinetics.kernels.direct import advance
from kinetics.kernels.ensemble_work import BEFORE, EVENTS, LOOK, PASSED, RUN
from kinetics.kernels.leap_plan import CELL, DEEPEST, NO_CELL, STRETCHES, plan_leap, propensity
from kinetics.kernels.members import attribute_channels
from kinetics.kernels.outcomes import OVERFLOW, REACHED_END, STALLED_CLOCK, UNFINISHED
from kinetics.kernels.streams import start_stream
from kinetics.kernels.variates import binomial, draw_uniform, halved, poisson

OWN, LEFT, RIGHT = 0, 1, 2  # what is drawn for a cell, and its halves


@compiled
def worst_orders(laws, cells, top):
    """Set `cells.at_least` and `cells.at_most`, between which counts stay in whatever order a cell's events come.

    How many events there are, how many of them are open, and whether any order leaves the box of the leap.
    """
    n_species = cells.counts.size - 1
    at_least, at_most = cells.at_least, cells.at_most
    for s in range(n_species):
        at_least[s] = at_most[s] = cells.counts[s]
    n_events, n_open = 0, 0
    for r in range(cells.means.size):
        here = cells.sure[top, r] + cells.open[top, r]
        if here > 0:
            # Any order: only the falls may have come so far, or only the rises.
            n_events += here
            n_open += cells.open[top, r]
            for i in range(laws.starts[r], laws.starts[r + 1]):
                change = float(here) * laws.gains[i]
                if change > 0.0:
                    at_most[laws.species[i]] += change
                else:
                    at_least[laws.species[i]] += change
    can_leave = False
    for s in range(n_species):
        can_leave |= at_least[s] < cells.box_low[s] or at_most[s] > cells.box_high[s]
    return n_events, n_open, can_leave


@compiled
def thin(laws, cells, top, n_events, stream):
    """Decide what the narrower box of a cell decides: its open events become sure, or rejected, or stay open."""
    n_species = cells.counts.size - 1
    for s in range(n_species):
        if n_events == 1:  # it sees the counts as they are
            cells.at_least[s] = cells.at_most[s] = cells.counts[s]
        cells.at_least[s] = max(cells.at_least[s], cells.box_low[s])
        cells.at_most[s] = min(cells.at_most[s], cells.box_high[s])
    for r in range(cells.means.size):
        undecided = cells.open[top, r]
        if undecided > 0:
            low, high = cells.low[top, r], cells.high[top, r]
            new_low = min(max(propensity(laws, r, cells.at_least), low), high)
            new_high = min(max(propensity(laws, r, cells.at_most), new_low), high)
            # Marks are uniform from low to high.
            sure = binomial(undecided, (new_low - low) / (high - low), stream)
            # The rest have marks from new_low to high: those above new_high are rejected.
            undecided -= sure
            if undecided > 0 and new_high < high:
                undecided -= binomial(undecided, (high - new_high) / (high - new_low), stream)
            cells.sure[top, r] += sure
            cells.open[top, r] = undecided
            cells.low[top, r], cells.high[top, r] = new_low, new_high


@compiled
def halve(cells, top, stream):
    """Put the right half of a cell in its place, and the left half before it: every event falls into either."""
    for r in range(cells.means.size):
        sure, undecided = (
            halved(cells.sure[top, r], stream),
            halved(cells.open[top, r], stream),
        )
        cells.sure[top + 1, r], cells.open[top + 1, r] = sure, undecided
        cells.sure[top, r] -= sure
        cells.open[top, r] -= undecided
        cells.low[top + 1, r], cells.high[top + 1, r] = (cells.low[top, r], cells.high[top, r])
    middle = cells.begins[top] + 0.5 * (cells.ends[top] - cells.begins[top])
    cells.begins[top + 1], cells.ends[top + 1] = cells.begins[top], middle
    cells.begins[top] = middle
    start_stream(cells.keys[top], LEFT, cells.keys[top + 1])
    start_stream(cells.keys[top], RIGHT, cells.keys[top])


@compiled
def apply(laws, cells, top):
    """Change the counts by all sure events of a cell; the last channel that has any."""
    channel = 0
    for r in range(cells.means.size):
        many = cells.sure[top, r]
        if many > 0:
            channel = r
            for i in range(laws.starts[r], laws.starts[r + 1]):
                cells.counts[laws.species[i]] += many * laws.gains[i]
    return channel


@compiled
def is_outside(cells):
    """Whether the counts have left the box of the leap."""
    for s in range(cells.counts.size - 1):
        if cells.counts[s] < cells.box_low[s] or cells.counts[s] > cells.box_high[s]:
            return True
    return False


@compiled
def leap(laws, cells, lengths, of_leap, stream, clock, notes, grid, out, times, fired, number, most):
    """Go on with the leap at hand, or one that `plan_leap` has left, to its end or until so many cells were looked at.

    lengths, of_leap, stream, clock, notes : of `LeapWork`; what is not passed costs nothing
    grid, out, times, fired : of `go_on`; number : of events that were kept before

    Returns the outcome, and how many events were kept.
    """
    counts, keeps = cells.counts, times.size > 0
    if notes[CELL] == NO_CELL:  # draw its numbers of events
        later = clock[0] + lengths[2]
        lengths[0], lengths[1] = clock[0], later - clock[0] if later > clock[0] else lengths[2]
        start_stream(of_leap, OWN, stream)
        # Thinning: candidates come at the upper bound `high` of the propensity, as independent Poisson numbers of sure
        # events at rate `low` and open ones at rate high - low.
        for r in range(cells.means.size):
            cells.sure[0, r] = poisson(cells.low[0, r] * lengths[1], stream)
            cells.open[0, r] = poisson((cells.high[0, r] - cells.low[0, r]) * lengths[1], stream)
        cells.begins[0], cells.ends[0] = 0.0, lengths[1]
        start_stream(of_leap, LEFT, cells.keys[0])
        notes[CELL] = 0
    start, length = lengths[0], lengths[1]
    top, seen, looked, outcome, over = notes[CELL], notes[PASSED], 0, UNFINISHED, start + length
    while top >= 0 and looked < most:
        looked += 1
        begin, end = cells.begins[top], cells.ends[top]
        seen = record(counts, start + begin, grid, seen, out)
        if seen == grid.size:
            outcome = REACHED_END
            break
        # The numbers of a cell bound the counts within it, which decides more of its open events.
        n_events, n_open, can_leave = worst_orders(laws, cells, top)
        if n_events == 0:
            top -= 1
            continue
        start_stream(cells.keys[top], OWN, stream)
        if n_open > 0:
            thin(laws, cells, top, n_events, stream)
            n_events, n_open, can_leave = worst_orders(laws, cells, top)
        # Times are drawn only if events are kept, or if a time of the grid lies before the end of the cell.
        is_asked = keeps or grid[seen] < start + end
        # All decided and inside the box in any order: the sum of the events is the change.
        if n_open == 0 and not (can_leave or is_asked):
            apply(laws, cells, top)
            top -= 1
        # A single decided event: its time is uniform in its cell. If it leaves the box, the leap ends there.
        elif n_events == 1 and n_open == 0:
            time = start + min(begin + draw_uniform(stream) * (end - begin), end)
            seen = record(counts, time, grid, seen, out)
            if seen == grid.size:
                outcome = REACHED_END
                break
            channel = apply(laws, cells, top)
            leaves = can_leave and is_outside(cells)
            if leaves and counts.min() < 0:  # it came around
                for i in range(laws.starts[channel], laws.starts[channel + 1]):
                    counts[laws.species[i]] -= laws.gains[i]
                clock[0], outcome = time, OVERFLOW
                break
            if keeps:
                times[number], fired[number] = time, channel
                number += 1
            if leaves:
                top, over = NO_CELL, time
                break
            top -= 1
        # Still open: bisect the cell in time. Two events at one time to the last bit would never part.
        elif n_events > 0:
            if top + 2 == DEEPEST:
                outcome = STALLED_CLOCK
                break
            halve(cells, top, stream)
            top += 1
    notes[CELL], notes[PASSED] = top, seen
    notes[EVENTS] += looked
    if top == NO_CELL and outcome == UNFINISHED:  # it is over
        clock[0] = over
        if not over > start:
            outcome = stands_still(clock, over)
    return outcome, number


@compiled
def begin_run(work, initial, key, run, look):
    """Put a run at its start; it is first looked at after so many events."""
    for s in range(initial.size):  # an assignment to a slice costs more than such a loop
        work.cells.counts[s] = initial[s]
    work.clock[0] = work.clock[1] = work.clock[2] = work.lengths[2] = 0.0
    start_stream(key, run, work.of_run)
    notes = work.notes
    notes[PASSED] = notes[EVENTS] = notes[STRETCHES] = 0
    notes[LOOK], notes[CELL] = look, NO_CELL


@compiled
def go_on(model, work, grid, out, times, fired, most):
    """Go on with the run at hand until about so many events and cells were drawn, or to its next look between leaps.

    grid, out : see `clock.record`
    times, fired : receive all events of this call; (most + STRETCH + 1,), or (0,) if none are asked for

    Returns the outcome, and how many events were kept.
    """
    laws, cells, clock, stream, notes = model.laws, work.cells, work.clock, work.stream, work.notes
    counts, lengths, of_leap, state = cells.counts, work.lengths, work.of_leap, work.state
    step_times, stepped, keeps = work.step_times, work.fired, times.size > 0
    n_species, number = counts.size - 1, 0
    last, outcome = notes[EVENTS] + most, UNFINISHED
    if notes[PASSED] >= grid.size:
        return REACHED_END, number
    while outcome == UNFINISHED:
        if notes[EVENTS] >= (last if notes[CELL] != NO_CELL else min(last, notes[LOOK])):
            break
        is_leap = notes[CELL] != NO_CELL
        if not is_leap:
            start_stream(work.of_run, notes[STRETCHES], of_leap)
            notes[STRETCHES] += 1
            if notes[STRETCHES] > 1 or model.fewest == 0.0:  # a run may be short
                lengths[2], expected = plan_leap(model, cells, lengths[2])
                is_leap = expected > 0.0
        # A leap; or else a stretch of single events by the direct method, if a leap would hold few.
        if is_leap:
            room = max(last - notes[EVENTS], 1)
            outcome, number = leap(
                laws, cells, lengths, of_leap, stream, clock, notes, grid, out, times, fired, number, room
            )
            continue
        start_stream(of_leap, OWN, stream)
        for s in range(n_species):
            state[s] = counts[s]
        outcome, n_events = advance(
            model.merged, model.changes, counts, clock, grid[-1], stream, step_times, stepped, None
        )
        notes[EVENTS] += n_events + 1
        if keeps:
            times[number : number + n_events] = step_times[:n_events]
            fired[number : number + n_events] = stepped[:n_events]
            start_stream(of_leap, LEFT, stream)
            attribute_channels(
                model.members,
                model.changes,
                state.copy(),
                fired[number : number + n_events],
                stream,
            )
            number += n_events
        for event in range(n_events):
            notes[PASSED] = record(state, step_times[event], grid, notes[PASSED], out)
            for s in range(n_species):
                state[s] += model.changes[stepped[event], s]
    if outcome == REACHED_END:
        for i in range(notes[PASSED], grid.size):
            for s in range(n_species):
                out[i, s] = counts[s]
    return outcome, number


@compiled
def ensemble(model, work, initial, grid, key, first_run, limits, out, most):
    """Counts of many runs on a grid of times: arguments and result as of `direct.ensemble`."""
    notes, nowhere, nothing = work.notes, np.empty(0), np.empty(0, np.int64)
    while notes[RUN] < out.shape[0]:
        i = notes[RUN]
        if notes[EVENTS] == BEFORE:
            begin_run(work, initial, key, first_run + i, limits[3])
        drawn = notes[EVENTS]
        n_times = limits[0] if i < limits[2] else limits[1]
        outcome, _ = go_on(model, work, grid[:n_times], out[i], nowhere, nothing, most)
        if outcome != REACHED_END:
            return outcome
        most -= notes[EVENTS] - drawn + 1
        notes[RUN], notes[EVENTS] = i + 1, BEFORE
    return REACHED_END
