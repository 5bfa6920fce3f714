"""Whether the counts of a run fulfil the condition at which it ends."""

import numpy as np

from kinetics.kernels.compiled import compiled
from kinetics.kernels.ensemble_work import HOLDS
from kinetics.kernels.programs import Programs, values


@compiled
def holds(stop, counts):
    """Whether the condition of a `Stop` holds at counts (S,) or more.

    Comparisons follow each other as in an evaluation of the text from left to right that ends where it is decided.
    """
    if stop.codes.size > 0:
        return program_holds(stop, counts)
    comparison = np.int64(0)
    while comparison >= 0:
        total = 0.0  # exact: weights are whole
        for k in range(stop.starts[comparison], stop.starts[comparison + 1]):
            total += stop.weights[k] * counts[stop.species[k]]
        is_inside = stop.low[comparison] <= total <= stop.high[comparison]
        comparison = stop.yes[comparison] if is_inside else stop.no[comparison]
    return comparison == HOLDS


@compiled
def program_holds(stop, counts):
    """Whether a condition that compares other things than sums holds. Slow: kept out of the common path."""
    starts, results = np.array([0, stop.codes.size]), np.empty(1)
    stack = np.empty((1, stop.codes.size + 1))
    programs = Programs(stop.codes, stop.operands, stop.numbers, starts)
    values(programs, np.zeros(1, np.int64), 0, 1, counts, 0.0, stack, results)
    return results[0] != 0.0
