"""Plots of arrays and names onto given axes; nothing here computes."""

from __future__ import annotations

import io
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from kinetics.support.arrays import Floats
from kinetics.support.labels import keep_apart
from kinetics.support.output import write_whole
from kinetics.support.packages import mpl
from kinetics.support.tables import in_unit, of_unit

# Okabe & Ito (2008): colour-blind readers can distinguish these
COLOURS = ("#0072B2", "#E69F00", "#009E73", "#CC79A7", "#56B4E9", "#D55E00", "#F0E442", "#000000")


LINES = ("-", "--", "-.", ":")
COUNT = "count"  # title of the axis of counts; what is shown of them stands in the legend
MEAN, MOST_RUNS, INTERVAL, SINGLE_RUN = "mean", "middle 95 % of runs", "95 % interval of the mean", "single run"
ANY = "grey"  # of legends: a look that species of all colours have


def colour(i: int) -> str:
    """Colour of the i-th species of a network, in every figure; of the i-th curve, where curves are no species."""
    return COLOURS[i % len(COLOURS)]


def line(i: int) -> dict[str, Any]:
    """Colour and line of the i-th curve, no two alike up to the 32nd."""
    return {"color": colour(i), "linestyle": LINES[i // len(COLOURS) % len(LINES)]}


class Bands(NamedTuple):
    """Curves with bands.

    times : (T,); middle, low, high : (T, S), the curves and the ends of their bands
    """

    times: Floats
    middle: Floats
    low: Floats
    high: Floats

    @property
    def is_whole(self) -> bool:
        """Whether the ends are whole numbers, as of counts: they then jump, and are drawn as steps."""
        return bool((self.low == np.round(self.low)).all() and (self.high == np.round(self.high)).all())


def steps(ax: Any, times: ArrayLike, counts: ArrayLike, names: Sequence[str], unit: str = "tu") -> Any:
    """Counts (T, S) that hold from each time to the next; returns `ax`."""
    for i, (name, column) in enumerate(zip(names, np.asarray(counts).T, strict=True)):
        ax.step(times, column, where="post", label=name, **line(i))
    return _beside(_finish(ax, COUNT, unit))


def thin_steps(ax: Any, runs: Sequence[tuple[ArrayLike, ArrayLike]], only: int | None = None) -> Any:
    """Single runs, times (T,) and counts (T, S) of each, as thin steps behind the `bands` of the axes; returns `ax`.

    only : draw this species alone
    """
    for times, counts in runs:
        for i in _places(np.shape(counts)[1], only):
            column = np.asarray(counts)[:, i]
            ax.step(times, column, where="post", color=colour(i), linewidth=0.5, alpha=0.6, zorder=0.5)
    ax.plot([], [], color=ANY, linewidth=0.5, label=SINGLE_RUN)
    return _beside(ax)


def bands(
    ax: Any,
    times: ArrayLike,
    middle: ArrayLike,
    low: ArrayLike,
    high: ArrayLike,
    names: Sequence[str],
    unit: str = "tu",
    label: str = COUNT,
    only: int | None = None,
) -> Any:
    """Curves (T, S) with shaded bands, one colour a species; returns `ax`.

    Bands of whole numbers are steps, halfway between two times. At a single time they are bars.
    unit, label : unit of time; title of the other axis
    only : draw this species alone, and leave its name to the title
    """
    shown = Bands(*map(np.asarray, (times, middle, low, high)))
    step, is_one_time = "mid" if shown.is_whole else None, shown.times.size == 1
    for i in _places(len(names), only):
        look: dict[str, Any] = line(i) if only is None else {"color": colour(i)}
        ends = shown.low[:, i], shown.high[:, i]
        if is_one_time:  # a band and a curve would have no width
            ax.vlines(shown.times, *ends, color=colour(i), alpha=0.2, linewidth=6)
            look["marker"] = "o"
        else:
            ax.fill_between(shown.times, *ends, step=step, color=colour(i), alpha=0.2, linewidth=0)
        ax.plot(shown.times, shown.middle[:, i], label=names[i] if only is None else None, **look)
    ax.plot([], [], color=ANY, label=MEAN)
    ax.fill_between([], [], color=ANY, alpha=0.3, linewidth=0, label=MOST_RUNS)
    return _beside(_finish(ax, label, unit))


def approximate(
    ax: Any,
    times: ArrayLike,
    values: ArrayLike,
    names: Sequence[str],
    label: str,
    unit: str = "tu",
    only: int | None = None,
) -> Any:
    """Dotted curves (T, S) over the `bands` of the axes, or alone, called `label`; returns `ax`.

    only : draw this species alone, and leave its name to the title
    """
    is_named = only is None and not ax.has_data()
    for i in _places(len(names), only):
        curve = np.asarray(values)[:, i]
        marker = "x" if np.size(times) == 1 else None
        ax.plot(
            times,
            curve,
            color=colour(i),
            linestyle=":",
            linewidth=2.2,
            marker=marker,
            label=names[i] if is_named else None,
        )
    ax.plot([], [], color=ANY, linestyle=":", linewidth=2.2, label=label)
    return _beside(_finish(ax, COUNT, unit))


def intervals(ax: Any, times: ArrayLike, low: ArrayLike, high: ArrayLike, only: int | None = None) -> Any:
    """Dashed limits (T, S) of the means in the colours of `bands`; returns `ax`.

    only : draw this species alone
    """
    marker = "_" if np.size(times) == 1 else None
    for i in _places(np.shape(low)[1], only):
        for limit in (np.asarray(low)[:, i], np.asarray(high)[:, i]):
            ax.plot(times, limit, color=colour(i), linestyle="--", linewidth=0.8, marker=marker)
    ax.plot([], [], color=ANY, linestyle="--", linewidth=0.8, label=INTERVAL)
    return _beside(ax)


def passage(ax: Any, times: ArrayLike, probability: ArrayLike, mean: float, target: str, unit: str = "tu") -> Any:
    """Distribution function of a passage time, its mean marked if there is one; returns `ax`."""
    ax.plot(times, probability, color=colour(0), label=f"until {target}")
    if np.isfinite(mean):
        ax.axvline(mean, color=colour(1), linestyle="--", label=in_unit(f"mean {mean:.4g}", unit))
    ax.set_ylim(0, 1)
    return _finish(ax, "probability of having been reached", unit)


def survival(
    ax: Any, times: Floats, probability: Floats, low: Floats, high: Floats, condition: str, unit: str = "tu"
) -> Any:
    """Survival curve (n,) as steps, with its pointwise band; returns `ax`."""
    ax.fill_between(times, low, high, step="post", color=colour(0), alpha=0.2, linewidth=0, label="95 % interval")
    ax.step(times, probability, where="post", color=colour(0), label=condition)
    ax.set_ylim(0, 1)
    return _finish(ax, "probability of not having been reached", unit)


def grouped_bars(
    ax: Any, groups: Sequence[str], names: Sequence[str], values: Any, low: Any, high: Any, label: str
) -> Any:
    """Horizontal bars (groups, names) with intervals, the first group on top, one colour a name; returns `ax`."""
    height = 0.8 / len(names)
    middle = np.arange(len(groups), dtype=float)
    for i, name in enumerate(names):
        spread = [np.maximum(values[:, i] - low[:, i], 0.0), np.maximum(high[:, i] - values[:, i], 0.0)]
        place = middle + (i - (len(names) - 1) / 2) * height
        ax.barh(place, values[:, i], height, color=colour(i), label=name, xerr=spread, error_kw={"lw": 0.8})
    ax.axvline(0.0, color="black", linewidth=0.8)
    ax.set_yticks(middle, groups)
    ax.invert_yaxis()
    ax.set_xlabel(label)
    ax.legend(frameon=False)
    return ax


def save(path: str, draw: Any, size: tuple[float, float] = (6.4, 4.0), dpi: int = 150) -> None:
    """Write a figure with one pair of axes, which `draw(ax)` fills; as `save_figure`."""
    save_figure(path, lambda figure: draw(figure.add_subplot()), size, dpi)


def save_figure(path: str, draw: Any, size: tuple[float, float], dpi: int = 150) -> None:
    """Write one figure as PNG, PDF or SVG, by the end of its name, whole or not at all. `draw(figure)` fills it.

    size : width and height, inches
    The same drawing gives the same bytes.
    """
    kind, undated = Path(path).suffix.lower()[1:], {"svg": {"Date": None}, "pdf": {"CreationDate": None}}
    figure, picture = mpl.figure.Figure(figsize=size, layout="constrained"), io.BytesIO()
    draw(figure)
    words_as_they_are(figure)
    keep_apart(figure)
    with mpl.rc_context({"svg.hashsalt": "wellmixed"}):  # else the names within an SVG are random
        figure.savefig(picture, format=kind, dpi=dpi, metadata=undated.get(kind))
    write_whole(path, picture.getvalue())


def words_as_they_are(figure: Any) -> None:
    """Show a `$` of a name as it is, where Matplotlib would begin a formula; powers of ten at axes remain formulas."""
    numbers = {
        label
        for ax in figure.axes
        for axis in (ax.xaxis, ax.yaxis)
        if isinstance(axis.get_major_formatter(), mpl.ticker.LogFormatter | mpl.ticker.ScalarFormatter)
        for label in (*axis.get_ticklabels(which="both"), axis.offsetText)
    }
    for text in figure.findobj(lambda artist: isinstance(artist, mpl.text.Text) and artist not in numbers):
        text.set_parse_math(False)


def _places(n_species: int, only: int | None) -> Sequence[int]:
    """Which species are drawn."""
    return range(n_species) if only is None else [only]


def _beside(ax: Any) -> Any:
    """Put the legend next to the axes, since curves and bands may fill them."""
    ax.legend(frameon=False, loc="center left", bbox_to_anchor=(1.0, 0.5))
    return ax


def _finish(ax: Any, label: str, unit: str) -> Any:
    ax.set_xlabel(of_unit("time", unit))
    ax.set_ylabel(label)
    ax.legend(frameon=False)
    return ax
