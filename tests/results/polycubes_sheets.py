"""Contact sheets: every shape of some rows with its number of letters, as SVG."""

from __future__ import annotations

from collections.abc import Sequence

from kinetics.assembly import Structure
from kinetics.assembly.drawing.drawing import CUBIC, LINE, MARGIN, MOVE, QUADRATIC, Drawing
from kinetics.assembly.drawing.pictures import arranged, below_left, posed, shaded, structure_drawing
from kinetics.support.plots import COLOURS
from tests.results.polycubes_rows import Row

SCALE = 0.7  # of the pictures, beside their captions
MOST_WIDE = 42.0  # in the unit in which captions are written
PIXELS = 20.0  # such a unit
NOT_DECIDED, NO_BOOK = "#9A9A9A", "#FFFFFF"
# Of 1, 2, ... letters: from Okabe & Ito, in an order in which neighbours differ in lightness too
BY_LETTERS = (COLOURS[6], COLOURS[4], COLOURS[1], COLOURS[2], COLOURS[5], COLOURS[0])


def caption(row: Row) -> str:
    """`3` letters where they are proven the fewest, `≤3` where not; `none` without a book, `?` where not decided."""
    if row.letters is None:
        return {"infeasible": "none", "single": "–"}.get(row.outcome, "?")
    return f"{row.letters}" if row.is_fewest else f"≤{row.letters}"


def colour(row: Row) -> str:
    """By the number of letters; white without a book, grey where not decided."""
    if row.letters is None:
        return NO_BOOK if row.outcome in {"infeasible", "single"} else NOT_DECIDED
    return colour_of(row.letters)


def colour_of(letters: int) -> str:
    """That of a number of letters; of more than there are colours, the last."""
    return BY_LETTERS[min(letters, len(BY_LETTERS)) - 1]


def picture(row: Row) -> Drawing:
    """The shape, turned so that as much of it as can be is seen."""
    n = len(row.places)
    shape, scaled = posed(Structure(row.places, (0,) * n, ("x",) * n)), Drawing()
    scaled.put(_painted(shape, colour(row), row.key), scale=SCALE)
    return scaled


def _painted(shape: Structure, colour: str, key: object) -> Drawing:
    drawing = structure_drawing(shape, "one", labels=[""] * len(shape))
    drawing.shapes = [
        each._replace(fill=shaded(colour, each.tag[2]), width=0.6, tag=(*each.tag, key)) for each in drawing.shapes
    ]
    return drawing


def sheet(rows: Sequence[Row]) -> Drawing:
    """All shapes in rows from left to right, each with its caption below, and the key of the colours."""
    drawing = arranged([picture(row) for row in rows], [caption(row) for row in rows], MOST_WIDE)
    below_left(drawing, key(rows), gap=0.9)
    return drawing


def key(rows: Sequence[Row]) -> Drawing:
    """What the colours mean, of those that occur."""
    entries = {colour(row): _meaning(row) for row in sorted(rows, key=lambda row: (row.letters or 99, row.outcome))}
    pictures, x = Drawing(), 0.0
    cube = Structure(((0, 0, 0),), (0,), ("x",))
    for fill, text in entries.items():
        pictures.put(_painted(cube, fill, "key"), x, 0.0, 0.7)
        pictures.write(text, x + 0.8, 0.0, 0.6, align=0)
        x = pictures.bounds[2] + 1.2
    return pictures


def _meaning(row: Row) -> str:
    if row.letters is not None:
        more = " or more" if row.letters >= len(BY_LETTERS) else ""
        return f"{row.letters} letter{'' if row.letters == 1 else 's'}{more}"
    return {"infeasible": "no book", "single": "nothing to build"}.get(row.outcome, "not decided")


def svg(drawing: Drawing) -> str:
    """The drawing as the text of an SVG file."""
    left, bottom, right, top = drawing.bounds
    wide, high = (PIXELS * (size + 2 * MARGIN) for size in (right - left, top - bottom))
    size = f'width="{wide:.0f}" height="{high:.0f}"'
    lines = [
        f'<svg xmlns="http://www.w3.org/2000/svg" {size} viewBox="0 0 {wide:.0f} {high:.0f}" stroke-linejoin="round">',
        f'<rect {size} fill="#FFFFFF"/>',
    ]
    commands = {MOVE: "M", LINE: "L", QUADRATIC: "Q", CUBIC: "C"}
    lengths = {QUADRATIC: 2, CUBIC: 3}
    for shape in drawing.shapes:
        words, number = [], 0
        while number < len(shape.codes):
            code = shape.codes[number]
            if code not in commands:
                words.append("Z")
                number += 1
                continue
            taken = lengths.get(code, 1)
            places = shape.points[number : number + taken]
            points = [f"{PIXELS * (x - left + MARGIN):.1f} {PIXELS * (top + MARGIN - y):.1f}" for x, y in places]
            words.append(commands[code] + " ".join(points))
            number += taken
        line = "" if shape.line is None else f' stroke="{shape.line}" stroke-width="{shape.width:g}"'
        lines.append(f'<path d="{"".join(words)}" fill="{shape.fill or "none"}"{line}/>')
    return "\n".join([*lines, "</svg>", ""])
