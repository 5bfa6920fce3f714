"""Predictions of counts over time, with the uncertainty that comes from the rates."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from kinetics.network import Model, Network
from kinetics.predicting.accuracy import AskedAccuracy
from kinetics.predicting.counts_over_time import CountsOverTime
from kinetics.predicting.job import Job
from kinetics.predicting.mean_field import MEAN_FIELD, MeanField
from kinetics.predicting.methods import method_of
from kinetics.predicting.over_draws import RUNS_PER_DRAW, DrawMeans, RunsOverDraws, runs_over_draws
from kinetics.predicting.page import prediction_page
from kinetics.predicting.trajectories import Trajectories, sample_trajectories
from kinetics.runs import Truncation
from kinetics.sampling import Auto, SamplingMethod
from kinetics.sampling.forecast import forecast_runs
from kinetics.sampling.streamed import streamed
from kinetics.support import plots
from kinetics.support.arrays import Floats
from kinetics.support.datasets import dataframe_over_times, dataset
from kinetics.support.output import write_whole
from kinetics.support.packages import pd
from kinetics.support.shown import ResultTable, Shown, Tabular, on_axes, over_time
from kinetics.support.tables import with_spread

if TYPE_CHECKING:
    import xarray as xr

    from kinetics.markov.transient import SolvingMethod
    from kinetics.predicting.accuracy import Reached
    from kinetics.rates.applied import AppliedRates
    from kinetics.rates.posterior import Posterior

    AnyMethod = SamplingMethod | SolvingMethod | MeanField

RUNS = 1000


@dataclass(frozen=True, eq=False, repr=False)
class Prediction(Shown, Tabular):
    """The mean and spread of the counts of every species over time, with their errors. Arrays are (T, S).

    mean, sd : mean, and standard deviation of a single run. If the rates have evidence, a method that samples gives
        those of the posterior prediction (rates drawn, then a run: intrinsic noise and the uncertainty of the rates),
        and one that does not those at the posterior mean of each rate constant
    low, high : 95 % interval of the mean from the uncertainty of the rates; None if these have no evidence
    standard_error : of the mean, that of drawing rates included; 0 for a method that does not sample, nan for one run
    error : bound on, or estimate of, the numerical error of the probabilities; 0 for a method that samples, nan for the
        mean field, whose means have no bound; its sd is nan too
    notes : remarks on the interval, for the reader
    is_complete : whether all runs and draws were made; fewer are made after Ctrl-C
    method : by its name; one that chooses says in brackets what it chose
    result : that from which mean and sd come: statistics of runs, a Distribution, or a MeanFieldSolution
    drawn : means under single draws of the rates, from which the interval comes; None if there is none
    reached : the accuracy, and how it was reached; None if none was asked for
    truncated : why there are fewer times than were asked for; None if there are not
    trajectories : single runs sampled next to it; None if none were asked for

    >>> from kinetics import ChannelRate, Convention, Network, Rates, predict
    >>> decay = Network.from_text("decay: A -> 0, 1")
    >>> measured = ChannelRate(rate=0.1, events=40, exposure=400.0, ways=1)
    >>> rates = Rates(convention=Convention(combinations="distinct"), channels={"decay": measured})
    >>> found = predict(Model(decay, {"A": 100}), rates, [10.0], seed=1)
    >>> bool(found.low[0, 0] < 36.788 < found.high[0, 0]), bool(found.high[0, 0] - found.low[0, 0] > 10)
    (True, True)
    """

    network: Network
    times: Floats
    mean: Floats
    sd: Floats
    low: Floats | None
    high: Floats | None
    standard_error: Floats
    error: float
    notes: tuple[str, ...]
    result: CountsOverTime
    method: str
    cpu_seconds: float
    is_complete: bool = True
    drawn: DrawMeans | None = None
    reached: Reached | None = None
    truncated: Truncation | None = None
    trajectories: Trajectories | None = None

    @property
    def runs(self) -> int | None:
        """Number of runs from which mean and sd come; None for a method that does not sample."""
        return self.result.runs

    @property
    def approximation(self) -> dict[str, Any] | None:
        """For JSON: which approximation the means are and how far off; None for an exact method."""
        return self.result.approximation

    @cached_property
    def bands(self) -> plots.Bands | None:
        """Means and the middle 95 % of runs, found once for all panels; None where only an approximation is known."""
        return self.result.bands()

    @property
    def headline(self) -> str:
        """One line: what the figures are, the method, their precision, and the CPU time."""
        explained = self.result.meaning + ("" if self.low is None else " [95 % interval of the mean, from the rates]")
        reached = self.reached
        precision = self.result.precision(self.standard_error) if reached is None else reached.headline
        return f"{explained}; method {self.method}; {precision}; {self.cpu_seconds:.2g} s CPU"

    def summary(self) -> ResultTable:
        """Mean, sd and interval at some of the times, and how well they are known."""

        def cell(t: int, s: int) -> str:
            text = with_spread(self.mean[t, s], self.sd[t, s])
            if self.low is not None and self.high is not None:
                text += f" [{self.low[t, s]:.4g}, {self.high[t, s]:.4g}]"
            return text

        return over_time(self.headline, self.times, self.network.time_unit, self.network.species, cell, self.notes)

    def to_dataframe(self) -> pd.DataFrame:
        """One row per time and species."""
        return dataframe_over_times(self.times, "species", self.network.species, self._columns())

    def _columns(self) -> dict[str, Floats]:
        """The figures (T, S) of tables."""
        columns = self.result.columns(self.standard_error)
        if self.low is not None and self.high is not None:
            columns |= {"low": self.low, "high": self.high}
        return columns

    def to_xarray(self) -> xr.Dataset:
        """Mean, sd, standard error and interval as a dataset with dimensions time and species; needs xarray."""
        variables = {name: (("time", "species"), values) for name, values in self._columns().items()}
        places = {"time": self.times, "species": list(self.network.species)}
        return dataset(variables, places, self.network.time_unit, method=self.method)

    @on_axes
    def plot(self, ax: Any, only: int | None = None) -> Any:
        """Plot the means, bands of the middle 95 % of runs, and the interval of the mean (dashed); returns `ax`.

        Trajectories are thin steps behind them, a mean field is dotted. `draw_prediction` gives each species a panel.
        only : draw the species of this number alone
        """
        names, unit = self.network.species, self.network.time_unit
        known, approximate = self.bands, self.result.approximate()
        if known is not None:
            plots.bands(ax, *known, names, unit, only=only)
        if approximate is not None:
            plots.approximate(ax, self.times, approximate, names, MEAN_FIELD, unit, only)
        if self.trajectories is not None:
            self.trajectories.plot(ax, only)
        if self.low is not None and self.high is not None:
            plots.intervals(ax, self.times, self.low, self.high, only)
        return ax

    def save_page(self, path: str | Path) -> Path:
        """Write an interactive page with picture and table, about 5 MB of HTML that need no network; returns the path.

        ModuleNotFoundError: Plotly is not installed
        """
        return write_whole(path, prediction_page(self))


def predict(
    model: Model | Network,
    rates: AppliedRates | None = None,
    times: ArrayLike = (),
    method: AnyMethod | AskedAccuracy | str | None = None,
    runs: int | None = None,
    seed: int = 0,
    draws: int = 200,
    threads: int | None = None,
    progress: Callable[[str], None] | None = None,
    trajectories: int = 0,
) -> Prediction:
    """Predict mean and spread of the counts at `times` under `rates`, with a 95 % interval of the mean.

    rates : None for the model's own, which are taken as known, so that there is no interval
    method : a sampling or solving method, or its name; Auto() by default. "mean-field" integrates the rate equations,
        an approximation without a bound. Or an `AskedAccuracy`, or a text such as
        "1%": the cheapest method that reaches it is chosen, see `adaptive_prediction`, and mean and sd are those at the
        posterior mean of each rate constant
    runs : least number of runs of a sampling method, 1000 by default; with evidence there are `RUNS_PER_DRAW` under
        each draw
    draws : least number of draws of the rates from their posterior; the interval comes from so many
    progress : called with a line of text on how far the work is; None for silence
    trajectories : number of single runs to sample too, see `sample_trajectories`; with evidence at the posterior mean
        of each rate constant
    ValueError: rates of another network or without their tank, missing rates, or what the method refuses; an accuracy
        together with runs, one that no method can reach, or that would cost more than the budget

    Only statistics of the runs are kept, so memory does not grow with their number. After Ctrl-C the prediction comes
    from the runs and draws made so far, if any, and its notes say so. Figures end before the first run that would come
    to more than 1e9 events, or whose counts or propensities go beyond all numbers; `predict_job` takes another limit.

    Where the rates have evidence, runs are spread over draws of the rates: 20,000 by default, which give mean, sd, band
    and interval. The interval is made of the 2.5 % and 97.5 % quantiles of the means under `draws` draws, pulled
    towards each other by the share of their variance that is Monte-Carlo noise (known from the runs). It thus shows
    the uncertainty of the rates alone, approximately. A method that does not sample solves at the posterior mean of
    each rate constant; its interval comes from sampling by `Auto`.

    >>> from kinetics import Model, Network, predict
    >>> binding = Model(Network.from_text("A + B <-> AB, 0.01, 0.1"), {"A": 20, "B": 10})
    >>> exact = predict(binding, times=[5.0], method="transient")
    >>> exact.mean.round(4).tolist(), exact.error < 1e-12
    ([[15.3269, 5.3269, 4.6731]], True)
    >>> sampled = predict(binding, times=[5.0], runs=2000, seed=1)
    >>> bool((abs(sampled.mean - exact.mean) < 5 * sampled.standard_error).all())
    True
    """
    job = Job(
        Model.of(model), np.asarray(times), None, seed, threads, progress or (lambda _: None), trajectories=trajectories
    )
    return predict_job(job, rates, method, runs, draws)


def predict_job(
    job: Job,
    rates: AppliedRates | None = None,
    method: AnyMethod | AskedAccuracy | str | None = None,
    runs: int | None = None,
    draws: int = 200,
) -> Prediction:
    """Predict what a `Job` reports: counts of its model or observables of them, see `predict` for all else.

    >>> import numpy as np
    >>> from kinetics import Model, Network
    >>> from kinetics.predicting import Job, Observables, predict_job
    >>> binding = Model(Network.from_text("A + B <-> AB, 0.01, 0.1"), {"A": 20, "B": 10})
    >>> either = Observables.of(binding.network, {"free": {"A": 1, "B": 1}})
    >>> predict_job(Job(binding, np.array([5.0]), either), method="transient").mean.round(4).tolist()
    [[20.6538]]
    """
    began = time.process_time()
    chosen = _chosen(method)
    given, posterior = job.model, None
    if rates is not None:
        if rates.has_evidence:
            posterior = rates.posterior(given.network, given.tank)
        job = replace(job, model=replace(given, network=rates.expected(given.network, given.tank)))
    singles = sample_trajectories(job, job.trajectories) if job.trajectories else None
    if isinstance(chosen, AskedAccuracy):
        found = _adapted(job, chosen, runs)
    elif isinstance(chosen, SamplingMethod):
        found = _sampled(job, chosen, RUNS if runs is None else runs, posterior, draws)
    elif isinstance(chosen, MeanField):
        found = _Found(chosen.solve(job), chosen.name)
    else:
        found = _solved(job, chosen)
    result, spread = found.result, found.spread
    notes, is_complete = [*evidence_notes(rates), *found.notes], found.is_complete
    if posterior is not None and spread is None and result.is_interrupted:
        notes.append("no interval: interrupted before the draws of the rates")
    elif posterior is not None and result.no_interval:
        notes.append(f"no interval: {result.no_interval}")
    elif posterior is not None and spread is None:
        spread = runs_over_draws(replace(job, grid=result.times), posterior, 1, draws, Auto())
        is_complete = is_complete and spread.statistics.is_complete
        notes.append("mean, sd and band are those at the posterior mean of each rate constant")
    if spread is not None and not spread.statistics.is_complete:
        notes.append(f"interrupted: {spread.draws} draws of the rates, {spread.statistics.runs} runs were made")
    mean = result.mean()
    drawn = None if spread is None else spread.drawn
    if drawn is not None and drawn.means.shape[1] < len(mean):
        notes.append(f"no interval: {spread and spread.statistics.truncated}")
        drawn = None
    low, high = (None, None) if drawn is None else drawn.limits(mean)
    if drawn is not None and drawn.is_hidden:
        notes.append(
            f"an interval of zero width is narrower than {RUNS_PER_DRAW} runs for each draw of the rates can resolve"
        )
    notes += result.notes
    if singles is not None:
        notes += singles.notes
        notes += [] if posterior is None else ["trajectories are those at the posterior mean of each rate constant"]
    return Prediction(
        job.shown,
        result.times,
        mean,
        result.sd(),
        low,
        high,
        result.standard_error() if found.spread is None else found.spread.standard_error,
        result.error,
        tuple(notes),
        result,
        found.method,
        time.process_time() - began,
        is_complete,
        drawn,
        found.reached,
        result.truncated,
        singles,
    )


class _Found(NamedTuple):
    """The result of a strategy.

    spread : the runs over draws of the rates, if mean and sd come from these
    """

    result: CountsOverTime
    method: str
    is_complete: bool = True
    notes: tuple[str, ...] = ()
    spread: RunsOverDraws | None = None
    reached: Reached | None = None


def _chosen(
    method: AnyMethod | AskedAccuracy | str | None,
) -> AnyMethod | AskedAccuracy:
    """The method, or the accuracy of a text such as "1%"; Auto() by default."""
    if isinstance(method, AskedAccuracy):
        return method
    if isinstance(method, str) and method.endswith("%"):
        return AskedAccuracy.of_text(method)
    return Auto() if method is None else method_of(method)


def _solved(job: Job, method: SolvingMethod) -> _Found:
    """Predict by a method that solves the master equation."""
    return _Found(job.distribution(method.solve(job.model.network, job.model.initial, job.grid)), method.name)


def _sampled(job: Job, method: SamplingMethod, runs: int, posterior: Posterior | None, draws: int) -> _Found:
    """Predict by runs, spread over draws of the rates if these have evidence."""
    name = method.name_for(job.model.network, job.model.initial)
    if posterior is not None:
        spread = runs_over_draws(job, posterior, runs, draws, method)
        made = spread.statistics
        note = f"mean, sd and band are those of {made.runs} runs under {spread.draws} draws of the rates"
        return _Found(made, name, made.is_complete, (note,), spread)
    forecast_runs(job.model.network, method, job.model.initial, job.grid, runs, job.threads, job.max_events)
    sampling = method if job.observables is None else job.observables.sampling(method, job.model.network)
    source = sampling.source(job.shown, job.model.initial, job.seed, job.max_events)
    say = lambda done: job.report(f"{done} of {runs} runs")  # noqa: E731
    made = streamed(job.shown, source, job.grid, runs, job.threads, covariances=False, progress=say)
    made = replace(made, method=sampling.name_for(job.shown, job.model.initial))
    notes = () if made.is_complete else (f"interrupted: {made.runs} of {runs} runs were made",)
    return _Found(made, name, made.is_complete, notes)


def _adapted(job: Job, accuracy: AskedAccuracy, runs: int | None) -> _Found:
    """Predict by the cheapest way to an accuracy."""
    from kinetics.predicting.adaptive import adaptive_prediction

    if runs is not None:
        raise ValueError(
            f"runs = {runs} together with an accuracy, which chooses the runs itself: give one or the other"
        )
    result, reached, is_complete = adaptive_prediction(job, accuracy)
    notes = reached.notes
    if not is_complete:
        notes = (*notes, "stopped by Ctrl-C or by the budget before the accuracy was reached")
    return _Found(result, reached.chosen, is_complete, notes, reached=reached)


def evidence_notes(rates: AppliedRates | None) -> tuple[str, ...]:
    """Remarks on the interval of a prediction from `rates`, for the reader."""
    if rates is None:
        return ("no interval: rate constants are taken as exact (no uncertainty given)",)
    bare = rates.without_evidence()
    if not rates.has_evidence:
        return ("no interval: these rates come without evidence (events and exposure)",)
    if bare:
        return (f"the interval excludes {', '.join(bare)}: taken as exact, because without evidence",)
    return ()
