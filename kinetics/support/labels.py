"""Labels of points, moved so that all can be read."""

from __future__ import annotations

from itertools import count
from typing import Any

from kinetics.support.arrays import Floats
from kinetics.support.packages import backend_agg, mpl

MOST_LINES = 12  # that a label is moved by


def keep_apart(figure: Any) -> None:
    """Move annotations up or down, by as few lines as do, where they would cover each other or the words of a legend.

    Only those whose place is an offset in points from what they annotate are moved.
    """
    labels = [a for a in figure.findobj(mpl.text.Annotation) if a.anncoords == "offset points" and a.get_text().strip()]
    if not labels:
        return
    canvas = figure.canvas
    renderer = backend_agg.FigureCanvasAgg(figure).get_renderer()
    figure.draw_without_rendering()  # which lays it out
    legends = [axes.get_legend() for axes in figure.axes if axes.get_legend()]
    taken = [text.get_window_extent(renderer).extents for legend in legends for text in legend.get_texts()]
    for label in labels:
        across, up = label.xyann
        line = label.get_window_extent(renderer).height * 72 / figure.dpi
        for step in count():
            label.xyann = (across, up + (step + 1) // 2 * line * (-1) ** step)
            box = label.get_window_extent(renderer).extents
            if step > 2 * MOST_LINES or not any(_meet(box, other) for other in taken):
                break
        taken.append(box)
    figure.set_canvas(canvas)


def _meet(one: Floats, other: Floats) -> bool:
    """Whether two boxes (left, bottom, right, top) overlap."""
    return bool(min(one[2], other[2]) > max(one[0], other[0]) and min(one[3], other[3]) > max(one[1], other[1]))
