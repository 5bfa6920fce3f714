"""Whether the words of a figure can be read: none covers another, none is cut off."""

from collections.abc import Callable
from itertools import combinations
from unittest.mock import patch

from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.text import Text

LEAST = 1.5  # hundredths of an inch by which boxes must overlap, at least, both ways: boxes have margins


def words_of(draw_figure: Callable[[], object]) -> dict[Text, tuple[float, ...]]:
    """The texts that are really drawn, each with its box (left, bottom, right, top) in hundredths of an inch."""
    found = {}
    draw = Text.draw

    def noted(text, renderer, *rest, **more):
        draw(text, renderer, *rest, **more)
        if text.get_visible() and text.get_text().strip():
            inches = Text.get_window_extent(text, renderer).extents / text.get_figure(root=True).dpi
            found[text] = tuple(100 * inches)

    with patch.object(Text, "draw", noted):
        draw_figure()
    return found


def illegible(figure, draw_figure: Callable[[], object] | None = None):
    """Draw the figure, by default on a canvas of its own, and list what cannot be read in it; empty if all can."""
    boxes = words_of(draw_figure or FigureCanvasAgg(figure).draw)
    width, height = 100 * figure.get_size_inches()
    wrong = [
        f"{text.get_text()!r} is cut off"
        for text, (left, bottom, right, top) in boxes.items()
        if left < -LEAST or bottom < -LEAST or right > width + LEAST or top > height + LEAST
    ]
    for (one, a), (other, b) in combinations(boxes.items(), 2):
        across, up = min(a[2], b[2]) - max(a[0], b[0]), min(a[3], b[3]) - max(a[1], b[1])
        if across > LEAST and up > LEAST:
            wrong.append(
                f"{one.get_text()!r} covers {other.get_text()!r} by {across:.0f} x {up:.0f} hundredths of an inch"
            )
    return wrong
