"""Single runs of a chain: as they come, or only those that reach a target."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from kinetics.markov.chain import Chain, Target
from kinetics.markov.passage.sampled import sampled_jumps
from kinetics.markov.transient import Transitions
from kinetics.markov.transient_means import one_time
from kinetics.support.arrays import Floats, Ints, whole_number


@dataclass(frozen=True, eq=False)
class ChainPath:
    """One run of a chain: its states (n + 1,) and the times (n + 1,), tu, at which it enters them; then until `end`.

    >>> from kinetics import Chain
    >>> from kinetics.markov import chain_path
    >>> path = chain_path(Chain([[0.0, 1.0], [0.0, 0.0]], initial=0), end=1e3, seed=1)
    >>> path.states.tolist(), path.at([0.0, 1e3]).tolist()
    ([0, 1], [0, 1])
    """

    times: Floats
    states: Ints
    end: float

    def at(self, times: ArrayLike) -> Ints:
        """The states (...) at `times` (...), tu."""
        asked = np.asarray(times, dtype=float)
        if asked.size and not (asked.min() >= 0.0 and asked.max() <= self.end):
            raise ValueError(f"times from {asked.min():g} to {asked.max():g} tu; the run is from 0 to {self.end:g} tu")
        return self.states[np.searchsorted(self.times, asked, side="right") - 1]


def chain_path(chain: Chain, end: float, seed: int = 0, run: int = 0) -> ChainPath:
    """One run of a chain until `end`, tu; (seed, run) name it.

    >>> from kinetics import Chain
    >>> chain_path(Chain([[0.0, 1.0], [0.0, 0.0]], initial=0), end=1e3, seed=1).states.tolist()
    [0, 1]
    """
    chain.check_complete("a run")
    return _drawn(chain.transitions, chain.initial, one_time("end", end), seed, run)


def chain_path_to(chain: Chain, target: Target, seed: int = 0, run: int = 0) -> ChainPath:
    """One run of a chain until the target, drawn from the runs that reach it, however few (Doob's h-transform).

    ValueError: the target is never reached

    >>> from kinetics import Chain
    >>> rare = Chain([[0.0, 1.0, 1e-9], [0.0, 0.0, 0.0], [0.0, 0.0, 0.0]], initial=0)
    >>> chain_path_to(rare, [False, False, True], seed=1).states.tolist()
    [0, 2]
    """
    chain.check_complete("a run")
    found = chain.committor({"target": target})
    chances = found.committors[0]
    weights = chain.initial * chances
    if not weights.any():
        raise ValueError("the target is never reached; there are no such runs")
    return _drawn(found.transitions, weights / weights.sum(), np.inf, seed, run, chances)


def _drawn(
    chain: Transitions, start: Floats, end: float, seed: int, run: int, chances: Floats | None = None
) -> ChainPath:
    """One run until `end`, tu, or with `chances` (N,) of reaching a target until its last event."""
    key = (whole_number("run", run, 0), 1)  # the jumps have (run,)
    rng = np.random.default_rng(np.random.SeedSequence(whole_number("seed", seed, 0), spawn_key=key))
    begin = int(rng.choice(start.size, p=start))
    times, entries = sampled_jumps(chain, begin, end, seed, run, chances)
    last = float(times[-1]) if times.size else 0.0
    return ChainPath(np.append(0.0, times), np.append(begin, chain.columns[entries]), end if end < np.inf else last)
