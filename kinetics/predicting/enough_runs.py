"""Runs until they are enough for an accuracy."""

from __future__ import annotations

from collections.abc import Callable
from math import ceil, inf, log, sqrt
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from kinetics.network import Network
from kinetics.predicting.accuracy import LEVEL, AskedAccuracy
from kinetics.predicting.looks import GROWTH, LEAST_GROWTH, MARGIN, ROW_BYTES, ROWS, Look
from kinetics.predicting.run_cost import FIRST_RUNS, THREADED
from kinetics.predicting.scouts import NOT_SENT, Scouts
from kinetics.runs import EnsembleStatistics
from kinetics.runs.statistics import Tally, kept_pairs
from kinetics.sampling.run_source import RunSource
from kinetics.sampling.streamed import unbroken
from kinetics.support.arrays import Floats, Ints

FIRST_SECONDS, MOST_FIRST = 2e-3, 256  # so much work, at most, and so many runs, from which those needed are foretold


class Sampled(NamedTuple):
    """Statistics of the runs, and the limit on the error in the unit of the accuracy."""

    statistics: EnsembleStatistics
    error: float


def runs_for_distributions(error: float, figures: int) -> int:
    """Runs after which so many distributions are known within `error`, with confidence `LEVEL` for all of them.

    Dvoretzky, Kiefer & Wolfowitz (1956) with the constant of Massart (1990), doi:10.1214/aop/1176990746, and a union
    bound over the distributions: proven for any number of runs, which is known beforehand.

    >>> runs_for_distributions(0.01, 1)
    18445
    """
    return ceil(log(2 * max(figures, 1) / (1 - LEVEL)) / (2 * error**2))


class RunsUntil:
    """Runs of one prediction, made until they are enough; the first of them foretell how many that will be.

    shown : the network whose counts are kept; source : the runs; grid : (T,) times
    is_known : (T, S) counts that are no matter of chance
    run_seconds : about what a run takes, s
    first : (runs, T, S) counts of the first runs, where these were made
    name : of the method, as results show it
    together : runs that cost about as much as one more would
    scouting : gives the scouts of what so many runs beside those tallied may not show; None where none can be sent
    """

    def __init__(
        self, asked: AskedAccuracy, shown: Network, source: RunSource, grid: Floats, is_known: NDArray[np.bool_],
        seed: int, threads: int | None, report: Callable[[str], None], run_seconds: float = inf,
        first: Ints | None = None, name: str = "", together: int = 1,
        scouting: Callable[[Tally, float], Scouts | None] = lambda *_: None,
    ) -> None:  # fmt: skip
        self.asked, self.shown, self.source, self.grid = asked, shown, source, grid
        self.is_known, self.seed, self.threads, self.report = is_known, seed, threads, report
        self.run_seconds, self.name, self.together = run_seconds, name, together
        self.tally = Tally(shown, grid, kept_pairs(len(shown.species), False))
        size = 8 * grid.size * len(shown.species)
        self._rows: list[Ints] = []
        self._most_rows = max(FIRST_RUNS, min(ROWS, ROW_BYTES // size))
        self._scouting = scouting
        self.scouts: Scouts | None = None
        self.seldom = ""  # what is to be said of what hardly ever happens
        self.error = inf
        self.needed = float(self._for_distributions) if asked.of == "distribution" else inf
        if first is not None:
            self._take(first)

    @property
    def _for_distributions(self) -> int:
        return runs_for_distributions(self.asked.value, int((~self.is_known).sum()))

    def foretell(self) -> float:
        """Runs that will be needed: from the first few, unless it is known without."""
        if self.asked.of != "distribution":
            self._make(FIRST_RUNS)
            self.scouts = self._scouting(self.tally, max(self._seen_now().about, FIRST_RUNS))
            self.seldom = NOT_SENT if self.scouts is None else self.scouts.in_words
            self._look()
            more = int(min(self._next(), FIRST_SECONDS / self.run_seconds, MOST_FIRST))
            if self.error > self.asked.value and more > FIRST_RUNS:
                self._make(self._rounded(more))
                self._look()
        return self.needed

    def fixed_from(self, runs: int) -> float:
        """The fixed number of runs that keeps the accuracy with confidence `LEVEL`, as so many see it."""
        self._make(runs)
        return self._look().fixed(1 - LEVEL)

    def finish(self, most: int) -> Sampled:
        """All the runs, but no more than `most`; after Ctrl-C those that were made."""
        try:
            if self.asked.of == "distribution":
                self._make(min(self._for_distributions, most))
            while self.asked.of != "distribution" and self.error > self.asked.value and self.tally.runs < most:
                self._make(min(self._rounded(self._next()), most))
                self._look()
        except KeyboardInterrupt:
            return self.interrupted()
        return self._made(self.tally.runs)

    def interrupted(self) -> Sampled:
        """The runs that were made; KeyboardInterrupt where these are none to speak of."""
        if self.tally.runs < 2:
            raise KeyboardInterrupt
        if self.asked.of != "distribution":
            self._look()
        return self._made(max(ceil(self.needed), self.tally.runs + 1))

    def _next(self) -> float:
        """Runs until the next look."""
        return max(min(MARGIN * self.needed, GROWTH * self.tally.runs), LEAST_GROWTH * self.tally.runs)

    def _rounded(self, runs: float) -> int:
        """At least so many, as cost no more."""
        return self.together * ceil(runs / self.together)

    def _made(self, wanted: int) -> Sampled:
        if self.asked.of == "distribution":
            self.error = self.asked.value * sqrt(self._for_distributions / self.tally.runs)
        elif self.error == inf:
            self.error = self.asked.value * self._seen_now().share_of_tolerance()
        return Sampled(self.tally.statistics(wanted, self.name), self.error)

    def _make(self, runs: int) -> None:
        """Go on until there are so many."""
        is_short = (runs - self.tally.runs) * self.run_seconds < THREADED
        threads = 1 if is_short else self.threads
        for counts in self.source.blocks(self.grid, self.tally.runs, runs, threads):
            self._take(counts)
            wanted = "" if self.needed == inf else f" of about {self.needed:.3g}"
            self.report(f"{self.tally.runs}{wanted} runs")

    def _take(self, counts: Ints) -> None:
        """Add these runs."""
        with unbroken():
            self.tally.add(counts)
            kept = sum(map(len, self._rows))
            if kept < self._most_rows:
                self._rows.append(counts[: self._most_rows - kept].copy())

    def _look(self) -> Look:
        """How many runs are needed, and how far off these may be; not drawn where that is far from enough."""
        look = self._seen_now()
        self.error = inf if look.is_far else self.asked.value * look.share_of_tolerance()
        self.needed = look.runs_needed()
        return look

    def _seen_now(self) -> Look:
        return Look(self.asked, self.tally, np.concatenate(self._rows), self.is_known, self.seed, self.scouts)
