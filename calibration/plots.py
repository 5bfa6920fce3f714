"""Figures of calibration and cross-validation, drawn onto given axes. The results call these."""

from __future__ import annotations

from collections.abc import Mapping
from math import factorial
from typing import TYPE_CHECKING

import numpy as np

from kinetics.network import Network
from kinetics.support.arrays import Floats
from kinetics.support.plots import COLOURS

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from calibration.estimating.diagnostics import Homogeneity, WaitingTimes
    from calibration.estimating.estimate import Calibration
    from calibration.pipeline.by_point import RatesByPoint
    from calibration.validating.crossvalidation import CrossValidation
    from calibration.validating.first_times import FirstTimes
    from kinetics.rates import Rates

OBSERVED, PREDICTED, THIRD = COLOURS[5], COLOURS[0], COLOURS[2]  # vermilion, blue, green


def forest_row(
    ax: Axes,
    y: float | str,
    rate: float,
    low: float | None,
    high: float | None,
    colour: str = PREDICTED,
    label: str = "",
    marker: str = "o",
) -> None:
    """One value with its interval; an arrow down from the upper limit without events, words without exposure."""
    if high is None or low is None:
        ax.plot([rate], [y], marker, color=colour, label=label, mfc="none")  # a point of unknown precision
    elif not np.isfinite(high):
        ax.annotate("not measured", (0.5, y), xycoords=ax.get_yaxis_transform(), va="center", color=colour)
    elif rate == 0:
        bar = ax.errorbar([high], [y], xerr=[[0.5 * high], [0.0]], xuplims=True, fmt="none", ecolor=colour, label=label)
        bar.lines[1][0].set_markersize(7)
    else:
        ax.errorbar([rate], [y], xerr=[[rate - low], [high - rate]], fmt=marker, color=colour, capsize=3, label=label)


def rates(
    ax: Axes, calibration: Calibration, level: float = 0.95, references: Mapping[str, Rates] | None = None
) -> Axes:
    """Forest plot of k N per distinct combination of reactants, so that tables of other conventions can stand beside.

    Between pairs of unlike reactants the conventions agree; the factor 2 of like pairs is taken out (for the literal
    product s * s up to one part in s).
    """
    network = calibration.network
    scale = per_combination(network)
    n_channels, others = len(network.channels), dict(references or {})
    step = 0.8 / (1 + len(others))
    for i, estimate in enumerate(calibration.estimates):
        low, high = estimate.interval(level)
        label = f"measured, {100 * level:g} % interval" if i == 0 else ""
        forest_row(ax, i, estimate.rate * scale[i], low * scale[i], high * scale[i], PREDICTED, label)
    for j, (name, reference) in enumerate(others.items()):
        known = reference.apply(network)
        scale = per_combination(known)
        colour = COLOURS[1 + j % (len(COLOURS) - 1)]
        for i, (channel, rate) in enumerate(zip(network.channels, known.known_rates * scale, strict=True)):
            evidence = reference.channels[channel]
            bottom, top = (None if limit is None else limit * scale[i] for limit in (evidence.low, evidence.high))
            forest_row(ax, i + (j + 1) * step, rate, bottom, top, colour, name if i == 0 else "", "s")
    ax.set_yticks(range(n_channels), network.channels)
    ax.set_ylim(n_channels - 0.3, -0.5)
    ax.set_xscale("log")
    ax.set_xlabel("rate per combination of reactants, k N (1/tu)")
    ax.legend(frameon=False, fontsize="small")
    return ax


def per_combination(network: Network) -> Floats:
    """What k has to be multiplied by (R,) to give the rate of one distinct combination of reactants."""
    if network.combinations == "distinct":
        return network.ways
    like = [np.prod([factorial(int(n)) for n in needed]) for needed in network.reactants]
    return network.ways * np.array(like, dtype=float)


def homogeneity(ax: Axes, groups: Homogeneity) -> Axes:
    """The rate of one channel, group by group, with exact 95 % intervals."""
    low, high = groups.intervals()
    for i, rate in enumerate(groups.rates):
        forest_row(ax, i, rate, low[i], high[i])
    ax.axvline(groups.events.sum() / groups.exposure.sum(), color=OBSERVED, linestyle="--", label="pooled")
    ax.set_yticks(range(len(groups.labels)), groups.labels)
    ax.set_ylim(len(groups.labels) - 0.5, -0.5)
    ax.set_xlabel("rate constant k (1/tu)")
    ax.set_title(f"{groups.channel}, p = {groups.p_value:.2g}")
    ax.legend(frameon=False, fontsize="small")
    return ax


def waiting_times(ax: Axes, waits: WaitingTimes) -> Axes:
    """Survival of the waits on the clock of their own hazard; a straight line if they are exponential."""
    from scipy.stats import binom

    residuals = np.sort(waits.residuals)
    n = residuals.size
    x = np.linspace(0.0, max(4.0, residuals.max(initial=0.0)), 200)
    ax.plot(x, np.exp(-x), color=OBSERVED, label="exponential")
    if n:
        low, high = (binom.ppf(q, n, np.exp(-x)) / n for q in (0.025, 0.975))
        ax.fill_between(x, low, high, color=OBSERVED, alpha=0.2, linewidth=0, label="95 % of samples of this size")
        survival = 1 - np.arange(n + 1) / n
        ax.step(np.append(0.0, residuals), survival, where="post", color=PREDICTED, label=f"{n} waits")
    ax.set_yscale("log")
    ax.set_ylim(0.3 / max(n, 3), 1.3)
    ax.set_xlabel("wait in units of its mean")
    ax.set_ylabel("share still waiting")
    ax.set_title(waits.name)
    ax.legend(frameon=False, fontsize="small")
    return ax


def trajectory(ax: Axes, comparison: CrossValidation, species: str) -> Axes:
    """Mean copies of one species: held-out runs with their interval, the prediction with its band."""
    s, times, percent = comparison.network.index(species), comparison.times, f"{100 * comparison.level:g} %"
    ax.fill_between(times, comparison.low[:, s], comparison.high[:, s], color=PREDICTED, alpha=0.25, linewidth=0)
    sampled = f"SSA, {comparison.cost.ssa_runs} runs"
    label = f"{'exact' if comparison.is_exact else sampled}, {percent} band for {comparison.runs} runs"
    ax.plot(times, comparison.predicted_mean[:, s], color=PREDICTED, label=label)
    if comparison.is_exact:
        ax.plot(times, comparison.ssa_mean[:, s], ":", color=THIRD, label=sampled)
    low, high = comparison.observed_low[:, s], comparison.observed_high[:, s]
    ax.fill_between(times, low, high, color=OBSERVED, alpha=0.2, linewidth=0)
    ax.plot(times, comparison.observed_mean[:, s], "--", color=OBSERVED, label=f"mechanics, {percent} interval")
    ax.set_ylim(bottom=0)
    ax.set_xlabel("time (tu)")
    ax.set_ylabel(f"{species} (copies, mean)")
    ax.set_title(comparison.label)
    ax.legend(frameon=False, fontsize="small")
    return ax


def first_times(ax: Axes, first: FirstTimes) -> Axes:
    """Share of runs that have the first copy, with exact pointwise 95 % limits, beside the predicted law."""
    from scipy.special import betaincinv

    n = first.observed.size
    seen = np.sort(first.observed[np.isfinite(first.observed)])
    reached = np.concatenate([np.arange(seen.size + 1), [seen.size]])
    moments = np.concatenate([[0.0], seen, [first.horizon]])
    low = np.where(reached > 0, betaincinv(np.maximum(reached, 1), n - reached + 1, 0.025), 0.0)
    high = np.where(reached < n, betaincinv(reached + 1, np.maximum(n - reached, 1), 0.975), 1.0)
    # with a rate of 0 the chain may end elsewhere, and the mean is infinite
    mean = f", mean {first.mean:.4g} tu" if np.isfinite(first.mean) else ""
    law = f"exact{mean}" if first.is_exact else f"SSA, within {first.curve_error:.1g} (1 s.e.)"
    ax.plot(first.curve_times, first.curve, color=PREDICTED, label=law)
    ax.fill_between(moments, low, high, step="post", color=OBSERVED, alpha=0.2, linewidth=0)
    ax.step(moments, reached / n, where="post", color=OBSERVED, label=f"mechanics, {n} runs")
    if seen.size == n:  # the curve is flat from the last one on
        ax.set_xlim(0, min(first.horizon, 1.5 * max(seen[-1], first.predicted_mean)))
    ax.set_ylim(0, 1)
    ax.set_xlabel("time (tu)")
    ax.set_ylabel(f"share of runs with a {first.species}")
    ax.legend(frameon=False, fontsize="small", loc="lower right")
    return ax


def rates_by_point(ax: Axes, found: RatesByPoint, channel: str) -> Axes:
    """The rate of one channel at each point, with exact 95 % intervals and its events."""
    for i, point in enumerate(found.points):
        estimate = point.calibration[channel]
        low, high = estimate.interval()
        forest_row(ax, i, estimate.rate, low, high)
        ax.annotate(f"{estimate.events}", (1.01, i), xycoords=ax.get_yaxis_transform(), va="center", fontsize="small")
    ax.set_yticks(range(len(found.points)), [point.title for point in found.points])
    ax.set_ylim(len(found.points) - 0.5, -0.5)
    ax.set_xlim(left=0)
    ax.set_xlabel("rate constant k (1/tu), 95 % interval; events on the right")
    ax.set_title(channel)
    return ax


def first_by_point(ax: Axes, found: RatesByPoint) -> Axes:
    """Mean of min(first time, cap) at each point: seen, and predicted from the rates of the other points."""
    rows = found.first_table()
    y = np.arange(len(rows))
    keys = ("mean", "low", "high", "predicted", "predicted_low", "predicted_high")
    seen, low, high, predicted, bottom, top = (np.array([row[key] for row in rows]) for key in keys)
    for place, value, reach, marker, colour, label in (
        (y - 0.12, seen, [seen - low, high - seen], "o", OBSERVED, "mechanics, 95 % interval"),
        (y + 0.12, predicted, [predicted - bottom, top - predicted], "s", PREDICTED, "predicted, 95 % by the rates"),
    ):
        ax.errorbar(value, place, xerr=np.maximum(reach, 0), fmt=marker, color=colour, capsize=3, label=label)
    for i, row in enumerate(rows):
        text = f"p = {row['p_value']:.2g}"
        ax.annotate(text, (1.01, i), xycoords=ax.get_yaxis_transform(), va="center", fontsize="small")
    ax.set_yticks(y, [row["point"] for row in rows])
    ax.set_ylim(len(rows) - 0.5, -0.5)
    ax.set_xlim(left=0)
    ax.set_xlabel(f"mean time to the first {found.species}, until {found.cap:g} tu (tu)")
    ax.legend(frameon=False, fontsize="small")
    return ax
