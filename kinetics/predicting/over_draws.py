"""Runs spread over draws of the rates from their posterior: one simulation for mean, spread, band and interval."""

from __future__ import annotations

import os
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from kinetics.network import Model
from kinetics.predicting.job import Job
from kinetics.sampling import SamplingMethod, simulate_posterior
from kinetics.sampling.forecast import forecast_runs
from kinetics.sampling.outlook import Outlook
from kinetics.sampling.statistics import EnsembleStatistics, Tally, kept_pairs
from kinetics.sampling.streamed import unbroken
from kinetics.sampling.watch import Watch
from kinetics.support.arrays import Floats, Ints, rising_times, whole_number

if TYPE_CHECKING:
    from kinetics.rates.posterior import Posterior

RUNS_PER_DRAW = 100
LIMITS = (0.025, 0.975)
BATCH_BYTES = 2**23  # of counts that are there at a time, of one draw at least


@dataclass(frozen=True, eq=False)
class DrawMeans:
    """Means under single draws of the rates: what `RUNS_PER_DRAW` runs gave under each of D draws.

    parameters : (D, P), as its posterior has them
    means, noise : (D, T, S) mean counts, and their squared Monte-Carlo errors
    """

    posterior: Posterior
    parameters: Floats
    means: Floats
    noise: Floats

    def at_last(self) -> DrawMeans:
        """A copy with the means at the last time only."""
        return replace(self, means=self.means[:, -1:], noise=self.noise[:, -1:])

    @property
    def is_hidden(self) -> bool:
        """Whether somewhere the means differ between draws by no more than the noise of their runs."""
        noise = self.noise.mean(axis=0)
        return bool(((noise > 0.0) & (self.means.var(axis=0, ddof=1) <= noise)).any())

    def limits(self, inside: Floats) -> tuple[Floats, Floats]:
        """95 % interval of the mean (T, S) from the rates; it holds `inside` (T, S), the estimate that it belongs to.

        The posterior mean lies outside of the middle 95 % where its distribution is very skewed, as for what rarely
        happens.
        """
        low, high = noise_free_limits(self.means, self.noise.mean(axis=0))
        return np.minimum(low, inside), np.maximum(high, inside)


@dataclass(frozen=True, eq=False)
class RunsOverDraws:
    """Runs of the posterior prediction.

    statistics : of all runs
    standard_error : (T, S) of their mean, from the scatter between draws, which holds that between runs
    drawn : the first draws; None if not even two were finished
    draws : number of draws behind all runs
    """

    statistics: EnsembleStatistics
    standard_error: Floats
    drawn: DrawMeans | None
    draws: int


def runs_over_draws(job: Job, posterior: Posterior, runs: int, draws: int, method: SamplingMethod) -> RunsOverDraws:
    """At least `runs` runs of a job, `RUNS_PER_DRAW` under each draw of the rates, and at least `draws` draws.

    Only the means of the first `draws` draws are kept, so memory does not grow with the runs. The error of the mean
    falls with the root of the number of runs, because more runs are more draws. After Ctrl-C the draws made so far
    count. After a truncated run, see `simulate`, there are fewer times.
    """
    grid = rising_times(job.grid)
    whole_number("runs", runs, 1)
    n_draws = max(whole_number("draws", draws, 2), -(-runs // RUNS_PER_DRAW))
    asked = n_draws * RUNS_PER_DRAW
    n_species = len(job.shown.species)
    forecast_runs(posterior.expected, method, job.model.initial, grid, asked, job.threads, job.max_events)
    tally = Tally(job.shown, grid, kept_pairs(n_species, False))
    batch = max(1, BATCH_BYTES // (8 * RUNS_PER_DRAW * grid.size * n_species))
    parameters: list[Floats] = []
    means: list[Floats] = []
    noise: list[Floats] = []
    # Sums of the draws' means and of their squares, from the first mean, so that little is lost to rounding.
    origin: Floats | None = None
    (total, squares), done = np.zeros((2, grid.size, n_species)), 0
    watch = Watch(grid, Outlook(posterior.expected), job.max_events)
    try:
        for part in _batches(job, posterior, watch, n_draws, draws, batch, method):
            with unbroken():
                n = watch.n_times
                origin = None if origin is None else origin[:n]
                total, squares, means, noise = total[:n], squares[:n], [m[:n] for m in means], [v[:n] for v in noise]
                tally.add(np.concatenate([counts[:, :n] for _, counts in part]))
                for drawn, made in part:
                    counts = made[:, :n]
                    mean = counts.mean(axis=0)
                    origin = mean if origin is None else origin
                    total += mean - origin
                    squares += (mean - origin) ** 2
                    done += 1
                    if done <= draws:
                        parameters.append(drawn)
                        means.append(mean)
                        noise.append(counts.var(axis=0, ddof=1) / RUNS_PER_DRAW)
            job.report(f"{done * RUNS_PER_DRAW} of {asked} runs, under {done} of {n_draws} draws of the rates")
    except KeyboardInterrupt:
        if not done:
            raise
    variance = np.maximum(squares - total**2 / done, 0.0) / max(done - 1, 1)
    kept = None
    if len(means) > 1:
        kept = DrawMeans(posterior, np.array(parameters), np.array(means), np.array(noise))
    statistics = tally.statistics(asked, method.name_for(posterior.expected, job.model.initial))
    statistics = replace(statistics, truncated=watch.truncation(statistics.runs))
    return RunsOverDraws(statistics, np.sqrt(variance / done), kept, done)


def _batches(
    job: Job, posterior: Posterior, watch: Watch, n_draws: int, block: int, batch: int, method: SamplingMethod
) -> Iterator[list[tuple[Floats, Ints]]]:
    """Batches of draws: the parameters (P,) and the counts (RUNS_PER_DRAW, T, V) of each."""
    for number, begin in enumerate(range(0, n_draws, block)):
        # Streams of their own: spawned, so that they share nothing with the runs of the same seed.
        sequence = np.random.SeedSequence(whole_number("seed", job.seed, 0), spawn_key=(1, number))
        table = posterior.draw(np.random.default_rng(sequence), min(block, n_draws - begin))
        made = simulate_posterior(
            Model.of(posterior.expected, job.model.initial), posterior.variants(table), watch.grid, RUNS_PER_DRAW,
            job.seed,
            method=method,
            first_run=begin * RUNS_PER_DRAW,
            threads=len(os.sched_getaffinity(0)) if job.threads is None else job.threads,
            weights=None if job.observables is None else job.observables.weights,
            watch=watch,
        )  # fmt: skip
        waiting = []
        for pair in zip(table, made, strict=True):
            waiting.append(pair)
            if len(waiting) == batch:
                yield waiting
                waiting = []
        if waiting:
            yield waiting


def noise_free_limits(means: Floats, noise: Floats) -> tuple[Floats, Floats]:
    """2.5 % and 97.5 % quantiles (T, S) of the means (draws, T, S), freed of a noise of variance (T, S).

    They lie between the smallest and the largest mean, hence within what is possible.
    """
    centre = means.mean(axis=0)
    spread = means.var(axis=0, ddof=1)
    share = np.divide(spread - noise, spread, out=np.zeros_like(spread), where=spread > noise)
    low, high = np.quantile(means, LIMITS, axis=0)
    return centre + np.sqrt(share) * (low - centre), centre + np.sqrt(share) * (high - centre)
