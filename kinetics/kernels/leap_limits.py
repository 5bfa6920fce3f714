"""Limits of an exact leap, and the search for its length; plain Python, so that `auto` needs no Numba."""

import math

MOST_EVENTS = 2.0**40  # of a leap
LARGEST_COUNT = 2**53  # up to which doubles are whole numbers
WIDE = 4.0  # standard deviations of the worst order of events that a box allows for
TRIALS = 16  # lengths of a leap that are tried


def next_length(length: float, longest: float, undecided: float, open_events: float) -> float:
    """The length to try after one that leaves so many events undecided; the same where it will do.

    open_events : how many are to be undecided; longest : no leap is longer
    """
    ratio = open_events / undecided if undecided > 0.0 else math.inf
    if 0.67 < ratio < 1.5:
        return length
    return min(length * min(max(math.sqrt(ratio), 0.125), 8.0), longest)
