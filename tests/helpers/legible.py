"""Whether the words of a figure can be read: none covers another, none is cut off."""

from itertools import combinations
from unittest.mock import patch

from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.text import Text

LEAST = 1.5  # pixels by which boxes must overlap, at least, both ways: boxes have margins


def words_of(figure):
    """The texts that are really drawn, each with its box (left, bottom, right, top) in pixels."""
    found = {}
    draw = Text.draw

    def noted(text, renderer, *rest, **more):
        if text.get_visible() and text.get_text().strip():
            found[text] = None
        return draw(text, renderer, *rest, **more)

    canvas = FigureCanvasAgg(figure)
    with patch.object(Text, "draw", noted):
        canvas.draw()
    renderer = canvas.get_renderer()
    return {text: Text.get_window_extent(text, renderer).extents for text in found}


def illegible(figure):
    """What is wrong, in words; empty where all can be read."""
    canvas = figure.canvas
    try:
        boxes = words_of(figure)
    finally:
        figure.set_canvas(canvas)
    width, height = figure.bbox.size
    wrong = [
        f"{text.get_text()!r} is cut off"
        for text, (left, bottom, right, top) in boxes.items()
        if left < -LEAST or bottom < -LEAST or right > width + LEAST or top > height + LEAST
    ]
    for (one, a), (other, b) in combinations(boxes.items(), 2):
        across, up = min(a[2], b[2]) - max(a[0], b[0]), min(a[3], b[3]) - max(a[1], b[1])
        if across > LEAST and up > LEAST:
            wrong.append(f"{one.get_text()!r} covers {other.get_text()!r} by {across:.0f} x {up:.0f} pixels")
    return wrong
