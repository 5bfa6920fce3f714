"""Drawings as plain shapes: filled outlines, lines, arrows and words, in the order in which they are painted.

Words are outlines as well, with a size in the drawing's own unit, so that a layout is the same on axes of any size.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from kinetics.support import plots
from kinetics.support.arrays import Floats
from kinetics.support.packages import mpl

INK = "#222222"
UNIT = 0.3  # inches to the unit of length (the edge of a cube) when printed
PRINT_DPI = 300
MARGIN = 0.15  # around a drawing, in units
CAP_HEIGHT = 0.73  # of the font, in font sizes
HEAD = (0.26, 0.16)  # length and width of an arrow's head
MOVE, LINE, QUADRATIC, CUBIC, CLOSE = 1, 2, 3, 4, 79  # matplotlib's codes of the points of a path

Point = tuple[float, float]


class Shape(NamedTuple):
    """One outline.

    points (n, 2), codes (n,) : as a matplotlib path has them
    fill, line : colours; None: not filled, no line
    width, style : of the line, in points
    tag : what it shows, for whoever looks for it
    """

    points: Floats
    codes: tuple[int, ...]
    fill: str | None
    line: str | None
    width: float
    style: Any
    tag: Any


class Words(NamedTuple):
    """A text that was drawn, and its box (left, bottom, right, top)."""

    text: str
    box: tuple[float, float, float, float]


class Drawing:
    """Shapes in the order of painting, and the words among them."""

    def __init__(self) -> None:
        self.shapes: list[Shape] = []
        self.words: list[Words] = []

    def polygon(
        self, corners: ArrayLike, fill: str | None = None, line: str | None = None, width: float = 0.6, tag: Any = None
    ) -> None:
        """A closed outline with straight sides."""
        points = np.asarray(corners, dtype=float)
        codes = (MOVE, *(LINE,) * (len(points) - 1), CLOSE)
        self.shapes.append(Shape(np.vstack([points, points[:1]]), codes, fill, line, width, "solid", tag))

    def disc(self, centre: Point, radius: float, fill: str | None, line: str | None = INK, width: float = 0.8) -> None:
        """A circle, as a polygon that looks round."""
        angles = np.linspace(0, 2 * np.pi, 48, endpoint=False)
        self.polygon(np.array(centre) + radius * np.column_stack([np.cos(angles), np.sin(angles)]), fill, line, width)

    def curve(
        self, points: Sequence[Point], line: str = INK, width: float = 0.8, style: Any = "solid", tag: Any = None
    ) -> None:
        """A straight line through two points, or a Bezier curve of three or four."""
        codes = (MOVE, *((LINE,), (QUADRATIC,) * 2, (CUBIC,) * 3)[len(points) - 2])
        self.shapes.append(Shape(np.array(points, dtype=float), codes, None, line, width, style, tag))

    def arrow(
        self,
        points: Sequence[Point],
        line: str = INK,
        width: float = 0.8,
        style: Any = "solid",
        tag: Any = None,
        scale: float = 1.0,
    ) -> None:
        """A line through points, with an arrow head at its end."""
        length, breadth = (scale * size for size in HEAD)
        tip = np.array(points[-1], dtype=float)
        back = np.array(points[-2], dtype=float) - tip
        back /= math.hypot(*back)
        across = np.array([-back[1], back[0]])
        foot = tip + length * back
        self.curve([*points[:-1], (float(foot[0]), float(foot[1]))], line, width, style, tag)
        self.polygon([tip, foot + breadth / 2 * across, foot - breadth / 2 * across], line, None)

    def write(self, text: str, x: float, y: float, size: float, align: float = 0.5, colour: str = INK) -> None:
        """Words with the font size `size`, x at their left (align 0), middle (0.5) or right (1) and y at mid-height."""
        if not text.strip():
            return
        points, codes = outline(text)
        left, right = float(points[:, 0].min()), float(points[:, 0].max())
        offset = np.array([-left - align * (right - left), -CAP_HEIGHT / 2])
        placed = np.array([x, y]) + size * (points + offset)
        self.shapes.append(Shape(placed, codes, colour, None, 0.0, "solid", ("text", text)))
        start = x - align * size * (right - left)
        box = (start, y - size / 2, start + size * (right - left), y + size / 2)
        self.words.append(Words(text, box))

    def put(self, other: Drawing, x: float = 0.0, y: float = 0.0, scale: float = 1.0) -> None:
        """Another drawing, its origin at (x, y)."""
        shift = np.array([x, y])
        thin = min(1.0, scale + 0.2)  # small pictures want thinner lines
        self.shapes += [s._replace(points=shift + scale * s.points, width=thin * s.width) for s in other.shapes]
        for text, (left, bottom, right, top) in other.words:
            box = (x + scale * left, y + scale * bottom, x + scale * right, y + scale * top)
            self.words.append(Words(text, box))

    @property
    def bounds(self) -> tuple[float, float, float, float]:
        """Left, bottom, right, top of all shapes."""
        if not self.shapes:
            return 0.0, 0.0, 0.0, 0.0
        points = np.vstack([shape.points for shape in self.shapes])
        (left, bottom), (right, top) = points.min(axis=0).tolist(), points.max(axis=0).tolist()
        return left, bottom, right, top

    def onto(self, ax: Any) -> Any:
        """Paint onto axes, which are made to fit; returns `ax`."""
        clear = (0.0, 0.0, 0.0, 0.0)
        painted = mpl.collections.PathCollection(
            [mpl.path.Path(shape.points, shape.codes) for shape in self.shapes],
            facecolors=[clear if shape.fill is None else mpl.colors.to_rgba(shape.fill) for shape in self.shapes],
            edgecolors=[clear if shape.line is None else mpl.colors.to_rgba(shape.line) for shape in self.shapes],
            linewidths=[0.0 if shape.line is None else shape.width for shape in self.shapes],
            linestyles=[shape.style for shape in self.shapes],
            joinstyle="round",
            transform=ax.transData,
        )
        ax.add_collection(painted, autolim=False)
        left, bottom, right, top = self.bounds
        ax.set_xlim(left - MARGIN, right + MARGIN)
        ax.set_ylim(bottom - MARGIN, top + MARGIN)
        ax.set_aspect("equal")
        ax.set_axis_off()
        return ax

    @property
    def size(self) -> tuple[float, float]:
        """Width and height in inches when printed."""
        left, bottom, right, top = self.bounds
        return UNIT * (right - left + 2 * MARGIN), UNIT * (top - bottom + 2 * MARGIN)

    def save(self, path: str) -> None:
        """Write it in its own size as PNG, PDF or SVG; the same drawing gives the same bytes."""
        plots.save(path, self.onto, self.size, PRINT_DPI)


@lru_cache(maxsize=4096)
def outline(text: str) -> tuple[Floats, tuple[int, ...]]:
    """Words as a path (points, codes) of font size 1, the baseline at 0."""
    points, codes = mpl.textpath.text_to_path.get_text_path(
        mpl.font_manager.FontProperties("DejaVu Sans"), text, ismath=False
    )
    outlines = np.array(points, dtype=float).reshape(-1, 2) / mpl.textpath.text_to_path.FONT_SCALE
    outlines.setflags(write=False)
    return outlines, tuple(int(code) for code in codes)


def width_of(text: str, size: float) -> float:
    """How wide words of a font size come out."""
    if not text.strip():
        return 0.0
    points, _ = outline(text)
    return size * float(points[:, 0].max() - points[:, 0].min())
