"""Figures of calibration and validation, drawn from arrays and names; nothing here computes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from kinetics.support.arrays import Floats
from kinetics.support.plots import COLOURS

if TYPE_CHECKING:
    from matplotlib.axes import Axes

OBSERVED, PREDICTED, THIRD = COLOURS[5], COLOURS[0], COLOURS[2]  # vermilion, blue, green


class Limited(NamedTuple):
    """Values with their limits, arrays of one shape; limits nan where unknown, (0, inf) where nothing was measured."""

    values: ArrayLike
    low: ArrayLike
    high: ArrayLike


def forest_row(
    ax: Axes,
    y: float | str,
    rate: float,
    low: float,
    high: float,
    colour: str = PREDICTED,
    label: str = "",
    marker: str = "o",
) -> None:
    """One value with its interval; an arrow down from the upper limit without events, words without exposure."""
    if np.isnan(low) or np.isnan(high):
        ax.plot([rate], [y], marker, color=colour, label=label, mfc="none")  # a point of unknown precision
    elif not np.isfinite(high):
        ax.annotate("not measured", (0.5, y), xycoords=ax.get_yaxis_transform(), va="center", color=colour)
    elif rate == 0:
        bar = ax.errorbar([high], [y], xerr=[[0.5 * high], [0.0]], xuplims=True, fmt="none", ecolor=colour, label=label)
        bar.lines[1][0].set_markersize(7)
    else:
        ax.errorbar([rate], [y], xerr=[[rate - low], [high - rate]], fmt=marker, color=colour, capsize=3, label=label)


def forest(ax: Axes, names: Sequence[str], sets: Mapping[str, Limited], label: str) -> Axes:
    """Forest plot on a logarithmic axis: a line for each name, and on it one value of each set, measured ones first."""
    step = 0.8 / len(sets)
    for j, (title, limited) in enumerate(sets.items()):
        colour = PREDICTED if j == 0 else COLOURS[1 + (j - 1) % (len(COLOURS) - 1)]
        rows = zip(*map(np.asarray, limited), strict=True)
        for i, (value, low, high) in enumerate(rows):
            forest_row(ax, i + j * step, value, low, high, colour, title if i == 0 else "", "s" if j else "o")
    ax.set_yticks(range(len(names)), names)
    ax.set_ylim(len(names) - 0.3, -0.5)
    ax.set_xscale("log")
    ax.set_xlabel(label)
    ax.legend(frameon=False, fontsize="small")
    return ax


def homogeneity(
    ax: Axes, channel: str, labels: Sequence[str], rates: Limited, pooled_rate: float, p_value: float
) -> Axes:
    """The rate of one channel, group by group, with its limits, beside the rate of all groups together."""
    for i, row in enumerate(zip(*map(np.asarray, rates), strict=True)):
        forest_row(ax, i, *row)
    ax.axvline(pooled_rate, color=OBSERVED, linestyle="--", label="pooled")
    _one_line_each(ax, labels)
    ax.set_xlabel("rate constant k (1/tu)")
    ax.set_title(f"{channel}, p = {p_value:.2g}")
    ax.legend(frameon=False, fontsize="small")
    return ax


def planned_shares(ax: Axes, tanks: Sequence[str], amounts: Mapping[str, Sequence[float]]) -> Axes:
    """A bar a row, such as a channel, cut by the shares of the tanks; the whole amount stands at its end."""
    left = np.zeros(len(amounts))
    table = np.array(list(amounts.values()), dtype=float)
    whole = table.sum(axis=1)
    shares = np.divide(table, whole[:, None], out=np.zeros_like(table), where=whole[:, None] > 0)
    for i, (tank, column) in enumerate(zip(tanks, shares.T, strict=True)):
        hatch = "" if i < len(COLOURS) else "//"
        ax.barh(range(len(amounts)), column, left=left, color=COLOURS[i % len(COLOURS)], label=tank, hatch=hatch)
        left += column
    for row, total in enumerate(whole):
        ax.text(1.02, row, f"{total:.3g}", va="center", fontsize="small")
    ax.set_yticks(range(len(amounts)), list(amounts))
    ax.invert_yaxis()
    ax.set_xlim(0, 1.12)
    ax.set_xlabel("share of the expected events, and of the CPU time; totals on the right")
    ax.legend(frameon=False, fontsize="x-small", ncols=2, loc="lower center", bbox_to_anchor=(0.5, 1.0))
    return ax


def waiting_times(ax: Axes, name: str, residuals: Floats) -> Axes:
    """Survival of waits (n,) in units of their mean; a straight line if they are exponential."""
    from scipy.stats import binom

    residuals = np.sort(residuals)
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
    ax.set_title(name)
    ax.legend(frameon=False, fontsize="small")
    return ax


def trajectory(
    ax: Axes,
    species: str,
    times: Floats,
    predicted: tuple[str, Limited],
    observed: tuple[str, Limited],
    sampled: tuple[str, Floats] | None = None,
    title: str = "",
) -> Axes:
    """Mean copies (T,) of one species: the prediction with its band, the runs with their interval.

    predicted, observed : label, and values with limits (T,); sampled : label and mean (T,) of SSA runs, dotted
    """
    label, band = predicted
    ax.fill_between(times, band.low, band.high, color=PREDICTED, alpha=0.25, linewidth=0)
    ax.plot(times, band.values, color=PREDICTED, label=label)
    if sampled is not None:
        ax.plot(times, sampled[1], ":", color=THIRD, label=sampled[0])
    label, band = observed
    ax.fill_between(times, band.low, band.high, color=OBSERVED, alpha=0.2, linewidth=0)
    ax.plot(times, band.values, "--", color=OBSERVED, label=label)
    ax.set_ylim(bottom=0)
    ax.set_xlabel("time (tu)")
    ax.set_ylabel(f"{species} (copies, mean)")
    ax.set_title(title)
    ax.legend(frameon=False, fontsize="small")
    return ax


def first_times(
    ax: Axes,
    species: str,
    observed: Floats,
    horizon: float,
    predicted: tuple[str, Floats, Floats],
    predicted_mean: float,
) -> Axes:
    """Share of runs that have the first copy, with exact pointwise 95 % limits, beside the predicted distribution.

    observed : (n,) first times, nan where none was seen by the horizon; predicted : label, times, distribution function
    """
    from scipy.special import betaincinv

    n = observed.size
    seen = np.sort(observed[np.isfinite(observed)])
    reached = np.concatenate([np.arange(seen.size + 1), [seen.size]])
    moments = np.concatenate([[0.0], seen, [horizon]])
    low = np.where(reached > 0, betaincinv(np.maximum(reached, 1), n - reached + 1, 0.025), 0.0)
    high = np.where(reached < n, betaincinv(reached + 1, np.maximum(n - reached, 1), 0.975), 1.0)
    label, times, curve = predicted
    ax.plot(times, curve, color=PREDICTED, label=label)
    ax.fill_between(moments, low, high, step="post", color=OBSERVED, alpha=0.2, linewidth=0)
    ax.step(moments, reached / n, where="post", color=OBSERVED, label=f"mechanics, {n} runs")
    if seen.size == n:  # the curve is flat from the last one on
        ax.set_xlim(0, min(horizon, 1.5 * max(seen[-1], predicted_mean)))
    ax.set_ylim(0, 1)
    ax.set_xlabel("time (tu)")
    ax.set_ylabel(f"share of runs with a {species}")
    ax.legend(frameon=False, fontsize="small", loc="lower right")
    return ax


def rates_by_point(ax: Axes, channel: str, points: Sequence[str], rates: Limited, events: Sequence[int]) -> Axes:
    """The rate of one channel at each point, with its limits and events."""
    for i, (row, n) in enumerate(zip(zip(*map(np.asarray, rates), strict=True), events, strict=True)):
        forest_row(ax, i, *row)
        ax.annotate(f"{n}", (1.01, i), xycoords=ax.get_yaxis_transform(), va="center", fontsize="small")
    _one_line_each(ax, points)
    ax.set_xlim(left=0)
    ax.set_xlabel("rate constant k (1/tu), 95 % interval; events on the right")
    ax.set_title(channel)
    return ax


def first_by_point(
    ax: Axes, points: Sequence[str], seen: Limited, predicted: Limited, p_values: Sequence[float], label: str
) -> Axes:
    """Mean first times at each point: seen, and predicted from the rates of the other points."""
    y = np.arange(len(points))
    for place, limited, marker, colour, name in (
        (y - 0.12, seen, "o", OBSERVED, "mechanics, 95 % interval"),
        (y + 0.12, predicted, "s", PREDICTED, "predicted, 95 % by the rates"),
    ):
        value, low, high = map(np.asarray, limited)
        reach = np.maximum([value - low, high - value], 0)
        ax.errorbar(value, place, xerr=reach, fmt=marker, color=colour, capsize=3, label=name)
    for i, p_value in enumerate(p_values):
        text = f"p = {p_value:.2g}"
        ax.annotate(text, (1.01, i), xycoords=ax.get_yaxis_transform(), va="center", fontsize="small")
    _one_line_each(ax, points)
    ax.set_xlim(left=0)
    ax.set_xlabel(label)
    ax.legend(frameon=False, fontsize="small")
    return ax


def _one_line_each(ax: Axes, names: Sequence[str]) -> None:
    """Names along the vertical axis, the first one at the top."""
    ax.set_yticks(np.arange(len(names)), names)
    ax.set_ylim(len(names) - 0.5, -0.5)
