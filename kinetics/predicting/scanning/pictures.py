"""Pictures of a scan: lines with bounds over one name, heat maps over two, a heat map for each value of further names.

Contours are drawn from three values on each axis. They have no numbers of their own, which would overlap where they
are close: their levels are marks of the bar.
"""

from __future__ import annotations

import itertools
import math
import textwrap
from collections.abc import Mapping
from typing import Any, Protocol

import numpy as np

from kinetics.predicting.scanning.values import is_logarithmic
from kinetics.support import plots
from kinetics.support.answer import CONFIDENCE
from kinetics.support.arrays import Floats
from kinetics.support.packages import mpl

MOST_PANELS = 48
MOST_COLUMNS = 5  # of cells with room for a number
WIDE = 46  # characters of a line of a title, in this size
SMALL = 9  # points
FEW = 8  # values that an axis marks one by one
ENOUGH = 3  # values along each axis from which contours are drawn
COLOURS = "cividis"  # colour-blind readers see it as others do (Nuñez, Anderton & Renslow 2018)


class DrawnScan(Protocol):
    """The part of a `Scan` that is drawn."""

    @property
    def over(self) -> Mapping[str, Floats]:
        """Name -> its values."""
        ...

    @property
    def titles(self) -> tuple[str, ...]:
        """What each question asks for, with its unit."""
        ...

    @property
    def labels(self) -> Mapping[str, str]:
        """Name -> title of its axis."""
        ...

    def numbers(self, what: str) -> Floats:
        """The values, or their lower or upper bounds, as an array (n1, n2, ..., Q)."""
        ...

    def words(self, what: str) -> Any:
        """Text on each answer (n1, n2, ..., Q), such as its method."""
        ...


def size_of(scan: DrawnScan) -> tuple[float, float]:
    """Width and height of a figure with all panels, inches."""
    rows, columns = _layout(scan)
    return 4.6 * columns, 3.6 * rows


def draw_scan(figure: Any, scan: DrawnScan) -> None:
    """Fill a figure with a panel a question, and a value of each name beyond two."""
    rows, columns = _layout(scan)
    axes = np.array(figure.subplots(rows, columns, squeeze=False))
    for ax in axes.ravel():
        ax.set_axis_off()
    if len(scan.over) == 1:
        for q, ax in zip(range(len(scan.titles)), axes.ravel(), strict=False):
            ax.set_axis_on()
            _lines(ax, scan, q)
        return
    facets = _facets(scan)
    for q, question in enumerate(scan.titles):
        table = scan.numbers("value")[..., q]
        shown = table[np.isfinite(table)]
        limits = (float(shown.min()), float(shown.max())) if shown.size else (0.0, 1.0)
        panels = axes.ravel()[q : q + 1] if facets == [()] else axes.ravel()[_rows_a_question(scan, q) * columns :]
        used = []
        for facet, ax in zip(facets, panels, strict=False):
            ax.set_axis_on()
            mesh = _heat_map(ax, scan, np.moveaxis(table, (0, 1), (-2, -1))[facet], limits)
            held = zip(list(scan.over.items())[2:], facet, strict=True)
            ax.set_title(", ".join(f"{name} = {values[place]:g}" for (name, values), place in held))
            used.append(ax)
        bar = figure.colorbar(mesh, ax=used, ticks=_levels(limits))
        bar.set_label(_folded(question), fontsize=SMALL)
        bar.ax.hlines(_levels(limits), 0.0, 1.0, color="white", linewidth=1.0)


def _levels(limits: tuple[float, float]) -> list[float]:
    """Round numbers within limits, marked on the colour bar, at which contours are drawn."""
    low, high = limits
    return [float(level) for level in mpl.ticker.MaxNLocator(6).tick_values(low, high) if low <= level <= high]


def _lines(ax: Any, scan: DrawnScan, q: int) -> None:
    """Values over one name, with bounds; what is sampled is hollow."""
    ((name, x),) = scan.over.items()
    order = np.argsort(x)
    value, low, high = (scan.numbers(what)[order, q] for what in ("value", "low", "high"))
    is_sampled = scan.words("kind")[order, q] == CONFIDENCE
    x = x[order]
    ax.plot(x, value, color=plots.colour(0), linewidth=1.0)
    ax.fill_between(x, low, high, color=plots.colour(0), alpha=0.2, linewidth=0)
    for those, face, text in ((~is_sampled, plots.colour(0), "exact"), (is_sampled, "white", "sampled, 95 % interval")):
        if (those & np.isfinite(value)).any():
            spread = np.nan_to_num(np.clip([(value - low)[those], (high - value)[those]], 0.0, None), posinf=0.0)
            ax.errorbar(
                x[those], value[those], spread, fmt="o", color=plots.colour(0), markerfacecolor=face, markersize=4,
                capsize=2, label=text,
            )  # fmt: skip
    _scale(ax.xaxis, ax.set_xscale, x)
    ax.set_xlabel(_folded(scan.labels[name]), fontsize=SMALL)
    ax.set_ylabel(_folded(scan.titles[q]), fontsize=SMALL)
    ax.legend(frameon=False)


def _heat_map(ax: Any, scan: DrawnScan, table: Floats, limits: tuple[float, float]) -> Any:
    """Values (n1, n2) over two names, as coloured cells; returns their mesh.

    From three values of each name there are contours; with fewer, the cells have their values in them.
    """
    first, second = list(scan.over)[:2]
    x, y = scan.over[first], scan.over[second]
    across, up = np.argsort(x), np.argsort(y)
    x, y, shown = x[across], y[up], table[np.ix_(across, up)].T
    ax.set_facecolor("0.85")  # where nothing was answered
    cells, (low, high) = np.ma.masked_invalid(shown), limits
    mesh = ax.pcolormesh(cell_edges(x), cell_edges(y), cells, cmap=COLOURS, vmin=low, vmax=high)
    _scale(ax.xaxis, ax.set_xscale, x)
    _scale(ax.yaxis, ax.set_yscale, y)
    if min(shown.shape) >= ENOUGH and cells.count():
        within = [level for level in _levels(limits) if cells.min() < level < cells.max()]
        if within:
            lines = ax.contour(x, y, cells, levels=within, colors="white", linewidths=1.0)
            lines.set(path_effects=[mpl.patheffects.withStroke(linewidth=1.8, foreground="black")])
    elif shown.shape[0] <= FEW and shown.shape[1] <= MOST_COLUMNS:
        _write_values(ax, mesh, x, y, cells)
    ax.set_xlabel(_folded(scan.labels[first]), fontsize=SMALL)
    ax.set_ylabel(_folded(scan.labels[second]), fontsize=SMALL)
    return mesh


def _write_values(ax: Any, mesh: Any, x: Floats, y: Floats, cells: Any) -> None:
    """Three figures in each cell (n2, n1), white where it is dark."""
    for row, column in zip(*np.nonzero(~np.ma.getmaskarray(cells)), strict=True):
        is_dark = mesh.norm(cells[row, column]) < 0.5
        colour = "white" if is_dark else "black"
        ax.text(x[column], y[row], f"{cells[row, column]:.3g}", color=colour, ha="center", va="center", fontsize=8)


def _folded(title: str) -> str:
    """A title in lines that fit a panel."""
    return textwrap.fill(title, WIDE)


def cell_edges(values: Floats) -> Floats:
    """Ends (n + 1,) of the cells around rising values (n,), halfway between two of them as the axis shows it."""
    is_log = is_logarithmic(values)
    places = np.log(values) if is_log else values
    if places.size == 1:
        width = abs(places[0]) / 2 or 0.5
        return np.array([places[0] - width, places[0] + width])
    middle = (places[1:] + places[:-1]) / 2
    ends = np.concatenate([[2 * places[0] - middle[0]], middle, [2 * places[-1] - middle[-1]]])
    return np.exp(ends) if is_log else ends


def _scale(axis: Any, set_scale: Any, values: Floats) -> None:
    """A logarithmic axis where the values are even there; a mark a value where these are few."""
    if is_logarithmic(values):
        set_scale("log")
    elif values.size <= FEW:
        axis.set_ticks(values, [f"{value:g}" for value in values])


def _facets(scan: DrawnScan) -> list[tuple[int, ...]]:
    """Places of every combination of the names beyond two; one, empty, where there are none."""
    return list(itertools.product(*(range(len(values)) for values in list(scan.over.values())[2:])))


def _layout(scan: DrawnScan) -> tuple[int, int]:
    """Rows and columns of panels."""
    facets, questions = len(_facets(scan)), len(scan.titles)
    if facets * questions > MOST_PANELS:
        raise ValueError(
            f"{facets * questions} panels, one for each question and value of a name beyond two; at most {MOST_PANELS} "
            "are drawn, so scan fewer values, or draw parts of to_xarray()"
        )
    if len(scan.over) < 3:
        columns = min(questions, 3)
        return math.ceil(questions / columns), columns
    columns = min(facets, 4)
    return math.ceil(facets / columns) * questions, columns


def _rows_a_question(scan: DrawnScan, q: int) -> int:
    """The first row of a question's panels."""
    rows, _ = _layout(scan)
    return rows // len(scan.titles) * q
