"""The clock and the output grid: the step from one event to the next, shared by all exact methods."""

import numpy as np

from kinetics.kernels.compiled import compiled
from kinetics.kernels.outcomes import OVERFLOW, REACHED_END, STALLED_CLOCK, UNFINISHED

MOST_STILL = 1000.0  # events in a row that do not move the clock: it has stalled


@compiled(inline="always")
def stands_still(clock, t):
    """An event has left the clock at t: the outcome.

    clock : (3,) the time, events in a row that have not moved it, and the time at which those were. One wait below half
        a unit in the last place of the time is an event like any other: its time is right to rounding
    """
    clock[1] = clock[1] + 1.0 if clock[2] == t else 1.0
    clock[2] = t
    return STALLED_CLOCK if clock[1] >= MOST_STILL else UNFINISHED


@compiled(inline="always")
def next_time(t, wait, total, clock):
    """When the next event comes: the time, inf if none does, and the outcome.

    wait : a unit exponential; total : sum of the propensities, 1/tu. Gillespie (1977), eq. 21a: tau = wait / total
    clock : see `stands_still`; t is its time
    """
    if not total < np.inf:
        return t, OVERFLOW
    later = t + wait / total if total > 0.0 else np.inf
    return later, stands_still(clock, t) if later == t else UNFINISHED


@compiled(inline="always")
def record(counts, until, grid, passed, out):
    """Write the counts at all times of the grid before `until`; how many times the run has passed by then.

    counts : (S,) or longer; grid : (T,) tu; passed : as many of them were written before; out : (T, S)
    """
    while passed < grid.size and grid[passed] < until:
        for s in range(out.shape[1]):
            out[passed, s] = counts[s]
        passed += 1
    return passed


@compiled(inline="always")
def move_on(t, wait, total, clock, counts, grid, passed, out):
    """Go on to the next event, and write what the grid asks for on the way: the time, times passed, and the outcome.

    Arguments as of `next_time` and `record`. The time stays where the outcome is not UNFINISHED.
    """
    later, outcome = next_time(t, wait, total, clock)
    if outcome != UNFINISHED:
        return t, passed, outcome
    passed = record(counts, later, grid, passed, out)
    if passed == grid.size:
        return t, passed, REACHED_END
    return later, passed, UNFINISHED
