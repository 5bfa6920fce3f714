"""Whether the counts of a run fulfil the condition at which it ends."""

import numpy as np

from kinetics.kernels.compiled import compiled
from kinetics.kernels.ensemble_work import FAILS, HOLDS
from kinetics.kernels.programs import Programs, values


@compiled
def holds(stop, table, counts):
    """Whether the condition of a `Stop`, which has this table, holds at counts (S,) or more.

    Comparisons follow each other as in an evaluation of the text from left to right that ends where it is decided.
    """
    place = np.int64(0)
    if table.size == 0:
        place = np.int64(HOLDS if program_holds(stop, counts) else FAILS)
    while place >= 0:
        total = 0.0  # exact: weights are whole
        term, end = place + 5, place + 5 + 2 * np.int64(table[place + 4])
        while term < end:
            total += table[term + 1] * counts[np.int64(table[term])]
            term += 2
        is_inside = table[place] <= total <= table[place + 1]
        place = np.int64(table[place + 2] if is_inside else table[place + 3])
    return place == HOLDS


@compiled
def program_holds(stop, counts):
    """Whether a condition that compares other things than sums holds. Slow: kept out of the common path."""
    starts, results = np.array([0, stop.codes.size]), np.empty(1)
    stack = np.empty((1, stop.codes.size + 1))
    programs = Programs(stop.codes, stop.operands, stop.numbers, starts)
    values(programs, np.zeros(1, np.int64), 0, 1, counts, 0.0, stack, results)
    return results[0] != 0.0
