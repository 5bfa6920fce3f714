"""Posterior predictive checks: whole runs at parameters drawn from the posterior, beside those that were observed."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from calibration.estimating.model_fit import ModelFit
from kinetics.markov.panels import EventLikelihood, Likelihood, PanelLikelihood, PanelRun
from kinetics.network import Model, Network
from kinetics.rates.fitted import ParameterPosterior, PosteriorDraws
from kinetics.sampling import Auto, simulate_posterior
from kinetics.support import plots
from kinetics.support.arrays import Floats, Ints, whole_number
from kinetics.support.shown import on_axes

DRAWS, RUNS = 200, 5  # of the parameters, and simulated runs under each
GRID = 60  # times of a band
MOST_RUNS = 6  # observed runs that are drawn, of those that start apart; more that start alike are drawn by their mean
MOST_TIMES = 40  # different times at which they were looked at


@dataclass(frozen=True, eq=False)
class PredictiveBand:
    """The middle 95 % of simulated runs that start as an observed one, with what was seen of it.

    Of many runs that start alike it is that of their mean.

    title : of the run; "" for all of them, if they start alike
    columns : names (C,)
    times : (T,), tu
    low, middle, high : (T, C) quantiles of 2.5, 50 and 97.5 % of what would be written down
    seen_times, seen : (n,) and (n, C) what was; nan where it was not looked at
    """

    title: str
    columns: tuple[str, ...]
    times: Floats
    low: Floats
    middle: Floats
    high: Floats
    seen_times: Floats
    seen: Floats
    time_unit: str
    of_means: bool = False

    @property
    def inside(self) -> tuple[int, int]:
        """How many of the numbers seen lie in their band, and how many there are."""
        within, n = 0, 0
        for c in range(len(self.columns)):
            known = ~np.isnan(self.seen[:, c])
            at = self.seen_times[known]
            low, high = (np.interp(at, self.times, each[:, c]) for each in (self.low, self.high))
            # Bands are known at the times of the grid only: between two of them the wider one holds.
            low, high = (low, high) if self.of_means else (np.floor(low), np.ceil(high))
            within += int(((self.seen[known, c] >= low) & (self.seen[known, c] <= high)).sum())
            n += int(known.sum())
        return within, n

    @on_axes
    def plot(self, ax: Any) -> Any:
        """Bands and medians over time, and what was seen as dots."""
        for c, name in enumerate(self.columns):
            colour = plots.colour(c)
            ax.fill_between(self.times, self.low[:, c], self.high[:, c], color=colour, alpha=0.2, lw=0)
            ax.plot(self.times, self.middle[:, c], color=colour, lw=1.0)
            ax.plot(self.seen_times, self.seen[:, c], "o", color=colour, ms=3.5, label=name)
        unit = f" ({self.time_unit})" if self.time_unit else ""
        ax.set(xlabel=f"time{unit}", ylabel="mean count" if self.of_means else "count", title=self.title)
        ax.legend(fontsize="small")
        return ax


def predictive_bands(fit: ModelFit, drawn: PosteriorDraws | None, seed: int = 0) -> list[PredictiveBand]:
    """Bands of the first runs observed; one for all if they start alike, as snapshots do.

    Of many runs that start alike but were looked at at different times there is none: residuals show these.

    drawn : from the posterior; None for the estimates alone

    Cost: 1,000 simulated runs for each band.

    >>> from calibration import fit_model
    >>> from calibration.estimating.predictive_bands import predictive_bands
    >>> from kinetics import Model, Network
    >>> from kinetics.markov.panels import PanelData, PanelLikelihood, PanelRun
    >>> decay = Model.of(Network.from_text("A -> B, k", k=1))
    >>> fit = fit_model(PanelLikelihood(decay, PanelData({"A": {"A": 1}}, [PanelRun([100, 0], [2.0], [[37]])])))
    >>> [band.inside for band in predictive_bands(fit, None, seed=1)]
    [(1, 1)]
    """
    rng = np.random.default_rng(whole_number("seed", seed, 0))
    bands = []
    likelihood = fit.likelihood
    for name, part in likelihood.groups.items():
        table = None
        if drawn is not None:
            called = {likelihood.called(each, name): each for each in part.parameters if each not in part.observed}
            kept = [k for k, each in enumerate(drawn.names) if each in called]
            table = ([called[drawn.names[k]] for k in kept], drawn.table[:, kept])
        bands += _of_part(name, part, likelihood.point_of(name, fit.point), table, rng)
    return bands


def _of_part(
    name: str,
    part: Likelihood,
    point: dict[str, float],
    table: tuple[list[str], Floats] | None,
    rng: np.random.Generator,
) -> list[PredictiveBand]:
    """The bands of one set of data."""
    network = part.network_at(point)
    if isinstance(part, EventLikelihood):
        columns: dict[str, Mapping[str, float]] = {species: {species: 1.0} for species in network.species}
        runs = [
            PanelRun(
                path.initial, path.times, path.states[1:].astype(float), fired=np.zeros(path.times.size, dtype=np.int64)
            )
            for path in part.data.paths
        ]
        observations: list[Any] = [None] * len(columns)
    elif isinstance(part, PanelLikelihood):
        data = part.data_at(point)
        columns, runs = dict(data.columns), list(data.runs)
        observations = list(data.observations.values())
    else:
        raise TypeError(f"runs of {type(part).__name__} are not known")
    weights = np.array([[columns[c].get(s, 0.0) for s in network.species] for c in columns])
    posterior = None
    if table is not None and table[0]:
        posterior = ParameterPosterior(network, tuple(table[0]), table[1])
    alike = len({(run.initial.tobytes(), run.chances.tobytes(), run.start) for run in runs}) == 1
    shown: Sequence[tuple[str, list[PanelRun]]] = (
        [("", runs)] if alike else [(f"run {k + 1}", [run]) for k, run in enumerate(runs[:MOST_RUNS])]
    )
    bands = []
    for title, group in shown:
        means = _means(group) if len(group) > MOST_RUNS else None
        if len(group) > MOST_RUNS and means is None:
            continue
        end = max(float(run.times[-1] - run.start) for run in group)
        grid = np.linspace(0.0, end, GRID)
        variants: Any = np.repeat(network.known_rates[None, :], DRAWS, axis=0)
        if posterior is not None:
            variants = posterior.variants(posterior.draw(rng, DRAWS))
        elif network.laws:
            variants = [network] * DRAWS
        counted = _simulated(network, group[0], variants, grid, rng) @ weights.T
        for c, observation in enumerate(observations):
            if observation is not None:
                counted[..., c] = observation.drawn(counted[..., c], np.nan, rng)
        label = ", ".join(filter(None, [name, title]))
        if means is None:
            low, middle, high = np.quantile(counted, (0.025, 0.5, 0.975), axis=0)
            seen_times = np.concatenate([run.times for run in group]) - group[0].start
            seen = np.concatenate([run.seen for run in group])
        else:
            seen_times, seen, n = means
            middle, half = _of_mean(counted, np.interp(grid, seen_times, n))
            low, high = middle - half, middle + half
        bands.append(
            PredictiveBand(
                label, tuple(columns), grid, low, middle, high, seen_times, seen, network.time_unit, means is not None
            )
        )
    return bands


def _simulated(network: Network, like: PanelRun, variants: Any, grid: Floats, rng: np.random.Generator) -> Ints:
    """Counts (DRAWS * RUNS, T, S) of runs that start as one that was observed, those of a draw side by side."""
    starts = rng.choice(len(like.initial), (DRAWS, RUNS), p=like.chances)
    made = np.empty((DRAWS, RUNS, grid.size, len(network.species)), dtype=np.int64)
    for start in np.unique(starts).tolist():
        model = Model.of(network, like.initial[start])
        for runs in np.unique((starts == start).sum(axis=1)).tolist():
            mine = np.flatnonzero((starts == start).sum(axis=1) == runs)
            if not runs:
                continue
            chosen = [variants[d] for d in mine.tolist()]
            drawn = simulate_posterior(
                model, chosen if network.laws else np.array(chosen), grid, runs, int(rng.integers(2**63)), method=Auto()
            )
            for d, counts in zip(mine.tolist(), drawn, strict=True):
                made[d, starts[d] == start] = counts
    return made.reshape(-1, *made.shape[2:])


def _means(group: Sequence[PanelRun]) -> tuple[Floats, Floats, Floats] | None:
    """Times (n,), means (n, C) over runs that start alike of what was seen then, and the number (n,) of these runs.

    None if they were not looked at at the same times: who is still looked at late may not be like the others.
    """
    is_once = all(run.times.size == 1 for run in group)
    alike = len({run.times.tobytes() for run in group}) == 1
    times = np.concatenate([run.times for run in group]) - group[0].start
    each = np.unique(times)
    if not (is_once or alike) or each.size > MOST_TIMES or any((np.asarray(run.fired) >= 0).any() for run in group):
        return None
    seen = np.concatenate([run.seen for run in group])
    numbers = np.array([(times == time).sum() for time in each], dtype=float)
    return each, np.array([np.nanmean(seen[times == time], axis=0) for time in each]), numbers


def _of_mean(counted: Floats, n: Floats) -> tuple[Floats, Floats]:
    """Mean (T, C), and half of its 95 % interval for n (T,) runs, of simulated runs (DRAWS * RUNS, T, C)."""
    draws = counted.reshape(DRAWS, RUNS, *counted.shape[1:])
    within = draws.var(axis=1, ddof=1).mean(axis=0)
    between = np.maximum(draws.mean(axis=1).var(axis=0, ddof=1) - within / RUNS, 0.0)
    return counted.mean(axis=0), 1.96 * np.sqrt(within / np.maximum(n, 1.0)[:, None] + between)
