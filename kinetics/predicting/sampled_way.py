"""The way to an accuracy by runs, made until they are enough."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from math import ceil, inf, log, sqrt

import numpy as np

from kinetics.predicting import tuning
from kinetics.predicting.accuracy import AskedAccuracy, CostForecast
from kinetics.predicting.first_runs import FirstRuns, first_runs
from kinetics.predicting.forced_firings import NOT_FORCED, ForcedFirings, force_firings
from kinetics.predicting.job import Job
from kinetics.predicting.stopping_rule import InterimLook
from kinetics.predicting.tuning import FIRST_RUNS, LEVEL
from kinetics.predicting.ways import AccuracyWay, Attained, Goal
from kinetics.runs.truncation import TruncatedRunsError
from kinetics.sampling import Auto, SamplingMethod
from kinetics.sampling.run_source import RunSource
from kinetics.sampling.statistics import Tally, kept_pairs
from kinetics.sampling.streamed import unbroken
from kinetics.sampling.watch import Watch
from kinetics.support.arrays import Ints


class EnoughRuns(AccuracyWay):
    """Runs by the quickest exact sampler; the first of them forecast how many are needed."""

    name = Auto.name
    remark = "not weighed"

    def __init__(self, goal: Goal) -> None:
        super().__init__(goal)
        self.runs: RunsUntil | None = None
        self._run_seconds, self._needed, self._is_tried = inf, inf, False

    def forecast(self, rivals: float) -> None:
        """Make the first runs, and from them forecast the runs needed and what they cost."""
        if self._is_tried:
            return
        self._is_tried = True
        goal, job = self.goal, self.goal.job
        try:
            method = Auto().choose(job.model.network, job.model.initial)
        except ValueError as refusal:
            self.cost = self.cost._replace(remark=str(refusal))
            return
        name = f"{self.name} ({method.name})"
        self.cost = self.cost._replace(method=name)
        job.report("making the first few runs")
        most = min(tuning.FOLLOWING * rivals, goal.budget) / FIRST_RUNS
        source = method.source(job.model.network, job.model.initial, job.seed, job.max_events)
        watch = source.watch(job.grid)
        try:
            first = self._first(method, source, most, watch)
        except TruncatedRunsError as refusal:
            if not goal.is_listed:
                raise
            self.cost = CostForecast(name, None, str(refusal))
            return
        if first.counts is None or first.seen is None or first.seconds > most:
            self.cost = CostForecast(name, None, f"over {FIRST_RUNS * first.seconds:.2g} s for {FIRST_RUNS} runs alone")
            return
        counts = first.counts
        if job.observables is not None:
            source = replace(source, weights=job.observables.weights)
            counts = counts @ job.observables.weights
        forcing = partial(
            force_firings, job.model.network, source, first.seen, job.grid[: watch.n_times],
            max(FIRST_RUNS, int(tuning.FIRST_SECONDS / first.seconds)), job.seed,
        )  # fmt: skip
        self._run_seconds = first.seconds
        self.runs = RunsUntil(
            job, goal.asked, source, name, first.seconds, counts, tuning.LANES if method.is_for_ensembles else 1,
            forcing, watch,
        )  # fmt: skip
        needed = max(self.runs.forecast(), self.runs.tally.runs)
        self.cost = CostForecast(name, tuning.STATISTICS + needed * first.seconds, f"about {needed:.3g} runs")
        self.is_settled = self.runs.error <= goal.asked.value and not self.is_partial

    def _first(self, method: SamplingMethod, source: RunSource, most: float, watch: Watch) -> FirstRuns:
        """The first runs, until the last time that all of them pass; TruncatedRunsError where that is none."""
        job = self.goal.job
        for _ in range(2):
            grid = job.grid[: watch.n_times]
            try:
                return first_runs(
                    job.model.network, method, source, grid, grid.size * len(job.shown.species), most, job.threads
                )
            except TruncatedRunsError:
                source.counts(job.grid, FIRST_RUNS, threads=job.threads, watch=watch)
        raise AssertionError("runs were truncated before a time that they had passed")

    @property
    def is_partial(self) -> bool:
        """Whether runs were truncated, so that there are figures for earlier times only."""
        return self.runs is not None and self.runs.watch.n_times < self.goal.job.grid.size

    @property
    def at_most(self) -> float:
        """The forecast cost; if runs were truncated, all of the budget, so that ways to all figures come first."""
        return self.goal.budget if self.is_partial and self.seconds <= self.goal.budget else self.seconds

    def attempt(self) -> Attained | None:
        """Make runs until they are enough."""
        if self.runs is None:
            return None
        return self._ended(self.runs, self.runs.finish(max(int(self.goal.budget / self._run_seconds), FIRST_RUNS)))

    def interrupted(self) -> Attained | None:
        """The answer from the runs made before Ctrl-C."""
        return None if self.runs is None else self._ended(self.runs, self.runs.interrupted())

    def _ended(self, runs: RunsUntil, made: Attained) -> Attained:
        """The answer, from which a tenth of the error is forecast."""
        needed = runs.tally.runs * (made.error / self.goal.asked.value) ** 2
        self._needed = max(min(needed, runs.needed), FIRST_RUNS / tuning.TENFOLD**2)
        return made

    @property
    def tenfold(self) -> CostForecast | None:
        """A hundred times the runs that were needed, or are forecast."""
        more, seconds = tuning.TENFOLD**2, self.seconds
        if self._needed < inf:
            seconds = tuning.STATISTICS / more + self._needed * self._run_seconds
        is_possible = seconds < inf and self.goal.asked.value / tuning.TENFOLD >= tuning.LEAST
        return CostForecast(self.cost.method, more * seconds) if is_possible else None

    @property
    def advice(self) -> str:
        """The error that runs may reach within the budget."""
        if self.seconds == inf:
            return ""
        within = 1.1 * self.goal.asked.value * (self.seconds / self.goal.budget) ** 0.5
        return f"allow more, or ask for {self.goal.asked.words(within)}, which runs may reach"


def runs_for_distributions(error: float, figures: int) -> int:
    """Runs after which so many distributions are known within `error`, with confidence `LEVEL` for all of them.

    Dvoretzky, Kiefer & Wolfowitz (1956) with the constant of Massart (1990), doi:10.1214/aop/1176990746, and a union
    bound over the distributions: proven for any number of runs, which is known beforehand.

    >>> runs_for_distributions(0.01, 1)
    18445
    """
    return ceil(log(2 * max(figures, 1) / (1 - LEVEL)) / (2 * error**2))


class RunsUntil:
    """Runs of one job, made until they are enough; the first of them forecast how many that will be.

    source : the runs, of what is shown
    name : of the method, as results show it
    run_seconds : about what a run takes, s
    first : (runs, T, V) counts of the first runs, where these were made
    together : runs that cost about as much as one more would
    forcing : gives the forced firings beside the runs in a tally, of which so many are needed; None if none can be
    watch : over all runs; once one is truncated, there are fewer times
    """

    def __init__(
        self, job: Job, asked: AskedAccuracy, source: RunSource, name: str = "", run_seconds: float = inf,
        first: Ints | None = None, together: int = 1,
        forcing: Callable[[Tally, float], ForcedFirings | None] = lambda *_: None, watch: Watch | None = None,
    ) -> None:  # fmt: skip
        self.job, self.asked, self.source, self.name = job, asked, source, name
        self.run_seconds, self.together, self._forcing = run_seconds, together, forcing
        self.watch = source.watch(job.grid) if watch is None else watch
        n_species = len(job.shown.species)
        self.is_known = job.is_known[: self.watch.n_times]
        self.tally = Tally(job.shown, job.grid[: self.watch.n_times], kept_pairs(n_species, False))
        self._rows: list[Ints] = []
        self._most_rows = max(FIRST_RUNS, min(tuning.ROWS, tuning.ROW_BYTES // (8 * job.grid.size * n_species)))
        self.forced: ForcedFirings | None = None
        self.rare = ""  # how rare events were allowed for
        self.error = inf
        self.needed = float(self._for_distributions) if asked.of == "distribution" else inf
        if first is not None:
            self._take(first)

    @property
    def _for_distributions(self) -> int:
        return runs_for_distributions(self.asked.value, int((~self.is_known).sum()))

    def forecast(self) -> float:
        """Runs that will be needed: from the first few, unless it is known without."""
        if self.asked.of != "distribution":
            self._make(FIRST_RUNS)
            self.forced = self._forcing(self.tally, max(self._seen_now().about, FIRST_RUNS))
            self.rare = NOT_FORCED if self.forced is None else self.forced.note
            self._look()
            more = int(min(self._next(), tuning.FIRST_SECONDS / self.run_seconds, tuning.MOST_FIRST))
            if self.error > self.asked.value and more > FIRST_RUNS:
                self._make(self._rounded(more))
                self._look()
        return self.needed

    def fixed_from(self, runs: int) -> float:
        """The fixed number of runs that keeps the accuracy with confidence `LEVEL`, as so many see it."""
        self._make(runs)
        return self._look().fixed(1 - LEVEL)

    def finish(self, most: int) -> Attained:
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

    def interrupted(self) -> Attained:
        """The runs that were made; KeyboardInterrupt if there are fewer than two, which have no variance."""
        if self.tally.runs < 2:
            raise KeyboardInterrupt
        if self.asked.of != "distribution":
            self._look()
        return self._made(max(ceil(self.needed), self.tally.runs + 1))

    def _next(self) -> float:
        """Runs until the next look."""
        planned = min(tuning.MARGIN * self.needed, tuning.GROWTH * self.tally.runs)
        return max(planned, tuning.LEAST_GROWTH * self.tally.runs)

    def _rounded(self, runs: float) -> int:
        """At least so many runs, rounded up to what costs no more."""
        return self.together * ceil(runs / self.together)

    def _made(self, wanted: int) -> Attained:
        asked, runs = self.asked, self.tally.runs
        is_proven = asked.of == "distribution"
        if is_proven:
            self.error = asked.value * sqrt(self._for_distributions / runs)
        elif self.error == inf:
            self.error = asked.value * self._seen_now().share_of_tolerance()
        found = replace(self.tally.statistics(wanted, self.name), truncated=self.watch.truncation(runs))
        is_complete = found.is_complete and self.error <= asked.value
        return Attained(found, self.error, is_proven, LEVEL, is_complete, self.rare)

    def _make(self, runs: int) -> None:
        """Go on until there are so many."""
        is_short = (runs - self.tally.runs) * self.run_seconds < tuning.THREADED
        threads = 1 if is_short else self.job.threads
        for counts in self.source.blocks(self.job.grid, self.tally.runs, runs, threads, self.watch):
            self._take(counts)
            wanted = "" if self.needed == inf else f" of about {self.needed:.3g}"
            self.job.report(f"{self.tally.runs}{wanted} runs")
        self._cut(self.watch.n_times)

    def _take(self, counts: Ints) -> None:
        """Add these runs."""
        with unbroken():
            self.tally.add(counts)
            kept = sum(map(len, self._rows))
            if kept < self._most_rows:
                self._rows.append(counts[: self._most_rows - kept].copy())

    def _cut(self, n_times: int) -> None:
        """Leave out the times that a truncated run has not passed."""
        if n_times < len(self.is_known):
            self.tally.cut(n_times)
            self.is_known = self.is_known[:n_times]
            self._rows = [counts[:, :n_times] for counts in self._rows]
            self.forced = None if self.forced is None else self.forced.until(n_times)

    def _look(self) -> InterimLook:
        """How many runs are needed, and how far off these may be; not drawn where that is far from enough."""
        look = self._seen_now()
        self.error = inf if look.is_far else self.asked.value * look.share_of_tolerance()
        self.needed = look.runs_needed()
        return look

    def _seen_now(self) -> InterimLook:
        rows = np.concatenate(self._rows)
        return InterimLook(self.asked, self.tally, rows, self.is_known, self.job.seed, self.forced)
