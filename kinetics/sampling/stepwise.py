"""Samplers whose kernel advances a run step by step and reads its random numbers from buffers."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from kinetics.kernels import outcomes
from kinetics.support.arrays import Floats, Ints

FEWEST_DRAWS, MOST_DRAWS = 256, 16384  # of a call to a kernel


class StepwiseSampler:
    """Runs of a kernel that reads its random numbers from buffers, call after call.

    begin(counts) : a fresh workspace for a run that starts at `counts` (S + 1,), the last one 1
    advance(workspace, counts, seen, clock, waits, uniforms, grid, out, times, channels) : see `kernels.grouped`
    order : (R,) channel of the network for each channel of the kernel
    """

    def __init__(self, begin: Callable[[Ints], Any], advance: Callable[..., int], order: Ints):
        self.begin, self.advance, self.order = begin, advance, order

    def ensemble(
        self, initial: Ints, grid: Floats, key: NDArray[np.uint64], first_run: int, out: Ints
    ) -> tuple[int, int]:
        """Fill `out` (runs, T, S); the outcome, and the number of the last run begun."""
        for i in range(len(out)):
            outcome, _ = self._run(initial, grid, key, first_run + i, out[i], keep_events=False)
            if outcome != outcomes.REACHED_END:
                return outcome, first_run + i
        return outcomes.REACHED_END, first_run + len(out) - 1

    def path(self, initial: Ints, end: float, key: NDArray[np.uint64], run: int) -> tuple[int, Floats, Ints]:
        """The outcome, and times and channels of all events until `end`."""
        out = np.empty((1, initial.size), dtype=np.int64)
        outcome, pieces = self._run(initial, np.array([end]), key, run, out, keep_events=True)
        times, channels = (np.concatenate(columns) for columns in zip(*pieces, strict=True))
        return outcome, times, self.order[channels]

    def _run(
        self, initial: Ints, grid: Floats, key: NDArray[np.uint64], run: int, out: Ints, keep_events: bool
    ) -> tuple[int, list[tuple[Floats, Ints]]]:
        from kinetics.kernels import streams

        stream = np.empty(4, dtype=np.uint64)
        streams.start_stream(key, run, stream)
        counts, clock, seen = np.ones(initial.size + 1, dtype=np.int64), np.zeros(1), np.zeros(2, dtype=np.int64)
        counts[:-1] = initial
        workspace = self.begin(counts)
        pieces = []
        n_draws, outcome = FEWEST_DRAWS, outcomes.UNFINISHED
        waits = uniforms = np.empty(0)
        while outcome == outcomes.UNFINISHED:
            if waits.size < n_draws:
                waits, uniforms = np.empty(n_draws), np.empty(n_draws)
            n_kept = n_draws if keep_events else 0
            times, channels = np.empty(n_kept), np.empty(n_kept, dtype=np.int64)
            streams.draw(stream, waits, uniforms)
            outcome = self.advance(workspace, counts, seen, clock, waits, uniforms, grid, out, times, channels)
            pieces.append((times[: seen[1]], channels[: seen[1]]))
            n_draws = min(4 * n_draws, MOST_DRAWS)
        return outcome, pieces
