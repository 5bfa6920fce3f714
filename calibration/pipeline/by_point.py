"""Rates at each point of a study, and first times predicted from the rates of other points of the same scene."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from calibration import plots
from calibration.estimating.estimate import Calibration, estimate
from calibration.validating.first_times import FirstTimeComparison, compare_first_times
from kinetics.network import Network
from kinetics.predicting.over_draws import noise_free_limits
from kinetics.runs import JumpPath
from kinetics.sampling import Direct
from kinetics.support.arrays import Floats, Ints
from kinetics.support.intervals import posterior_draws
from kinetics.support.shown import on_axes

if TYPE_CHECKING:
    from matplotlib.axes import Axes

GROUPS = 499  # draws of the rates behind a p-value
RUNS = 200  # SSA runs under each draw
GRID = 201  # times at which these are looked at
EXACT_STATES = 20_000  # with more of them, SSA runs stand in for the exact solution


@dataclass(frozen=True, eq=False)
class PointRuns:
    """Runs of one point, which end with the first copy of the target or at the study's cap.

    kin : the same for points whose rates must agree, if the tank is well mixed: those of one scene
    """

    title: str
    kin: str
    paths: tuple[JumpPath, ...]


@dataclass(frozen=True, eq=False)
class PointRates:
    """The rates from the runs of one point.

    first : its first times beside their distribution under the rates of its kin, which its own runs are no part of;
        None: no kin
    low, high : what the kin's rates leave open of its predicted mean, 95 %, tu
    rates_from : titles of the kin
    """

    title: str
    calibration: Calibration
    first: FirstTimeComparison | None = None
    low: float = np.nan
    high: float = np.nan
    rates_from: tuple[str, ...] = ()


@dataclass(frozen=True, eq=False)
class RatesByPoint:
    """Rates of all points of a study. cap : tu at which runs without a target ended"""

    points: tuple[PointRates, ...]
    species: str
    cap: float
    seed: int

    def rates_table(self) -> list[dict[str, Any]]:
        """One row per point and channel that could have fired: events, exposure (tu), rate and limits (1/tu)."""
        return [
            {"point": point.title} | {key: row[key] for key in row if key != "note"}
            for point in self.points
            for row in point.calibration.table()
            if row["exposure"] > 0
        ]

    def first_table(self) -> list[dict[str, Any]]:
        """One row per point that others predict: means of min(first time, cap), tu, observed and predicted."""
        rows = []
        for point in self.points:
            if (first := point.first) is not None:
                at_cap = 1.0 - first.curve[-1]
                rows.append(
                    {
                        "point": point.title,
                        "runs": first.observed.size,
                        "none_by_cap": first.censored,
                        "none_by_cap_predicted": first.observed.size * float(at_cap),
                        "mean": first.observed_mean,
                        "low": first.low,
                        "high": first.high,
                        "predicted": first.predicted_mean,
                        "predicted_low": point.low,
                        "predicted_high": point.high,
                        "p_value": first.p_value,
                        "rates_from": "; ".join(point.rates_from),
                    }
                )
        return rows

    @on_axes
    def plot(self, ax: Axes, channel: str) -> Axes:
        """The rate of one channel, point by point, with exact 95 % intervals; returns `ax`."""
        found = [point.calibration[channel] for point in self.points]
        low, high = np.array([estimate.interval() for estimate in found]).T
        rates = plots.Limited([estimate.rate for estimate in found], low, high)
        titles, events = [point.title for point in self.points], [estimate.events for estimate in found]
        return plots.rates_by_point(ax, channel, titles, rates, events)

    def plot_first(self, ax: Axes) -> Axes:
        """Mean first times, seen and predicted, point by point; returns `ax`."""
        rows = self.first_table()
        seen, predicted = (
            plots.Limited(*(np.array([row[key] for row in rows]) for key in keys))
            for keys in (("mean", "low", "high"), ("predicted", "predicted_low", "predicted_high"))
        )
        titles, p_values = ([row[key] for row in rows] for key in ("point", "p_value"))
        label = f"mean time to the first {self.species}, until {self.cap:g} tu (tu)"
        return plots.first_by_point(ax, titles, seen, predicted, p_values, label)


def rates_by_point(points: Sequence[PointRuns], species: str, cap: float, seed: int = 0) -> RatesByPoint:
    """Rates at each point, and first times predicted from the rates of its kin.

    cap : tu until which every run would have been watched, had it not ended with its first `species`

    A channel that no run of the kin could have fired counts as one that does not happen.
    """
    for point in points:
        if not point.paths:
            raise ValueError(f"no runs at {point.title}; make them first")
    exposures = [estimate(point.paths).runs for point in points]
    found = []
    for i, (point, own) in enumerate(zip(points, exposures, strict=True)):
        kin = [j for j, other in enumerate(points) if j != i and other.kin == point.kin]
        if not kin:
            found.append(PointRates(point.title, estimate(own)))
        else:
            others = estimate(run for j in kin for run in exposures[j])
            rates, draws = _rates(others, seed)
            network = others.network.with_rates(rates)
            first = compare_first_times(
                network,
                point.paths,
                species,
                seed=seed,
                rate_draws=draws,
                max_states=EXACT_STATES,
                horizon=cap,
            )
            low, high = _left_open(network, point.paths[0].initial, species, cap, draws, seed)
            low, high = min(low, first.predicted_mean), max(high, first.predicted_mean)
            titles = tuple(points[j].title for j in kin)
            found.append(PointRates(point.title, estimate(own), first, low, high, titles))
    return RatesByPoint(tuple(found), species, cap, seed)


def most_seen(found: RatesByPoint) -> tuple[str, ...]:
    """Channels that fired, by the events that all points saw, the most first."""
    events = np.sum([point.calibration.total.events for point in found.points], axis=0)
    names = found.points[0].calibration.network.channels
    return tuple(names[j] for j in np.argsort(-events, kind="stable") if events[j])


def _rates(calibration: Calibration, seed: int) -> tuple[Floats, Floats]:
    """Posterior means (R,) of the rates, and draws (groups, R), under Jeffreys' prior; 0 without exposure."""
    rates = [0.0] * len(calibration.estimates)
    for r, e in enumerate(calibration.estimates):
        if e.is_measured:
            shape, total = e.posterior
            rates[r] = shape / total
    events = [e.events if e.is_measured else None for e in calibration.estimates]
    rng = np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(1,)))
    exposure = [e.exposure for e in calibration.estimates]
    return np.array(rates), posterior_draws(rng, GROUPS, rates, events, exposure)


def _left_open(
    network: Network, initial: Ints, species: str, cap: float, draws: Floats, seed: int
) -> tuple[float, float]:
    """Middle 95 % of the mean of min(first time, cap) over draws of the rates, its sampling noise taken out."""
    index, times = network.index(species), np.linspace(0.0, cap, GRID)
    stays = network.reactants[:, index] == 0
    means, noise = np.empty(len(draws)), np.empty(len(draws))
    for g, drawn in enumerate(draws):
        runs = Direct().simulate(network.with_rates(drawn * stays), initial, times, RUNS, seed, first_run=g * RUNS)
        waits = np.trapezoid((runs.counts[:, :, index] < 1).astype(float), times, axis=1)
        means[g], noise[g] = waits.mean(), waits.var(ddof=1) / RUNS
    low, high = noise_free_limits(means, noise.mean())
    return float(low), float(high)
