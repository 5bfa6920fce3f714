"""Single runs of a chain, from a start that is drawn."""

from __future__ import annotations

import numpy as np

from kinetics.markov.answers import ChainPath
from kinetics.markov.passage.sampled import sampled_jumps
from kinetics.markov.transient import Transitions
from kinetics.support.arrays import Floats, whole_number


def drawn_path(
    chain: Transitions, start: Floats, end: float, seed: int, run: int, chances: Floats | None = None
) -> ChainPath:
    """One run until `end`, tu, or with `chances` (N,) until its last event; (seed, run) name it.

    chances : of reaching a target from each state, in a chain that is conditioned on doing so
    """
    key = (whole_number("run", run, 0), 1)  # the jumps have (run,)
    rng = np.random.default_rng(np.random.SeedSequence(whole_number("seed", seed, 0), spawn_key=key))
    begin = int(rng.choice(start.size, p=start))
    times, entries = sampled_jumps(chain, begin, end, seed, run, chances)
    last = float(times[-1]) if times.size else 0.0
    return ChainPath(np.append(0.0, times), np.append(begin, chain.columns[entries]), end if end < np.inf else last)
