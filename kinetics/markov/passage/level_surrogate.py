"""A Markov chain on levels alone, learnt from runs: the chance of an event, given the level and the time left."""

from __future__ import annotations

import numpy as np

from kinetics.markov.passage.elimination import direct
from kinetics.support.arrays import Floats, Ints

MAX_BINS = 256  # more levels than this share bins of equal width
STEPS = 400  # of the time until the end


class LevelBins:
    """Levels as numbers of bins; the last one is the event, and holds all levels from `threshold` on."""

    def __init__(self, levels: Floats, threshold: float) -> None:
        below = np.unique(levels[levels < threshold])
        if below.size > MAX_BINS:
            below = np.linspace(below[0], threshold, MAX_BINS, endpoint=False)
        self.edges = np.append(below, threshold)
        self.n = self.edges.size

    def of(self, levels: Floats) -> Ints:
        """The bin (n,) of each level (n,)."""
        return np.maximum(np.searchsorted(self.edges, levels, side="right") - 1, 0)


class LevelJumps:
    """Time spent in each bin, tu, and how often a run went from one to another."""

    def __init__(self, bins: LevelBins) -> None:
        self.bins, self.times, self.counts = bins, np.zeros(bins.n), np.zeros((bins.n, bins.n))

    def note(self, before: Floats, waits: Floats, fired: Ints, after: Floats) -> None:
        """Runs that stayed at the levels `before` (n,) for `waits` (n,), and of which `fired` went to `after`."""
        rows = self.bins.of(before)
        np.add.at(self.times, rows, waits)
        np.add.at(self.counts, (rows[fired], self.bins.of(after)), 1.0)


class LevelChances:
    """Chance (M + 1, n) of the event from each bin, with the time left in M equal steps from none to all.

    The rates between bins are jumps over time spent. That forgets all but the level, so the chances are rough where
    other counts matter; they only show where runs are worth splitting. Implicit Euler steps, which are sums of positive
    terms, so that a chance of 1e-30 is as good as one of 0.5.
    """

    def __init__(self, jumps: LevelJumps, end: float) -> None:
        self.bins, self.end = jumps.bins, end
        last, step = jumps.bins.n - 1, end / STEPS
        rates = np.divide(jumps.counts, jumps.times[:, None], out=np.zeros_like(jumps.counts), where=jumps.counts > 0)
        np.fill_diagonal(rates, 0.0)
        rows, columns = np.nonzero(rates[:last, :last])
        hits = rates[:last, last]
        chain = direct(rows, columns, rates[rows, columns], hits + 1.0 / step)
        self.chances = np.zeros((STEPS + 1, last + 1))
        self.chances[:, last] = 1.0
        for m in range(1, STEPS + 1):
            self.chances[m, :last] = chain.solve(hits + self.chances[m - 1, :last] / step)

    def __call__(self, levels: Floats, clocks: Floats) -> Floats:
        """Chances (n,) at levels (n,) and clocks (n,), tu."""
        bins = self.bins.of(levels)
        place = np.clip((self.end - clocks) / self.end, 0.0, 1.0) * STEPS
        below: Ints = np.minimum(place.astype(np.int64), STEPS - 1)
        share = place - below
        return (1.0 - share) * self.chances[below, bins] + share * self.chances[below + 1, bins]
