"""The plot of an accuracy diagram: error against CPU time, one curve per method."""

from __future__ import annotations

from typing import Any

import numpy as np

from kinetics.support.plots import colour
from kinetics.trust.accuracy.diagram import CostPoint, Diagram

MARKERS = ("o", "s", "^", "D", "v", "*")
NEAR = 2.0  # times: points no farther apart share a label
LOWEST = 1e-15  # of the errors shown: smaller ones are drawn here


def draw(diagram: Diagram, ax: Any) -> Any:
    """Fill given axes; returns them.

    Whiskers: smallest and largest of the repeats. A bar above a point: the bound that the method proves of its error.
    """
    names = list(dict.fromkeys(point.curve for point in diagram.points))
    for i, name in enumerate(names):
        _curve(ax, diagram.of(name), MARKERS[i % len(MARKERS)], colour(i))
    _label_ends(ax, [diagram.of(name) for name in names])
    sampled = [point for point in diagram.points if point.knob == "runs" and point.setting]
    if sampled:
        quickest = min(sampled, key=lambda point: point.cpu_seconds / float(point.setting or 1)).curve
        line = diagram.of(quickest)
        floors = [diagram.floors[int(point.setting or 0)] for point in line]
        label = f"sampling floor of {quickest}"
        ax.plot([point.cpu_seconds for point in line], floors, "--", color="0.3", lw=0.9, zorder=1, label=label)
    if any(point.bound is not None for point in diagram.points):
        ax.plot([], [], "_", color="0.3", ms=9, mew=1.5, label="bar: proven bound of the error")
    bound = max(diagram.reference_bound, LOWEST)
    kind = "proven bound" if diagram.is_proven else "estimated error"
    ax.axhspan(LOWEST / 10, bound, color="0.9", zorder=0, label=f"below the {kind} of the reference")
    ax.set(xscale="log", yscale="log", xlabel="CPU time (s), one thread")
    ax.xaxis.set_minor_formatter("")
    ax.margins(x=0.08)  # room for the labels
    ax.set_ylabel("largest Wasserstein distance from the reference (copies)", fontsize=8)
    ax.set_ylim(LOWEST / 3, None)
    ax.set_title(
        f"{diagram.title}: {diagram.n_states} states, {diagram.times.size} times to {diagram.times[-1]:g} tu",
        fontsize=9,
    )
    ax.legend(frameon=False, fontsize=7, loc="center left", bbox_to_anchor=(1.0, 0.5))
    return ax


def _curve(ax: Any, points: list[CostPoint], marker: str, shade: str) -> None:
    x = np.array([point.cpu_seconds for point in points])
    y = np.array([max(point.error.copies, LOWEST) for point in points])
    whiskers = [y - [max(p.low, LOWEST) for p in points], [max(p.high, LOWEST) for p in points] - y]
    style = {"color": shade, "marker": marker, "ms": 9 if marker == "*" else 4, "lw": 1, "capsize": 2}
    ax.errorbar(x, y, np.maximum(whiskers, 0.0), label=points[0].curve, **style)
    for point, height in zip(points, y, strict=True):
        if point.bound is not None:
            ax.plot([point.cpu_seconds] * 2, [height, point.bound], ":", color=shade, lw=0.8)
            ax.plot(point.cpu_seconds, point.bound, "_", color=shade, ms=9, mew=1.5)


def _label_ends(ax: Any, curves: list[list[CostPoint]]) -> None:
    """Name the first and last settings; points of several curves that nearly meet share one label, in grey."""
    ends = [points[end] for points in curves if points[0].knob for end in sorted({0, len(points) - 1})]
    while ends:
        first = ends[0]
        near = [each for each in ends if each.label == first.label and each.knob == first.knob and _meet(each, first)]
        ends = [each for each in ends if each not in near]
        is_first = any(first is points[0] for points in curves)
        shade = "0.3" if len(near) > 1 else colour([points[0].curve for points in curves].index(first.curve))
        spot = (first.cpu_seconds, max(first.error.copies, LOWEST))
        ax.annotate(first.label, spot, (5, 4 if is_first else -8), textcoords="offset points", fontsize=6, color=shade)


def _meet(one: CostPoint, other: CostPoint) -> bool:
    """Whether a label beside one of these points stands beside the other, too."""
    pairs = ((one.cpu_seconds, other.cpu_seconds), (one.error.copies, other.error.copies))
    return all(max(a, b, LOWEST) <= NEAR * max(min(a, b), LOWEST) for a, b in pairs)
