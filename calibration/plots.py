"""Figures of calibration and validation, drawn from arrays and names; nothing here computes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from kinetics.support.arrays import Floats, divided
from kinetics.support.intervals import binomial_limits
from kinetics.support.packages import stats
from kinetics.support.plots import COLOURS

if TYPE_CHECKING:
    from matplotlib.axes import Axes

NAMED = 40  # groups that have room for a line of their own
OBSERVED, PREDICTED = COLOURS[7], COLOURS[0]  # mechanics are black everywhere; predictions of a species have its colour


class Limited(NamedTuple):
    """Values with their limits, arrays of one shape; limits nan if unknown, (0, inf) where nothing was measured."""

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


def homogeneity(ax: Axes, channel: str, labels: Sequence[str], rates: Limited, p_value: float) -> Axes:
    """The rate of one channel, group by group, with its limits, in units of the rate of all groups together.

    More groups than have room for a name are put in the order of their rates; longer intervals are then cut off.
    """
    rows = list(zip(*map(np.asarray, rates), strict=True))
    if len(rows) <= NAMED:
        for i, row in enumerate(rows):
            forest_row(ax, i, *row)
        _one_line_each(ax, labels)
    else:
        values, low, high = np.array(sorted(rows)).T
        ax.hlines(np.arange(values.size), low, np.minimum(high, 1e3), color=PREDICTED, linewidth=0.6, alpha=0.5)
        ax.plot(values, np.arange(values.size), ".", color=PREDICTED, markersize=3)
        ax.set_xlim(-0.05, 1.2 * max(values.max(), 1.0))
        ax.set_ylabel(f"{values.size} groups, in the order of their rates")
    ax.axvline(1.0, color=OBSERVED, linestyle="--", label="pooled")
    ax.set_xlabel("rate in units of the pooled rate, 95 % interval")
    ax.set_title(f"{channel}, p = {p_value:.2g}")
    ax.legend(frameon=len(rows) > NAMED, fontsize="small")
    return ax


def drift(ax: Axes, channel: str, positions: Floats) -> Axes:
    """Share of events by share of integrated hazard (n,), with the band that 95 % of steady rates keep to."""
    n = positions.size
    reach = stats.kstwo.ppf(0.95, n)
    ax.fill_between(
        [0, 1], [-reach, 1 - reach], [reach, 1 + reach], color=OBSERVED, alpha=0.2, linewidth=0, label="95 % if steady"
    )
    ax.plot([0, 1], [0, 1], color=OBSERVED, label="steady rate")
    shares = np.arange(n + 1) / n
    ax.step(np.append(0.0, np.sort(positions)), shares, where="post", color=PREDICTED, label=f"{n} events")
    ax.set_xlim(0, 1)
    ax.set_ylim(0, 1)
    ax.set_xlabel("share of the integrated hazard")
    ax.set_ylabel("share of the events")
    ax.set_title(channel)
    ax.legend(frameon=False, fontsize="small")
    return ax


def seen_and_expected(ax: Axes, title: str, seen: int, expected: float) -> Axes:
    """Events seen beside the Poisson distribution about those expected."""
    low, high = (float(stats.poisson.ppf(q, expected)) for q in (1e-4, 1 - 1e-4))
    counts = np.arange(max(low, 0), max(high, 3) + 1)
    ax.bar(counts, stats.poisson.pmf(counts, expected), color=OBSERVED, alpha=0.3, label=f"{expected:.3g} expected")
    ax.axvline(seen, color=PREDICTED, label=f"{seen} seen")
    ax.set_xlabel("inverse joins within the window")
    ax.set_ylabel("probability")
    ax.set_title(title)
    ax.legend(frameon=False, fontsize="small")
    return ax


def p_values(ax: Axes, rising: Sequence[float], names: Sequence[str]) -> Axes:
    """All p-values, rising, beside those expected of as many true nulls; the first ones by name."""
    shown = np.maximum(rising, 1e-300)
    expected = (np.arange(shown.size) + 0.5) / max(shown.size, 1)
    ax.loglog(expected, expected, color=OBSERVED, label="if the model holds")
    ax.loglog(expected, shown, "o", color=PREDICTED, mfc="none", label=f"{shown.size} tests")
    step = max((1.0 / shown.min(initial=1.0)) ** 0.05, 1.6)  # a twentieth of the axis, so that no name covers another
    below = np.inf
    for x, y, name in reversed(list(zip(expected, shown, names[:6], strict=False))):
        below = min(y, below / step)
        ax.annotate(
            name, (x, y), (1.4 * x, below), va="center", fontsize="x-small",
            arrowprops={"arrowstyle": "-", "linewidth": 0.4, "shrinkB": 3},
        )  # fmt: skip
    ax.set_ylim(top=2.0)
    ax.set_xlabel("p expected at this rank")
    ax.set_ylabel("p of the test")
    ax.legend(frameon=False, fontsize="small", loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=2)
    return ax


def planned_shares(ax: Axes, tanks: Sequence[str], amounts: Mapping[str, Sequence[float]]) -> Axes:
    """A bar a row, such as a channel, cut by the shares of the tanks; the whole amount stands at its end."""
    left = np.zeros(len(amounts))
    table = np.array(list(amounts.values()), dtype=float)
    whole = table.sum(axis=1)
    shares = divided(table, whole[:, None])
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
    residuals = np.sort(residuals)
    n = residuals.size
    x = np.linspace(0.0, max(4.0, residuals.max(initial=0.0)), 200)
    ax.plot(x, np.exp(-x), color=OBSERVED, label="exponential")
    if n:
        low, high = (stats.binom.ppf(q, n, np.exp(-x)) / n for q in (0.025, 0.975))
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
    colour: str = PREDICTED,
) -> Axes:
    """Mean copies (T,) of one species: the prediction with its band, in the species' colour, and the runs' interval.

    predicted, observed : label, and values with limits (T,); sampled : label and mean (T,) of SSA runs, dotted
    """
    label, band = predicted
    ax.fill_between(times, band.low, band.high, color=colour, alpha=0.25, linewidth=0)
    ax.plot(times, band.values, color=colour, label=label)
    if sampled is not None:
        ax.plot(times, sampled[1], ":", color=colour, label=sampled[0])
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
    colour: str = PREDICTED,
) -> Axes:
    """Share of runs that have the first copy, with exact pointwise 95 % limits, beside the predicted distribution.

    observed : (n,) first times, nan if none was seen by the horizon; predicted : label, times, distribution function
    """
    n = observed.size
    seen = np.sort(observed[np.isfinite(observed)])
    reached = np.concatenate([np.arange(seen.size + 1), [seen.size]])
    moments = np.concatenate([[0.0], seen, [horizon]])
    low, high = binomial_limits(reached, n)
    label, times, curve = predicted
    ax.plot(times, curve, color=colour, label=label)
    ax.fill_between(moments, low, high, step="post", color=OBSERVED, alpha=0.2, linewidth=0)
    ax.step(moments, reached / n, where="post", color=OBSERVED, label=f"mechanics, {n} runs, 95 % intervals")
    if seen.size == n:  # the curve is flat from the last one on
        ax.set_xlim(0, min(horizon, 1.5 * max(seen[-1], predicted_mean)))
    ax.set_ylim(0, 1)
    ax.set_xlabel("time (tu)")
    ax.set_ylabel(f"share of runs with a {species}")
    ax.legend(frameon=False, fontsize="small", loc="lower right")
    return ax


def event_ratios(ax: Axes, names: Sequence[str], seen: ArrayLike, expected: Limited, title: str) -> Axes:
    """Events seen over expected, a line a group of channels, beside their range under the model; logarithmic.

    seen : (G,); expected : (G,) with the limits of the range. Nothing seen is an arrow at the left end.
    """
    events, centre = np.asarray(seen, float), np.asarray(expected.values, float)
    known = np.flatnonzero(centre > 0)
    low, high = (np.asarray(limit, float)[known] / centre[known] for limit in (expected.low, expected.high))
    ratio = events[known] / centre[known]
    above = np.concatenate([low, ratio])
    left = 0.5 * min(above[above > 0].min(initial=1.0), 0.8)
    right = 1.6 * max(high.max(initial=1.2), ratio.max(initial=1.2))
    ends = np.maximum(low, left)
    label = "95 % under the model"
    ax.barh(known, high - ends, 0.5, ends, color=PREDICTED, alpha=0.25, label=label)
    ax.axvline(1.0, color=PREDICTED, linewidth=0.8)
    some = ratio > 0
    ax.plot(ratio[some], known[some], "o", color=OBSERVED, label="mechanics")
    ax.plot(np.full(np.count_nonzero(~some), left * 1.05), known[~some], "<", color=OBSERVED)
    for i in range(len(names)):
        text = f"{events[i]:.0f} / {centre[i]:.{0 if centre[i] >= 100 else 1}f}"
        ax.annotate(text, (1.01, i), xycoords=ax.get_yaxis_transform(), va="center", fontsize="small")
    ax.set_xscale("log")
    ax.set_xlim(left, right)
    ticks = [tick for tick in (0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0) if left <= tick <= right]
    ax.set_xticks(ticks, [f"{tick:g}" for tick in ticks])
    ax.minorticks_off()
    _one_line_each(ax, names)
    ax.set_ylim(bottom=len(names) + 1.0)  # room for the legend
    ax.set_xlabel("events seen / expected")
    ax.set_title(title)
    ax.legend(frameon=False, fontsize="small", loc="lower center", ncols=2, handlelength=1.2, columnspacing=1.0)
    return ax


def pit_histogram(ax: Axes, pit: Floats, low: Floats, high: Floats, p_value: float) -> Axes:
    """How many PITs of single runs fall into each bin, beside the range of 95 % of the simulated groups.

    pit : (runs, values); low, high : (bins,)
    """
    edges = np.linspace(0.0, 1.0, low.size + 1)
    tally, _ = np.histogram(pit, edges)
    ax.stairs(high, edges, baseline=low, fill=True, color=PREDICTED, alpha=0.25, label="95 % under the model")
    ax.stairs(tally, edges, color=OBSERVED, linewidth=1.5, label=f"mechanics, {len(pit)} runs")
    ax.set_xlim(0, 1)
    ax.set_ylim(bottom=0)
    ax.set_xlabel("predicted share below the run (PIT)")
    ax.set_ylabel("values of single runs")
    ax.locator_params(axis="y", integer=True)
    ax.set_title(f"p = {p_value:.2g}")
    ax.legend(frameon=False, fontsize="small")
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
