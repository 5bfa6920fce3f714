"""The clock and the output grid: the step from one event to the next, shared by all exact methods."""

import numpy as np

from kinetics.kernels.compiled import compiled
from kinetics.kernels.outcomes import OVERFLOW, REACHED_END, STALLED_CLOCK, UNFINISHED

MOST_STILL = 1000.0  # events in a row that do not move the clock: it has stalled


@compiled(inline="always")
def next_time(t, still, wait, total):
    """When the next event comes: the time, inf where none does, events in a row without a step of it, the outcome.

    still : events in a row that have not moved the clock. One wait below half a unit in the last place of the time is
        an event like any other: its time is right to rounding
    wait : a unit exponential; total : sum of the propensities, 1/tu. Gillespie (1977), eq. 21a: tau = wait / total
    """
    if not total < np.inf:
        return t, still, OVERFLOW
    later = t + wait / total if total > 0.0 else np.inf
    still = still + 1.0 if later == t else 0.0
    return later, still, STALLED_CLOCK if still >= MOST_STILL else UNFINISHED


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
def move_on(t, still, wait, total, counts, grid, passed, out):
    """Go on to the next event, and write what the grid asks for on the way: the time, `still`, times passed, outcome.

    Arguments as of `next_time` and `record`. The time stays where the outcome is not UNFINISHED.
    """
    later, still, outcome = next_time(t, still, wait, total)
    if outcome != UNFINISHED:
        return t, still, passed, outcome
    passed = record(counts, later, grid, passed, out)
    if passed == grid.size:
        return t, still, passed, REACHED_END
    return later, still, passed, UNFINISHED
