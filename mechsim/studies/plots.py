"""Box plots of first times, as the paper's Figs. 4 and 5, onto given axes."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from kinetics.support.plots import colour

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from mechsim.studies.summary import PointResult, StudyResult

GAP = 1.0  # between two groups of boxes


def boxes(ax: Axes, result: StudyResult) -> Axes:
    """A box a point, in groups that share all levels but the first factor's; a colour for each of these.

    Box: quartiles and median; whiskers: the farthest run within 1.5 box lengths; dots: all runs; an open triangle with
    a number: runs without a target by the cap, which count as the cap in the box; a cross: the paper's median; small
    numbers at the foot: runs.
    """
    factors = result.study.factors
    drawn = [found for found in result.points if found.times.size]
    firsts = sorted({found.point.levels[0] for found in result.points})
    groups = list(dict.fromkeys(found.point.levels[1:] for found in result.points))
    width = len(firsts) + GAP if len(factors) > 1 else 1.0
    for found in drawn:
        first = firsts.index(found.point.levels[0])
        place = groups.index(found.point.levels[1:]) * width + first
        _box(ax, found, place, colour(first) if len(factors) > 1 else colour(0))
    if len(factors) == 1:
        ax.set_xticks(range(len(firsts)), [_tick(result, level) for level in firsts])
        ax.set_xlabel(factors[0].label + (": mean speed below" if factors[0].is_speed else ""))
        top = max((found.times[np.isfinite(found.times)].max(initial=1.0) for found in drawn), default=1.0)
        ax.set_ylim(0, 1.1 * max([top, *(found.cap for found in drawn if found.censored)]))
    else:
        middle = (len(firsts) - 1) / 2
        labels = ["\n".join(f"{level:.3g}" for level in group) for group in groups]
        ax.set_xticks([i * width + middle for i in range(len(groups))], labels)
        ax.set_xlabel("\n".join(factor.label for factor in factors[1:]))
        ax.set_yscale("log")
    ax.set_ylabel(f"time to the first {_target(result)} (tu)")
    ax.set_title(result.study.title, fontsize=10)
    _legend(ax, result, firsts)
    return ax


def _box(ax: Axes, found: PointResult, place: float, shade: str) -> None:
    cut = np.minimum(found.times, found.cap)
    ax.boxplot(
        [cut],
        positions=[place],
        widths=0.7,
        manage_ticks=False,
        patch_artist=True,
        showfliers=False,
        boxprops={"facecolor": shade, "alpha": 0.35},
        medianprops={"color": "black"},
    )
    seen = found.times[np.isfinite(found.times)]
    ax.plot(np.full(seen.size, place), seen, ".", color=shade, markersize=4)
    ax.annotate(f"{found.times.size}", (place, 0.01), xycoords=("data", "axes fraction"), ha="center", fontsize=6)
    if found.censored:
        ax.plot([place], [found.cap], marker="^", markerfacecolor="none", markeredgecolor=shade, linestyle="none")
        ax.annotate(f"{found.censored}", (place, found.cap), (4, 2), textcoords="offset points", fontsize=7)
    if found.paper is not None:
        ax.plot([place], [found.paper], marker="x", color=colour(5), markersize=8, markeredgewidth=2, linestyle="none")


def _tick(result: StudyResult, level: float) -> str:
    if not result.study.factors[0].is_speed:
        return f"{level:.3g}"
    speed = next(found.trial.speed for found in result.points if found.point.levels[0] == level)
    return f"{level:.3g}\n{speed:.2f}"


def _target(result: StudyResult) -> str:
    """Species waited for."""
    return str(result.points[0].point.specs(result.study.cap, 1, result.seed)[0].until)


def _legend(ax: Axes, result: StudyResult, firsts: list[float]) -> None:
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch

    handles: list[Patch | Line2D] = []
    if len(result.study.factors) > 1:
        name = result.study.factors[0].name
        handles += [Patch(facecolor=colour(i), alpha=0.35, label=f"{name} {v:g}") for i, v in enumerate(firsts)]
    if any(found.paper is not None for found in result.points):
        handles.append(Line2D([], [], marker="x", color=colour(5), linestyle="none", label="paper's median"))
    if any(found.censored for found in result.points):
        handles.append(
            Line2D([], [], marker="^", color="grey", markerfacecolor="none", linestyle="none", label="none by the cap")
        )
    if handles:
        ax.legend(handles=handles, frameon=False, fontsize=8)
