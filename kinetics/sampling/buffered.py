"""Samplers whose kernel advances a run step by step and reads its random numbers from buffers."""

from __future__ import annotations

from collections.abc import Callable
from time import perf_counter
from typing import Any

import numpy as np
from numpy.typing import NDArray

from kinetics import kernels
from kinetics.kernels import outcomes
from kinetics.kernels.ensemble_work import Stop
from kinetics.sampling.watch import Watch
from kinetics.support.arrays import Floats, Ints

FEWEST_DRAWS, MOST_DRAWS = 256, 16384  # of a call to a kernel
NO_TIMES, NO_CHANNELS = np.empty(0), np.empty(0, dtype=np.int64)  # if no events are asked for


class BufferedSampler:
    """Runs of a kernel that reads its random numbers from buffers, call after call.

    begin(counts) : a fresh workspace for a run that starts at `counts` (S + 1,), the last one 1
    advance(workspace, counts, seen, clock, waits, uniforms, grid, out, times, channels, stop) : see `kernels.grouped`
    order : (R,) channel of the network for each channel of the kernel
    """

    def __init__(self, begin: Callable[[Ints], Any], advance: Callable[..., int], order: Ints):
        self.begin, self.advance, self.order = begin, advance, order

    def ensemble(
        self, initial: Ints, grid: Floats, key: NDArray[np.uint64], first_run: int, out: Ints, watch: Watch
    ) -> None:
        """Fill `out` (runs, T, S) as far as the watch needs it."""
        stop, draws = watch.stop_of(self.order), [np.empty(FEWEST_DRAWS), np.empty(FEWEST_DRAWS)]
        for i in range(len(out)):
            self._run(initial, grid, key, first_run + i, out[i], watch, stop, draws, None)
            watch.complete[first_run] = i + 1
            watch.hear()

    def path(self, initial: Ints, end: float, key: NDArray[np.uint64], run: int, watch: Watch) -> tuple[Floats, Ints]:
        """Times and channels of all events until `end`."""
        out, pieces = np.empty((1, initial.size), dtype=np.int64), list[tuple[Floats, Ints]]()
        stop, draws = watch.stop_of(self.order), [np.empty(0), np.empty(0)]
        self._run(initial, np.array([end]), key, run, out, watch, stop, draws, pieces)
        times, channels = (np.concatenate(columns) for columns in zip(*pieces, strict=True))
        return times, self.order[channels]

    def _run(
        self,
        initial: Ints,
        grid: Floats,
        key: NDArray[np.uint64],
        run: int,
        out: Ints,
        watch: Watch,
        stop: Stop,
        draws: list[Floats],
        pieces: list[tuple[Floats, Ints]] | None,
    ) -> None:
        """Make a run; draws : buffers of random numbers, which grow; pieces : receives its events."""
        stream = np.empty(4, dtype=np.uint64)
        kernels.streams.start_stream(key, run, stream)
        counts, clock, seen = np.ones(initial.size + 1, dtype=np.int64), np.zeros(3), np.zeros(2, dtype=np.int64)
        counts[:-1] = initial
        workspace = self.begin(counts)
        n_draws, drawn, look = FEWEST_DRAWS, 0, watch.first_look
        times, channels = NO_TIMES, NO_CHANNELS
        while seen[0] < (needed := watch.needed(run)):
            n = min(n_draws, look - drawn)
            if draws[0].size < n:
                draws[:] = np.empty(n), np.empty(n)
            waits, uniforms = draws[0][:n], draws[1][:n]
            if pieces is not None:
                times, channels = np.empty(n), np.empty(n, dtype=np.int64)
            kernels.streams.draw(stream, waits, uniforms)
            began = perf_counter()
            if needed < grid.size:
                grid, out = grid[:needed], out[:needed]
            outcome = self.advance(workspace, counts, seen, clock, waits, uniforms, grid, out, times, channels, stop)
            if pieces is not None:
                pieces.append((times[: seen[1]], channels[: seen[1]]))
            drawn += n
            if outcome == outcomes.REACHED_END:
                break
            if outcome == outcomes.STOPPED:
                watch.reached_of(run, 1)[0], out[seen[0] :] = clock[0], counts[:-1]
                break
            if outcome != outcomes.UNFINISHED:
                watch.stop(run, outcome, float(clock[0]), counts[:-1], drawn)
                break
            watch.pause(began)
            if drawn == look:
                look = watch.look(run, drawn, float(clock[0]), counts[:-1])
                if not look:
                    break
            n_draws = min(4 * n_draws, MOST_DRAWS, watch.most_events)
