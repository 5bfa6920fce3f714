"""Runs under any rate law, by thinning, with events.

Laws, conditions and new counts are programs of one stack machine, see `laws.program`. It runs them at a moment
(`values`) or over a stretch of time with the counts fixed (`ranges`): interval arithmetic rounded outwards, so that
what it encloses is enclosed for certain.

Where laws depend on the time, candidates come at the rate of an upper bound that holds until the end of a window, and
each is kept with the probability that the propensity at its moment has of that bound (Lewis & Shedler 1979; Ogata
1981). This is exact for any bound. A window is as long as wastes about one candidate; it depends on the run's past
alone. Without such laws all is the direct method, with the sums of `kernels.ssa`: the runs are the same to the last
bit. A step uses one of `waits` (unit exponentials) and one of `uniforms`.
"""

import math
from typing import NamedTuple

import numpy as np
from numba import njit

# Outcomes of a run, the first four as in `kernels.ssa`
REACHED_END = 0
DRAWS_USED = 1
STALLED_CLOCK = 2
OVERFLOW = 3
BAD_LAW = 4  # a propensity below 0, infinite or undefined; of which channel, see `Work.notes`
UNBOUNDED = 5  # no bound of a channel's law over any window
BROKEN_BOUND = 6  # an error in this file
BAD_COUNT = 7  # an event's new count is no whole number of at least 0; which assignment
UNDECIDED = 8  # when a condition turns true cannot be told; of which event
ENDLESS = 9  # events of one moment set each other off; one of them

BLOCK = 8  # as in `kernels.ssa`
MOST_STEPS = 20_000  # to find when a condition turns
MOST_EVENTS = 10_000  # at one moment
LONGEST = 2.0**80  # window, tu
LARGEST_ANGLE = 1e7  # beyond it, rounding takes too much of an angle
LARGEST_COUNT = 2.0**53  # that an event may set: beyond it doubles skip whole numbers
TINY = 5e-324

# As in `laws.program.Code`
CONSTANT, COUNT, CLOCK, TIMES, GUARD, REFUSE, ADD, SUBTRACT, MULTIPLY, DIVIDE, MODULO, POWER = range(12)
LESS, LESS_EQUAL, EQUAL, NOT_EQUAL, AND, OR, MINIMUM, MAXIMUM = range(12, 20)
NEGATE, NOT, EXP, LOG, SQRT, ABSOLUTE, SINE, COSINE, FLOOR, CEILING, SELECT = range(20, 31)


class Programs(NamedTuple):
    """Programs one after the other: those of R channels, E conditions, A new counts.

    codes, operands (n,) int32, numbers (n,) : of each step, see `laws.program.Code`
    starts (R + E + A + 1,) : program p has the steps starts[p] to starts[p + 1]
    """

    codes: np.ndarray
    operands: np.ndarray
    numbers: np.ndarray
    starts: np.ndarray


class Model(NamedTuple):
    """A network as `advance` reads it; events in the order in which they act.

    programs : see `Programs`
    change_starts (R + 1,), changed, copies (n,) : species and copies gained by each channel
    steady, timed (n,) : channels whose law does not depend on the time, and those whose law does
    reader_starts (R + 1,), readers (n,) : steady channels whose propensity a firing changes, rising
    is_reopening, is_waking (R,) bool : a firing changes what a timed law or condition reads; what any condition reads
    conditions (E,), new_counts (A,) : their programs
    clocked (n,) : events whose condition depends on the time
    was_true, from_trigger (E,) bool : see `laws.events.Event`
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
    clocked: np.ndarray
    was_true: np.ndarray
    from_trigger: np.ndarray
    assign_starts: np.ndarray
    assigned: np.ndarray


class Work(NamedTuple):
    """What one run keeps between calls.

    results (P,) : of every program; the first R are the propensities
    lows, highs (P,) : of ranges; the first R highs are the bounds of timed laws, and what steady ones are
    sums, caps, upto (B,) : of blocks of propensities, of bounds, and running
    stack (2, depth)
    is_true, is_due (E,) bool, held (A,) : conditions, events whose moment has come, their new counts
    window (3,) : its end, the length of the next one, sum of the bounds in it
    notes (2,) int64 : whether the run has begun; what an outcome speaks of
    """

    results: np.ndarray
    lows: np.ndarray
    highs: np.ndarray
    sums: np.ndarray
    caps: np.ndarray
    upto: np.ndarray
    stack: np.ndarray
    is_true: np.ndarray
    is_due: np.ndarray
    held: np.ndarray
    window: np.ndarray
    notes: np.ndarray


@njit(cache=True, nogil=True, error_model="numpy")
def of_one(code, x):
    """A function of one number."""
    if code == NEGATE:
        return -x
    if code == NOT:
        return 1.0 if x == 0.0 else 0.0
    if code == EXP:
        return np.exp(x)
    if code == LOG:
        return np.log(x)
    if code == SQRT:
        return np.sqrt(x)
    if code == ABSOLUTE:
        return abs(x)
    if code == SINE:
        return np.sin(x)
    if code == COSINE:
        return np.cos(x)
    return np.floor(x) if code == FLOOR else np.ceil(x)


@njit(cache=True, nogil=True, error_model="numpy")
def of_two(code, x, y):
    """A function of two numbers; what is undefined stays so in the smaller and the larger of two."""
    if code == ADD:
        return x + y
    if code == SUBTRACT:
        return x - y
    if code == MULTIPLY:
        return x * y
    if code == DIVIDE:
        return x / y
    if code == MODULO:
        return np.mod(x, y)
    if code == POWER:
        return np.power(x, y)
    if code == MINIMUM:
        return x if x < y or np.isnan(x) else y
    if code == MAXIMUM:
        return x if x > y or np.isnan(x) else y
    if code == LESS:
        holds = x < y
    elif code == LESS_EQUAL:
        holds = x <= y
    elif code == EQUAL:
        holds = x == y
    elif code == NOT_EQUAL:
        holds = x != y
    elif code == AND:
        holds = x != 0.0 and y != 0.0
    else:
        holds = x != 0.0 or y != 0.0
    return 1.0 if holds else 0.0


@njit(cache=True, nogil=True, error_model="numpy")
def values(programs, which, begin, end, counts, t, stack, results):
    """Write the results of the programs which[begin:end] at a moment."""
    codes, operands, numbers, starts = programs.codes, programs.operands, programs.numbers, programs.starts
    for i in range(begin, end):
        p = which[i]
        top = 0.0  # the last number of the stack; the others wait in stack[0]
        height = 0
        for step in range(starts[p], starts[p + 1]):
            code = codes[step]
            if code == TIMES:
                top *= counts[operands[step]] - numbers[step]
            elif code <= CLOCK:
                stack[0, height] = top
                height += 1
                top = t if code == CLOCK else numbers[step]
                if code == COUNT:
                    top = float(counts[operands[step]])
            elif code == GUARD:
                if counts[operands[step]] < numbers[step]:
                    top = 0.0
                    break
            elif code == REFUSE:
                if top > 0.0 and counts[operands[step]] < numbers[step]:
                    top = np.nan
            elif code == SELECT:
                height -= 2
                if stack[0, height + 1] != 0.0:
                    top = stack[0, height]
            elif code >= NEGATE:
                top = of_one(code, top)
            else:
                height -= 1
                top = of_two(code, stack[0, height], top)
        results[p] = top


@njit(cache=True, nogil=True, error_model="numpy")
def wider(low, high, ulps):
    """The interval, larger by some units in the last place on both sides; all numbers where it is undefined."""
    if np.isnan(low) or np.isnan(high):
        return -np.inf, np.inf
    if abs(low) < np.inf:
        low -= abs(low) * (ulps * 2.0**-52) + TINY
    if abs(high) < np.inf:
        high += abs(high) * (ulps * 2.0**-52) + TINY
    return low, high


@njit(cache=True, nogil=True, error_model="numpy")
def hull(a, b, c, d):
    """The smallest interval that holds four numbers; undefined where one is not finite."""
    odd = 0.0 * (a + b + c + d)
    return min(a, b, c, d) + odd, max(a, b, c, d) + odd


@njit(cache=True, nogil=True, error_model="numpy")
def range_of_wave(code, low, high):
    """Sines or cosines of an interval."""
    if high - low >= 2.0 * math.pi or max(-low, high) > LARGEST_ANGLE:
        return -1.0, 1.0
    one, other = of_one(code, low), of_one(code, high)
    least, most = min(one, other), max(one, other)
    peak = 0.5 * math.pi if code == SINE else 0.0
    valley = peak + math.pi
    # Where rounding moves a peak just out of the interval, the ends are as high as it within what `wider` adds.
    if peak + 2.0 * math.pi * np.ceil((low - peak) / (2.0 * math.pi)) <= high:
        most = 1.0
    if valley + 2.0 * math.pi * np.ceil((low - valley) / (2.0 * math.pi)) <= high:
        least = -1.0
    return wider(least, most, 8.0)


@njit(cache=True, nogil=True, error_model="numpy")
def range_of_one(code, low, high):
    """A function of the numbers between two. Single numbers stay single: what the machine finds there."""
    if low == high:
        value = of_one(code, low)
        return (-np.inf, np.inf) if np.isnan(value) else (value, value)
    if code == NEGATE:
        return -high, -low
    if code == NOT:
        return (1.0 if low == high == 0.0 else 0.0), (1.0 if low <= 0.0 <= high else 0.0)
    if code == ABSOLUTE:
        return max(low, -high, 0.0), max(-low, high)
    if code in (SINE, COSINE):
        return range_of_wave(code, low, high)
    if code in (LOG, SQRT) and low < 0.0:
        return -np.inf, np.inf
    least, most = of_one(code, low), of_one(code, high)  # these rise
    return (least, most) if code in (FLOOR, CEILING) else wider(least, most, 8.0)


@njit(cache=True, nogil=True, error_model="numpy")
def range_of_power(a, b, c, d):
    """x**y for x from a to b, y from c to d: monotonic in each, where x is not below 0 or y is one whole number."""
    if a >= 0.0:
        least, most = hull(np.power(a, c), np.power(a, d), np.power(b, c), np.power(b, d))
        return wider(least, most, 8.0)
    if c != d or c != np.floor(c) or (c < 0.0 <= b):
        return -np.inf, np.inf
    one, other = np.power(a, c), np.power(b, c)
    is_even = np.mod(c, 2.0) == 0.0
    return wider(0.0 if is_even and b > 0.0 and c > 0.0 else min(one, other), max(one, other), 8.0)


@njit(cache=True, nogil=True, error_model="numpy")
def range_of_two(code, a, b, c, d):
    """A function of x from a to b and y from c to d. Single numbers stay single: what the machine finds there."""
    if a == b and c == d:
        value = of_two(code, a, c)
        return (-np.inf, np.inf) if np.isnan(value) else (value, value)
    if code == ADD:
        return wider(a + c, b + d, 1.0)
    if code == SUBTRACT:
        return wider(a - d, b - c, 1.0)
    if code == MULTIPLY:
        least, most = hull(a * c, a * d, b * c, b * d)
        return wider(least, most, 1.0)
    if code == DIVIDE:
        if c <= 0.0 <= d:
            return -np.inf, np.inf
        least, most = hull(a / c, a / d, b / c, b / d)
        return wider(least, most, 1.0)
    if code == MODULO:
        if not (c > 0.0 and d < np.inf):
            return -np.inf, np.inf
        first, last = np.mod(a, c), np.mod(b, c)
        return (first, last) if c == d and b - a < 0.5 * c and first <= last else (0.0, d)
    if code == POWER:
        return range_of_power(a, b, c, d)
    if code == MINIMUM:
        return min(a, c), min(b, d)
    if code == MAXIMUM:
        return max(a, c), max(b, d)
    if code == LESS:
        return (1.0 if b < c else 0.0), (1.0 if a < d else 0.0)
    if code == LESS_EQUAL:
        return (1.0 if b <= c else 0.0), (1.0 if a <= d else 0.0)
    if code == EQUAL:
        return 0.0, (1.0 if a <= d and c <= b else 0.0)
    if code == NOT_EQUAL:
        return (1.0 if b < c or d < a else 0.0), 1.0
    return (min(a, c), min(b, d)) if code == AND else (max(a, c), max(b, d))


@njit(cache=True, nogil=True, error_model="numpy")
def ranges(programs, which, begin, end, counts, since, until, stack, lows, highs):
    """Write bounds of the results of the programs which[begin:end] at all moments of a stretch of time."""
    codes, operands, numbers, starts = programs.codes, programs.operands, programs.numbers, programs.starts
    for i in range(begin, end):
        p = which[i]
        low = high = 0.0  # the last interval of the stack, as in `values`
        height = 0
        for step in range(starts[p], starts[p + 1]):
            code = codes[step]
            if code <= CLOCK:
                stack[0, height], stack[1, height] = low, high
                height += 1
                if code == CLOCK:
                    low, high = since, until
                else:
                    low = numbers[step] if code == CONSTANT else float(counts[operands[step]])
                    high = low
            elif code == TIMES:
                factor = counts[operands[step]] - numbers[step]
                low, high = range_of_two(MULTIPLY, low, high, factor, factor)
            elif code == GUARD:
                if counts[operands[step]] < numbers[step]:
                    low = high = 0.0
                    break
            elif code == SELECT:
                height -= 2
                if stack[0, height + 1] == 1.0:
                    low, high = stack[0, height], stack[1, height]
                elif stack[1, height + 1] != 0.0:
                    low, high = min(low, stack[0, height]), max(high, stack[1, height])
            elif code >= NEGATE:
                low, high = range_of_one(code, low, high)
            elif code != REFUSE:  # which shows at a moment
                height -= 1
                low, high = range_of_two(code, stack[0, height], stack[1, height], low, high)
        lows[p], highs[p] = low, high


@njit(cache=True, nogil=True, error_model="numpy")
def add_up(which, begin, end, n_channels, numbers, sums):
    """Sums afresh of the blocks that hold the channels which[begin:end], rising, in the order of `kernels.ssa`."""
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


@njit(cache=True, nogil=True, error_model="numpy")
def first_bad(which, begin, end, results):
    """The first of the channels which[begin:end] whose propensity is none; -1 where all are well."""
    for i in range(begin, end):
        if not 0.0 <= results[which[i]] < np.inf:
            return which[i]
    return -1


@njit(cache=True, nogil=True, error_model="numpy")
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


@njit(cache=True, nogil=True, error_model="numpy")
def has_turned(model, work, counts, t):
    """Whether any condition is not what it was."""
    values(model.programs, model.conditions, 0, model.conditions.size, counts, t, work.stack, work.results)
    for event in range(model.conditions.size):
        if (work.results[model.conditions[event]] != 0.0) != work.is_true[event]:
            return True
    return False


@njit(cache=True, nogil=True, error_model="numpy")
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


@njit(cache=True, nogil=True, error_model="numpy")
def hold(model, work, counts, event, t):
    """Note the new counts of an event as they follow from the counts now."""
    begin, end = model.assign_starts[event], model.assign_starts[event + 1]
    values(model.programs, model.new_counts, begin, end, counts, t, work.stack, work.results)
    for a in range(begin, end):
        work.held[a] = work.results[model.new_counts[a]]


@njit(cache=True, nogil=True, error_model="numpy")
def open_window(model, work, counts, t):
    """Bounds of the timed laws until the end of a window, which is also where a condition turns."""
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
    return REACHED_END


@njit(cache=True, nogil=True, error_model="numpy")
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


@njit(cache=True, nogil=True, error_model="numpy")
def advance(model, work, counts, seen, clock, waits, uniforms, grid, out, times, fired):
    """Run one trajectory on until it has passed the last time of the grid, or until the draws are used up.

    Arguments and result as of `kernels.grouped.advance`.
    """
    n_channels, n_species, n_times, n_blocks = model.change_starts.size - 1, out.shape[1], grid.size, work.sums.size
    timed, readers, results, sums, upto = model.timed, model.readers, work.results, work.sums, work.upto
    is_timed, has_windows = timed.size > 0, timed.size + model.clocked.size > 0
    t = clock[0]
    passed, n_events = seen[0], 0
    outcome = REACHED_END  # here: nothing went wrong so far
    if work.notes[0] == 0:
        work.notes[0] = 1
        outcome = settle(model, work, counts, t)
    for draw in range(waits.size):
        if outcome != REACHED_END:
            break
        if is_timed:
            bound = work.window[2]
        else:
            bound = 0.0
            for block in range(n_blocks):
                bound += sums[block]
                upto[block] = bound
        if not bound < np.inf:
            outcome = OVERFLOW
            break
        later = t + waits[draw] / bound if bound > 0.0 else np.inf
        if later == t:
            outcome = STALLED_CLOCK
            break
        is_candidate = not has_windows or later < work.window[0]
        moment = later if is_candidate else work.window[0]
        while passed < n_times and grid[passed] < moment:
            for s in range(n_species):
                out[passed, s] = counts[s]
            passed += 1
        if passed == n_times:
            break
        t = moment
        if not is_candidate:
            is_turn = model.clocked.size > 0 and has_turned(model, work, counts, t)
            outcome = settle(model, work, counts, t) if is_turn else open_window(model, work, counts, t)
            continue

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
            if total > bound:
                outcome = BROKEN_BOUND
                break
        target = uniforms[draw] * bound
        if is_timed and target >= total:
            if (bound - total) * (work.window[0] - t) > 1.0:  # the propensities fell since the window was opened
                outcome = open_window(model, work, counts, t)
            continue
        block = 0
        while upto[block] <= target and upto[block] < total:
            block += 1
        if block > 0:
            target -= upto[block - 1]
        chosen = BLOCK * block
        part = results[chosen]
        while part <= target and part < sums[block]:
            chosen += 1
            part += results[chosen]

        is_over = False
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
    seen[0], seen[1] = passed, n_events
    clock[0] = t
    return DRAWS_USED if outcome == REACHED_END and passed < n_times else outcome
