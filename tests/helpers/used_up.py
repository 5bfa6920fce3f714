"""Runs whose own events end their exposure: sound runs, on which a test that takes exposure as given is wrong."""

import numpy as np
from doubtful_runs import break_network

from kinetics.runs import JumpPath


def used_up_run(rng, copies=1, end=2.0):
    """A run of B -> 2 A, k = 1 per tu, from `copies` of B: a pure death process, over when the last one is broken."""
    times = np.sort(rng.exponential(size=copies))
    times = times[times < end]
    return JumpPath(break_network(), [0, copies], times, np.zeros(times.size, int), end)
