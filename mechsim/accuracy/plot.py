"""Plot of a work-precision diagram: error against CPU time, and the sensitivity to settings of the model."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from kinetics.support.plots import colour
from mechsim.accuracy.diagram import Accuracy, SettingResult
from mechsim.accuracy.quantities import BY_NAME

MARKERS = ("o", "s", "^", "D", "v")
LOWEST, STOPPED, TOP = 1e-3, 1.0, 10.0  # the least error shown, where the crosses begin, and room for the legend
RED = "#CC0000"


def draw(accuracy: Accuracy, figure: Any) -> Any:
    """Fill a figure with a panel for each quantity and one for the model; returns it."""
    figure.clear()
    rows = 2 if accuracy.model else 1
    n = len(accuracy.means)
    grid = figure.add_gridspec(rows, n, height_ratios=[1, 1][:rows])
    for column, name in enumerate(accuracy.means):
        errors(figure.add_subplot(grid[0, column]), accuracy, name)
    if accuracy.model:
        sensitivity(figure.add_subplot(grid[1, :]), accuracy)
    figure.suptitle(
        f"{accuracy.scene.name}, {accuracy.cubes} cubes, {accuracy.runs} × {accuracy.duration:g} tu at each "
        f"step, half as much at other settings; reference: step {accuracy.reference.setting.label} tu",
        fontsize=10,
    )
    return figure


def errors(ax: Any, accuracy: Accuracy, name: str) -> Any:
    """Magnitude of the error of one quantity against CPU s a tu, with 95 % whiskers; returns `ax`.

    A whisker that leaves the panel below holds an error of zero. Crosses: stopped by the guard, at their cost.
    """
    from matplotlib.ticker import LogLocator

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
            at, side = ((5, 4), "left") if knob.startswith("step") else ((-6, 7 * k - 8), "right")
            ax.annotate(
                point.setting.label, (point.cost, height), at, ha=side, textcoords="offset points", fontsize=6,
                color=colour(i),
            )  # fmt: skip
    stopped = [point for point in accuracy.numerical if point.stopped and name not in point.changes]
    for k, point in enumerate(stopped):
        height = STOPPED * 0.6**k  # they have no error to be placed at
        ax.plot(point.cost, height, "x", color=RED, ms=7, mew=2, label="stopped by the guard" if k == 0 else None)
        ax.annotate(
            f"{point.setting.curve} {point.setting.label}", (point.cost, height), (7, -2),
            textcoords="offset points", fontsize=6, color=RED,
        )  # fmt: skip
    if floor is not None:
        ax.axhline(floor, color="0.4", ls="--", lw=0.9, label="sampling floor")
    ax.axvline(accuracy.reference.cost, color="0.7", ls=":", lw=0.9, label="cost of the reference")
    ax.set(xscale="log", yscale="log", ylim=(min(LOWEST, floor or LOWEST) / 2, TOP), xlabel="CPU time (s/tu)")
    ax.xaxis.set_major_locator(LogLocator(subs=(1, 2, 5)))
    ax.xaxis.set_major_formatter("{x:g}")
    ax.xaxis.set_minor_formatter("")
    ax.set_ylabel(f"|error| of {BY_NAME[name].title}")
    ax.legend(frameon=False, fontsize=6, ncols=2, loc="upper center")
    return ax


def sensitivity(ax: Any, accuracy: Accuracy) -> Any:
    """Change of each quantity where a setting of the model is another, with 95 % intervals; returns `ax`."""
    points: Sequence[SettingResult] = accuracy.model
    rows = np.arange(len(points))[::-1]
    for i, name in enumerate(accuracy.means):
        changes = [point.changes.get(name) for point in points]
        shown = [k for k, change in enumerate(changes) if change is not None]
        ax.errorbar(
            [100 * changes[k].value for k in shown],  # type: ignore[union-attr]
            rows[shown] + 0.15 * (len(accuracy.means) - 1 - 2 * i),
            xerr=[100 * changes[k].half_width for k in shown],  # type: ignore[union-attr]
            fmt=MARKERS[i], color=colour(i), ms=4, capsize=2, label=BY_NAME[name].title,
        )  # fmt: skip
    ax.axvline(0, color="0.6", lw=0.8)
    ax.set_yticks(rows, [f"{point.setting.curve}: {point.setting.label}" for point in points], fontsize=7)
    ax.set_xlabel("change against the scene as it is (%): the model's own sensitivity, no error")
    ax.legend(frameon=False, fontsize=7)
    return ax
