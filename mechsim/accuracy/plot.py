"""Plot of a work-precision diagram: error against CPU time, and the sensitivity to settings of the model."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from kinetics.support.packages import mpl
from kinetics.support.plots import colour
from mechsim.accuracy.diagram import Accuracy, SettingResult
from mechsim.accuracy.quantities import BY_NAME

MARKERS = ("o", "s", "^", "D", "v")
LOWEST, TOP = 1e-3, 10.0  # the least error shown, and room for the crosses
STOPPED, APART = 0.95, 0.055  # the highest cross and how far below it the next one is, shares of the panel
LEAST_RATIO = 0.01
RED = "#CC0000"


def draw(accuracy: Accuracy, figure: Any) -> Any:
    """Fill a figure with a panel for each quantity and one for the model; returns it."""
    figure.clear()
    rows = 2 if accuracy.model else 1
    n = len(accuracy.means)
    grid = figure.add_gridspec(rows, n, height_ratios=[1, 1][:rows])
    for column, name in enumerate(accuracy.means):
        errors(figure.add_subplot(grid[0, column]), accuracy, name)
    shown: dict[str, Any] = {}  # one legend for all panels: they show the same settings
    for ax in figure.axes:
        handles, labels = ax.get_legend_handles_labels()
        shown = dict(zip(labels, handles, strict=True)) | shown
    figure.legend(
        shown.values(), shown.keys(), loc="outside upper center", ncols=min(len(shown), 3 * n), frameon=False,
        fontsize=8, title=f"{accuracy.scene.name}, {accuracy.cubes} cubes, {accuracy.runs} × {accuracy.duration:g} tu "
        f"at each step, half as much at other settings; reference: step {accuracy.reference.setting.label} tu",
    )  # fmt: skip
    if accuracy.model:
        sensitivity(figure.add_subplot(grid[1, :]), accuracy)
    return figure


def errors(ax: Any, accuracy: Accuracy, name: str) -> Any:
    """Magnitude of the error of one quantity against CPU s a tu, with 95 % whiskers; returns `ax`.

    A whisker that leaves the panel below holds an error of zero. Crosses: stopped by the guard, at their cost; their
    height says nothing.
    """
    ground = {"facecolor": "white", "edgecolor": "none", "alpha": 0.8, "pad": 0.5}  # labels stay readable on whiskers

    floor = accuracy.floor.get(name)
    curves: dict[str, list[SettingResult]] = {}
    for point in accuracy.numerical:
        curves.setdefault(point.setting.curve, []).append(point)
    for i, (knob, points) in enumerate(curves.items()):
        shown = [point for point in points if name in point.changes]
        x = [point.cost for point in shown]
        y = np.array([max(abs(point.changes[name].value), LOWEST) for point in shown])
        half = np.array([point.changes[name].half_width for point in shown])
        spread = [y - np.maximum(y - half, LOWEST / 10), half]
        ax.errorbar(x, y, spread, fmt=f"-{MARKERS[i % len(MARKERS)]}", color=colour(i), label=knob, capsize=2, ms=4)
        for k, (point, height) in enumerate(zip(shown, y, strict=True)):
            # Steps lie apart and are labelled beside the point; what costs the same is labelled in a pile.
            offset, side = ((5.0, 4.0), "left") if knob.startswith("step") else ((-6.0, 7.0 * k - 8.0), "right")
            ax.annotate(
                point.setting.label, (point.cost, height), offset, ha=side, textcoords="offset points", fontsize=7,
                color=colour(i), bbox=ground,
            )  # fmt: skip
    stopped = [point for point in accuracy.numerical if point.stopped and name not in point.changes]
    costs = [accuracy.reference.cost, *(point.cost for point in accuracy.numerical)]
    for k, point in enumerate(stopped):
        at = point.cost, STOPPED - APART * k
        ax.plot(*at, "x", transform=ax.get_xaxis_transform(), color=RED, ms=6, mew=2,
                label="stopped by the guard" if k == 0 else None)  # fmt: skip
        is_right = point.cost**2 > min(costs) * max(costs)
        ax.annotate(
            f"{point.setting.curve} {point.setting.label}", at, (-7, 0) if is_right else (7, 0),
            ha="right" if is_right else "left", va="center", xycoords=ax.get_xaxis_transform(),
            textcoords="offset points", fontsize=7, color=RED, bbox=ground,
        )  # fmt: skip
    if floor is not None:
        ax.axhline(floor, color="0.4", ls="--", lw=0.9, label="sampling floor")
    ax.axvline(accuracy.reference.cost, color="0.7", ls=":", lw=0.9, label="cost of the reference")
    ax.set(xscale="log", yscale="log", ylim=(min(LOWEST, floor or LOWEST) / 2, TOP), xlabel="CPU time (s/tu)")
    ax.xaxis.set_major_locator(mpl.ticker.LogLocator(subs=(1, 2, 5)))
    ax.xaxis.set_major_formatter("{x:g}")
    ax.xaxis.set_minor_formatter("")
    ax.set_ylabel(f"|error| of {BY_NAME[name].title}")
    return ax


def sensitivity(ax: Any, accuracy: Accuracy) -> Any:
    """Ratio of each quantity, where a setting of the model is another, to the scene's, with 95 % intervals; returns
    `ax`."""
    points: Sequence[SettingResult] = accuracy.model
    rows = np.arange(len(points))[::-1]
    for row in rows[::2]:
        ax.axhspan(row - 0.5, row + 0.5, color="0.95", lw=0)
    for i, name in enumerate(accuracy.means):
        shown = [(row, point.changes[name]) for row, point in zip(rows, points, strict=True) if name in point.changes]
        ratio = np.array([max(1 + change.value, LEAST_RATIO) for _, change in shown])
        half = np.array([change.half_width for _, change in shown])
        ax.errorbar(
            ratio,
            [row + 0.15 * (len(accuracy.means) - 1 - 2 * i) for row, _ in shown],
            xerr=[ratio - np.maximum(ratio - half, LEAST_RATIO), half],
            fmt=MARKERS[i], color=colour(i), ms=4, capsize=2, label=BY_NAME[name].title,
        )  # fmt: skip
    ax.axvline(1, color="0.6", lw=0.8)
    ax.set(xscale="log", ylim=(-0.5, len(points) - 0.5))
    low, high = ax.get_xlim()
    ax.set_xlim(min(low, 0.5), max(high, 2.0))  # room for ticks where hardly anything depends on a setting
    ax.xaxis.set_major_locator(mpl.ticker.LogLocator(subs=(1, 2, 5)))
    ax.xaxis.set_major_formatter("{x:g}")
    ax.xaxis.set_minor_formatter("")
    ax.set_yticks(rows, [f"{point.setting.curve}: {point.setting.label}" for point in points], fontsize=8)
    ax.set_xlabel("ratio to the scene as it is, with 95 % intervals: the model's own sensitivity, no error")
    ax.legend(frameon=False, fontsize=8, loc="center right")
    return ax
