"""Predictions of counts over time, with the uncertainty that comes from the rates."""

from __future__ import annotations

import os
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from kinetics.network import Network, Tank
from kinetics.passage import Passage, first_passage
from kinetics.predicting.observables import Observables
from kinetics.rates import Rates
from kinetics.runs import EnsembleStatistics
from kinetics.sampling import Auto, SamplingMethod, simulate_draws, simulate_statistics
from kinetics.solving import Distribution, SolvingMethod, solve
from kinetics.support.arrays import Floats, whole_number

if TYPE_CHECKING:
    import pandas as pd

RUNS_PER_DRAW = 100
LIMITS = (0.025, 0.975)


@dataclass(frozen=True, eq=False)
class Prediction:
    """The mean and spread of the counts of every species over time, with their errors. Arrays are (T, S).

    mean, sd : mean, and standard deviation of a single run (intrinsic noise), at the point values of the rates
    low, high : 95 % interval of the mean from the uncertainty of the rates; None where these have no evidence
    standard_error : Monte-Carlo error of the mean; 0 for a method that does not sample
    error : bound on, or estimate of, the numerical error of the probabilities; 0 for a method that samples
    notes : remarks on the interval, for the reader
    is_complete : whether all runs and draws were made; fewer are made after Ctrl-C
    result : the statistics of the runs, or the Distribution, from which mean and sd come
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
    result: EnsembleStatistics | Distribution
    method: str
    cpu_seconds: float
    is_complete: bool = True

    @property
    def runs(self) -> int | None:
        """Number of runs from which mean and sd come; None for a method that does not sample."""
        return self.result.runs if isinstance(self.result, EnsembleStatistics) else None

    def to_dataframe(self) -> pd.DataFrame:
        """One row per time and species."""
        import pandas as pd

        names = self.network.species
        columns = {"mean": self.mean, "sd": self.sd, "standard_error": self.standard_error}
        if self.low is not None and self.high is not None:
            columns |= {"low": self.low, "high": self.high}
        keys = {"time": np.repeat(self.times, len(names)), "species": list(names) * self.times.size}
        return pd.DataFrame(keys | {name: values.ravel() for name, values in columns.items()})

    def plot(self, ax: Any) -> Any:
        """Plot the means, bands of the middle 95 % of runs, and the interval of the mean (dashed); returns `ax`."""
        from kinetics.support import plots

        self.result.plot(ax)
        if self.low is not None and self.high is not None:
            plots.intervals(ax, self.times, self.low, self.high)
        return ax


def predict(
    network: Network,
    rates: Rates | None,
    initial: ArrayLike,
    times: ArrayLike,
    method: SamplingMethod | SolvingMethod | None = None,
    runs: int = 1000,
    seed: int = 0,
    draws: int = 200,
    threads: int | None = None,
    progress: Callable[[str], None] | None = None,
    observables: Observables | None = None,
    tank: Tank | None = None,
) -> Prediction:
    """Predict mean and spread of the counts at `times` under `rates`, with a 95 % interval of the mean.

    rates : None for the network's own, which are taken as known, so that there is no interval
    method : a sampling or solving method; Auto() by default
    runs : number of runs of a sampling method
    draws : number of rate sets drawn from their posterior for the interval
    progress : called with a line of text on how far the work is; None for silence
    observables : sums of counts to report instead of all counts
    tank : where it happens; None for the tank of the rates

    Only the statistics of the runs are kept, so memory does not grow with their number. After Ctrl-C the prediction
    comes from the runs and draws made so far, if any, and its notes say so.

    The interval comes from sampling by `Auto`, whatever the method: for each draw the mean of `RUNS_PER_DRAW` runs,
    and of these means the 2.5 % and 97.5 % quantiles, pulled towards each other by the share of their variance that is
    Monte-Carlo noise (known from the runs). It thus shows the uncertainty of the rates alone, approximately: it is made
    of quantiles of `draws` values.
    """
    began = time.process_time()
    report = progress or (lambda _: None)
    model = network if rates is None else rates.apply(network, tank)
    method = Auto() if method is None else method
    shown = model if observables is None else observables.network
    result: EnsembleStatistics | Distribution
    if isinstance(method, SamplingMethod):
        sampling = method if observables is None else observables.sampling(method, model)
        result = simulate_statistics(
            shown, sampling, initial, times, runs, seed, threads,
            covariances=False, progress=lambda done: report(f"{done} of {runs} runs"),
        )  # fmt: skip
        standard_error, error = result.standard_error(), 0.0
        unfinished = "" if result.is_complete else f"interrupted: {result.runs} of {runs} runs were made, no interval"
    else:
        solved = solve(model, method, initial, times)
        result = solved if observables is None else observables.of_distribution(solved)
        standard_error, error = np.zeros((result.times.size, len(shown.species))), result.error
        unfinished = ""
    low = high = None
    if rates is not None and not _is_bare(rates) and not unfinished:
        constants = _constants(network, rates, tank, seed, draws)
        means, noise = _draw_means(model, constants, initial, times, runs, seed, threads, report, observables)
        if len(means) < draws:
            unfinished = f"interrupted: {len(means)} of {draws} draws of the rates were made"
        if len(means) > 1:
            low, high = noise_free_limits(np.array(means), np.mean(noise, axis=0))
    return Prediction(
        shown,
        result.times,
        result.mean(),
        result.sd(),
        low,
        high,
        standard_error,
        error,
        (*evidence_notes(rates), *filter(None, [unfinished, _rounding(result)])),
        result,
        method.name,
        time.process_time() - began,
        not unfinished,
    )


def predict_passage(
    network: Network,
    rates: Rates | None,
    initial: ArrayLike,
    species: str,
    copies: int = 1,
    seed: int = 0,
    draws: int = 100,
    tank: Tank | None = None,
) -> tuple[Passage, tuple[float, float] | None]:
    """First passage at the rates' point values, and the 95 % interval of its mean that the rates' uncertainty leaves.

    Each draw of the rates is solved exactly. The interval is None where the rates carry no evidence.
    """
    model = network if rates is None else rates.apply(network, tank)
    passage = first_passage(model, initial, species, copies)
    if rates is None or _is_bare(rates):
        return passage, None
    drawn = [model.with_rates(constants) for constants in _constants(network, rates, tank, seed, draws)]
    means = [first_passage(each, initial, species, copies).mean for each in drawn]
    # No interpolation between a finite mean and an infinite one.
    low, high = np.quantile(means, LIMITS, method="inverted_cdf")
    return passage, (float(low), float(high))


def evidence_notes(rates: Rates | None) -> tuple[str, ...]:
    """Remarks on the interval of a prediction from `rates`, for the reader."""
    if rates is None:
        return ("no interval: the network's own rates are taken as known",)
    bare = rates.without_evidence()
    if _is_bare(rates):
        return ("no interval: these rates come without evidence (events and exposure)",)
    if bare:
        return (f"the interval leaves out {', '.join(bare)}: taken as known, because without evidence",)
    return ()


def _is_bare(rates: Rates) -> bool:
    return len(rates.without_evidence()) == len(rates.channels)


def _constants(network: Network, rates: Rates, tank: Tank | None, seed: int, draws: int) -> Floats:
    """Draws (draws, R) of the rate constants of the model that the rates make of `network`."""
    # A stream of its own: spawned, so that it shares nothing with the runs of the same seed.
    sequence = np.random.SeedSequence(whole_number("seed", seed, 0), spawn_key=(1,))
    rng = np.random.default_rng(sequence)
    return rates.draw_constants(network, rng, whole_number("draws", draws, 2), tank)


def _draw_means(
    model: Network,
    constants: Floats,
    initial: ArrayLike,
    times: ArrayLike,
    runs: int,
    seed: int,
    threads: int | None,
    report: Callable[[str], None],
    observables: Observables | None,
) -> tuple[list[Floats], list[Floats]]:
    """Mean counts (T, S) under each draw, and their squared Monte-Carlo errors; of the draws made before Ctrl-C."""
    # Numbers beyond those of the prediction's own runs, so that all runs are independent.
    made = simulate_draws(
        model, constants, initial, times, RUNS_PER_DRAW, seed,
        first_run=runs,
        threads=len(os.sched_getaffinity(0)) if threads is None else threads,
        weights=None if observables is None else observables.weights,
    )  # fmt: skip
    means, errors = [], []
    try:
        for d, counts in enumerate(made, start=1):
            mean, squared_error = counts.mean(axis=0), counts.var(axis=0, ddof=1) / RUNS_PER_DRAW
            means.append(mean)
            errors.append(squared_error)
            report(f"{d} of {len(constants)} draws of the rates")
    except KeyboardInterrupt:
        pass
    done = min(len(means), len(errors))  # Ctrl-C may come between the two
    return means[:done], errors[:done]


def _rounding(result: EnsembleStatistics | Distribution) -> str:
    """How well the limits of the middle 95 % of runs are known, where that is not exactly."""
    off = int(result.quantile_error().max()) if isinstance(result, EnsembleStatistics) else 0
    return f"the middle 95 % of the runs is known to {off} copies" if off else ""


def noise_free_limits(means: Floats, noise: Floats) -> tuple[Floats, Floats]:
    """2.5 % and 97.5 % quantiles (T, S) of the means (draws, T, S), freed of a noise of variance (T, S)."""
    centre = means.mean(axis=0)
    spread = means.var(axis=0, ddof=1)
    share = np.divide(spread - noise, spread, out=np.zeros_like(spread), where=spread > noise)
    low, high = np.quantile(means, LIMITS, axis=0)
    return centre + np.sqrt(share) * (low - centre), centre + np.sqrt(share) * (high - centre)
