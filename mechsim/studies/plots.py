"""Box plots of first-passage times onto given axes, as in Figs. 4 and 5 of the paper."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from kinetics.support.arrays import Floats
from kinetics.support.packages import mpl
from kinetics.support.plots import colour

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch

GAP = 1.0  # between two groups of boxes


def boxes(
    ax: Axes,
    times: Sequence[Floats],
    levels: ArrayLike,
    labels: Sequence[str],
    *,
    name: str,
    cap: float,
    paper: ArrayLike,
    speeds: ArrayLike | None = None,
) -> Axes:
    """A box a point, in groups that share all levels but the first factor's; a colour for each of these.

    times : of each of P points its first times (n,), tu, inf where the cap came first; a point without any has no box
    levels (P, F) : of the factors at each point; labels : of the F factors, for the axis; name : of the first one
    paper (P,) : the paper's medians, tu, nan where it gives none
    speeds (P,) : mean speeds, which stand below the levels of a single factor; None: not shown

    Box: quartiles and median; whiskers: the farthest run within 1.5 box lengths; dots: all runs; an open triangle with
    a number: runs without a target by the cap, which count as the cap in the box; a cross: the paper's median; small
    numbers at the foot: runs. Returns `ax`.
    """
    at, medians = np.asarray(levels, float), np.asarray(paper, float)
    firsts = sorted(set(at[:, 0].tolist()))
    groups = list(dict.fromkeys(map(tuple, at[:, 1:].tolist())))
    grouped = at.shape[1] > 1
    width = len(firsts) + GAP if grouped else 1.0
    for own, point, median in zip(times, at.tolist(), medians, strict=True):
        if own.size:
            first = firsts.index(point[0])
            place = groups.index(tuple(point[1:])) * width + first
            _box(ax, own, cap, median, place, colour(first if grouped else 0))
    if grouped:
        middle = (len(firsts) - 1) / 2
        ticks = ["\n".join(f"{level:.3g}" for level in group) for group in groups]
        ax.set_xticks([i * width + middle for i in range(len(groups))], ticks)
        ax.set_xlabel("\n".join(labels[1:]))
        ax.set_yscale("log")
    else:
        ticks = [f"{level:.3g}" for level in firsts]
        if speeds is not None:
            own_speeds = dict(zip(at[::-1, 0].tolist(), np.asarray(speeds)[::-1].tolist(), strict=True))
            ticks = [f"{tick}\n{own_speeds[level]:.2f}" for tick, level in zip(ticks, firsts, strict=True)]
        ax.set_xticks(range(len(firsts)), ticks)
        ax.set_xlabel(labels[0] + (": mean speed below" if speeds is not None else ""))
        seen = [own[np.isfinite(own)].max(initial=1.0) for own in times]
        caps = [cap for own in times if np.isinf(own).any()]
        ax.set_ylim(0, 1.1 * max([1.0, *seen, *caps]))
    handles = _shades(name, firsts) if grouped else []
    handles += _marks(bool(np.isfinite(medians).any()), any(np.isinf(own).any() for own in times))
    if handles:
        ax.legend(handles=handles, frameon=False, fontsize=8)
    return ax


def _box(ax: Axes, times: Floats, cap: float, paper: float, place: float, shade: str) -> None:
    ax.boxplot(
        [np.minimum(times, cap)],
        positions=[place],
        widths=0.7,
        manage_ticks=False,
        patch_artist=True,
        showfliers=False,
        boxprops={"facecolor": shade, "alpha": 0.35},
        medianprops={"color": "black"},
    )
    seen = times[np.isfinite(times)]
    ax.plot(np.full(seen.size, place), seen, ".", color=shade, markersize=4)
    ax.annotate(f"{times.size}", (place, 0.01), xycoords=("data", "axes fraction"), ha="center", fontsize=6)
    censored = times.size - seen.size
    if censored:
        ax.plot([place], [cap], marker="^", markerfacecolor="none", markeredgecolor=shade, linestyle="none")
        ax.annotate(f"{censored}", (place, cap), (4, 2), textcoords="offset points", fontsize=7)
    if np.isfinite(paper):
        ax.plot([place], [paper], marker="x", color=colour(5), markersize=8, markeredgewidth=2, linestyle="none")


def _shades(name: str, firsts: Sequence[float]) -> list[Patch | Line2D]:
    """Shades of the first factor's levels, for the legend."""
    return [
        mpl.patches.Patch(facecolor=colour(i), alpha=0.35, label=f"{name} {level:g}") for i, level in enumerate(firsts)
    ]


def _marks(of_paper: bool, of_cap: bool) -> list[Patch | Line2D]:
    """The marks that were drawn, for the legend."""
    marks: list[Patch | Line2D] = []
    if of_paper:
        marks.append(mpl.lines.Line2D([], [], marker="x", color=colour(5), linestyle="none", label="paper's median"))
    if of_cap:
        marks.append(
            mpl.lines.Line2D(
                [], [], marker="^", color="grey", markerfacecolor="none", linestyle="none", label="none by the cap"
            )
        )
    return marks
