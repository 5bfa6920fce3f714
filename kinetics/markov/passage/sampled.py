"""One run of a Markov chain, jump by jump; or conditioned to end in a target."""

from __future__ import annotations

import numpy as np

from kinetics.markov.transient import Transitions
from kinetics.support.arrays import Floats, Ints, whole_number


def sampled_jumps(
    transitions: Transitions, row: int, end: float, seed: int, run: int = 0, chances: Floats | None = None
) -> tuple[Floats, Ints]:
    """Times (n,), tu, and places (n,) in `transitions` of the jumps of one run from state `row` until `end`.

    chances : (N,) probabilities of an outcome from each state. Only runs with this outcome are then drawn: the chain
        goes from x to y at its rate times chances(y) / chances(x) (Doob's h-transform).
    """
    sequence = np.random.SeedSequence(whole_number("seed", seed, 0), spawn_key=(whole_number("run", run, 0),))
    rng = np.random.default_rng(sequence)
    order = np.argsort(transitions.rows, kind="stable")
    begins = np.searchsorted(transitions.rows[order], np.arange(transitions.size + 1))
    now, times, entries = 0.0, [], []
    while True:
        able = order[begins[row] : begins[row + 1]]
        rates = transitions.rates[able]
        if chances is not None:
            rates = rates * (chances[transitions.columns[able]] / chances[row])
        ladder = np.cumsum(rates)
        if not ladder.size or ladder[-1] == 0.0:
            break
        now += rng.exponential() / ladder[-1]
        if now > end:
            break
        chosen = min(int(np.searchsorted(ladder, rng.random() * ladder[-1], side="right")), able.size - 1)
        times.append(now)
        entries.append(able[chosen])
        row = int(transitions.columns[able[chosen]])
    return np.array(times, dtype=np.float64), np.array(entries, dtype=np.int64)
