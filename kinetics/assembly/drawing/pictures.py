"""Pictures of structures: cubes in parallel projection, faces coloured by type, letters on them."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from kinetics.assembly.drawing.drawable_cubes import DrawableCubes
from kinetics.assembly.drawing.drawing import INK, Drawing, width_of
from kinetics.assembly.faces import FACE_NORMALS, NORMALS, Position, scheme_of, turned
from kinetics.support.arrays import Floats
from kinetics.support.packages import mpl
from kinetics.support.plots import COLOURS

# Okabe & Ito's orange, sky blue, green, purple and yellow, and a grey: light enough for black letters
FACE_COLOURS: Mapping[str, str] = {
    "f1": COLOURS[1],
    "f2": COLOURS[4],
    "f3": COLOURS[2],
    "f4": COLOURS[3],
    "f5": COLOURS[6],
    "f6": "#B3B3B3",
}
HIGHLIGHT = COLOURS[5]
LETTER = 0.62  # font size on a face, in cube edges
CAPTION = 0.36  # font size under a picture
GAP = 0.55  # between pictures
SPOTS = (-0.28, 0.0, 0.28)  # along both sides of a face: where a letter must not be hidden
N_SPOTS = len(SPOTS) ** 2
NOT_ALL = "incomplete: the exploration reached its limits or was interrupted"
TURNED = turned.tolist()
C = TypeVar("C", bound=DrawableCubes)


@dataclass(frozen=True)
class Camera:
    """Where we look from, infinitely far away.

    azimuth : about z, from +x towards +y, degrees
    elevation : above the xy plane, degrees
    """

    azimuth: float = -62.0
    elevation: float = 30.0

    def __post_init__(self) -> None:
        if not (math.isfinite(self.azimuth) and -90 <= self.elevation <= 90):
            raise ValueError(
                f"azimuth is {self.azimuth} and elevation {self.elevation}; expected finite degrees, the elevation "
                "from -90 to 90"
            )

    @property
    def towards(self) -> Floats:
        """(3,): unit vector from the scene to the eye."""
        a, e = math.radians(self.azimuth), math.radians(self.elevation)
        direction = np.array([math.cos(e) * math.cos(a), math.cos(e) * math.sin(a), math.sin(e)])
        return np.where(np.abs(direction) < 1e-9, 0.0, direction)

    @property
    def screen(self) -> Floats:
        """(2, 3): the directions to the right and up in the picture."""
        a, e = math.radians(self.azimuth), math.radians(self.elevation)
        right = (-math.sin(a), math.cos(a), 0.0)
        up = (-math.sin(e) * math.cos(a), -math.sin(e) * math.sin(a), math.cos(e))
        return np.array([right, up])


CAMERA = Camera()


def structure_drawing(
    structure: DrawableCubes,
    scheme: str = "two",
    highlight: Collection[int] = (),
    labels: Sequence[str] | None = None,
    camera: Camera = CAMERA,
) -> Drawing:
    """Cubes of edge 1 as they lie, the lattice's origin at the origin.

    highlight : cubes that get a bold rim
    labels : one text a cube instead of its letter; "" for none
    Each text stands on one face of its cube that nothing hides; cubes without such a face show none.
    """
    texts = structure.letters if labels is None else tuple(labels)
    if len(texts) != len(structure):
        raise ValueError(f"labels has {len(texts)} texts for {len(structure)} cubes; give one for each")
    if unknown := [cube for cube in highlight if not 0 <= cube < len(structure)]:
        raise ValueError(f"highlight names cube {unknown[0]}; the structure's are 0 to {len(structure) - 1}")
    types = scheme_of(scheme).types
    lettered = dict(_lettered(structure, camera))
    bold = set(highlight)
    drawing = Drawing()
    for cube, direction in _painted(structure, camera):
        frame = _frame(direction, camera)
        corners = _on_screen(structure.positions[cube], frame, SQUARE, camera)
        own = types[TURNED[structure.rotations[cube]].index(direction)]
        drawing.polygon(corners, shaded(FACE_COLOURS[own], direction, camera), INK, 0.7, ("face", cube, direction))
        if cube in bold:
            rim = _on_screen(structure.positions[cube], frame, 0.86 * SQUARE, camera)
            drawing.polygon(rim, None, HIGHLIGHT, 1.6, ("rim", cube, direction))
        if lettered.get(cube) == direction:
            _write(drawing, texts[cube], structure.positions[cube], frame, camera)
    return drawing


def strip(
    structures: Sequence[DrawableCubes],
    captions: Sequence[str] = (),
    scheme: str = "two",
    highlights: Sequence[Collection[int]] = (),
    most_wide: float = 24.0,
    camera: Camera = CAMERA,
) -> Drawing:
    """Frames from left to right, in rows no wider than `most_wide` cube edges, each with its caption below."""
    for name, given in (("captions", captions), ("highlights", highlights)):
        if given and len(given) != len(structures):
            raise ValueError(f"{name} has {len(given)} entries for {len(structures)} structures; give one for each")
    if not structures:
        raise ValueError("there is no structure to draw; give at least one")
    pictures = [
        structure_drawing(structure, scheme, highlights[n] if highlights else (), camera=camera)
        for n, structure in enumerate(structures)
    ]
    return arranged(pictures, captions or [""] * len(pictures), most_wide)


def species_sheet(
    species: Mapping[str, DrawableCubes], scheme: str = "two", is_closed: bool = True, most_wide: float = 24.0
) -> Drawing:
    """All species of a network with their names, in their order; then the key of the faces.

    is_closed : whether these are known to be all; the sheet says if they are not
    """
    pictures = [structure_drawing(posed(structure), scheme) for structure in species.values()]
    sheet = arranged(pictures, list(species), most_wide)
    below_left(sheet, face_key(scheme))
    if not is_closed:
        below_left(sheet, note(NOT_ALL))
    return sheet


def arranged(pictures: Sequence[Drawing], captions: Sequence[str], most_wide: float, gap: float = GAP) -> Drawing:
    """Pictures in rows of about one length, middles at one height, with their captions below."""
    boxes = [picture.bounds for picture in pictures]
    wides = [
        max(right - left, width_of(caption, CAPTION))
        for (left, _, right, _), caption in zip(boxes, captions, strict=True)
    ]
    sheet = Drawing()
    top = 0.0
    for row in _broken(wides, most_wide, gap):
        high = max(boxes[n][3] - boxes[n][1] for n in row)
        x, foot = 0.0, top - high - 0.35
        for n in row:
            left, bottom, right, upper = boxes[n]
            centre = x + wides[n] / 2
            sheet.put(pictures[n], centre - (left + right) / 2, top - high / 2 - (bottom + upper) / 2)
            sheet.write(captions[n], centre, foot, CAPTION)
            x += wides[n] + gap
        top = foot - (CAPTION if any(captions[n] for n in row) else 0.0) - GAP
    return sheet


def _broken(wides: Sequence[float], most_wide: float, gap: float) -> list[list[int]]:
    """Numbers of pictures in rows: as few rows as the width allows, and those as even as can be."""

    def rows(limit: float) -> list[list[int]]:
        found: list[list[int]] = []
        x = math.inf
        for number, wide in enumerate(wides):
            if x + wide > limit:
                found.append([])
                x = 0.0
            found[-1].append(number)
            x += wide + gap
        return found

    low, high = max(wides), max(most_wide, *wides)
    fewest = len(rows(high))
    for _ in range(30):
        middle = (low + high) / 2
        low, high = (low, middle) if len(rows(middle)) == fewest else (middle, high)
    return rows(high)


def face_key(scheme: str) -> Drawing:
    """Colour and name of each face type."""
    key = Drawing()
    facing = [direction for direction in range(6) if FACE_NORMALS[direction] @ CAMERA.towards > 0]
    x = 0.0
    for name in scheme_of(scheme).names:
        for direction in facing:  # a small cube, so that all three shades show
            spots = 0.45 * _on_screen((0, 0, 0), _frame(direction, CAMERA), SQUARE, CAMERA)
            key.polygon(spots + np.array([x + 0.3, 0]), shaded(FACE_COLOURS[name], direction), INK, 0.5)
        key.write(name, x + 0.75, 0, CAPTION, align=0)
        x += 0.75 + width_of(name, CAPTION) + 0.5
    return key


def note(text: str, size: float = CAPTION) -> Drawing:
    """A line of words."""
    line = Drawing()
    line.write(text, 0, 0, size, align=0)
    return line


def below_left(drawing: Drawing, other: Drawing, gap: float = GAP) -> None:
    """Put one drawing under another, flush left."""
    left, bottom, _, _ = drawing.bounds
    its_left, _, _, its_top = other.bounds
    drawing.put(other, left - its_left, bottom - its_top - gap)


def posed(structure: C) -> C:
    """Turned so that it lies wide and flat towards the eye and as many cubes as can be show a letter."""
    return structure.turned(_best_turn(structure))


@lru_cache(maxsize=4096)
def _best_turn(structure: DrawableCubes) -> int:
    copies = [structure.turned(rotation) for rotation in range(24)]

    def flatness(rotation: int) -> tuple[float, float]:
        x, y, z = (max(c) - min(c) for c in zip(*copies[rotation].positions, strict=True))
        return (-y, x) if y <= z <= x else (-math.inf, 0)

    best = max(map(flatness, range(24)))
    flattest = [rotation for rotation in range(24) if flatness(rotation) == best]
    return max(flattest, key=lambda rotation: (*_shown(copies[rotation]), *_low_first(copies[rotation])))


def _shown(structure: DrawableCubes) -> tuple[int, int, int]:
    """How many cubes and faces are in view, in part at least, and how many letters."""
    faces, hidden = _in_view(structure, CAMERA)
    seen = [face for face, covered in zip(faces, np.all(hidden, axis=1), strict=True) if not covered]
    letters = {cube for (cube, _), covered in zip(faces, np.any(hidden, axis=1), strict=True) if not covered}
    return len({cube for cube, _ in seen}), len(seen), len(letters)


def shaded(colour: str, direction: int, camera: Camera = CAMERA) -> str:
    """The colour of a face that looks in a direction: light from above, the broader of the sides brighter."""
    if direction == 4:
        white = 0.45
    elif abs(FACE_NORMALS[direction] @ camera.towards) > 0.6:
        white = 0.25
    else:
        white = 0.0
    red, green, blue = (part + white * (1 - part) if white else 0.88 * part for part in mpl.colors.to_rgb(colour))
    return mpl.colors.to_hex((red, green, blue))


SQUARE: Floats = np.array([(-0.5, -0.5), (0.5, -0.5), (0.5, 0.5), (-0.5, 0.5)])


def _low_first(structure: DrawableCubes) -> tuple[int, int]:
    """Prefers cubes low and to the left: a T lies with its bar at the bottom."""
    x, _, z = (sum(c) - len(c) * min(c) for c in zip(*structure.positions, strict=True))
    return -z, -x


def _painted(structure: DrawableCubes, camera: Camera) -> list[tuple[int, int]]:
    """(cube, direction) of all outer faces that look to the eye, farthest first.

    On the lattice, what hides a cube is nowhere behind it along any axis: the sum of the coordinates towards the eye
    orders them.
    """
    towards = camera.towards
    sign = np.sign(towards)
    facing = [direction for direction in range(6) if FACE_NORMALS[direction] @ towards > 0]
    filled = set(structure.positions)
    depth = np.array(structure.positions) @ sign
    order = sorted(range(len(structure)), key=lambda cube: (depth[cube], structure.positions[cube]))
    return [
        (cube, direction)
        for cube in order
        for direction in facing
        if _beside(structure.positions[cube], NORMALS[direction]) not in filled
    ]


def _beside(place: Position, step: Position) -> Position:
    return place[0] + step[0], place[1] + step[1], place[2] + step[2]


def _lettered(structure: DrawableCubes, camera: Camera) -> list[tuple[int, int]]:
    """(cube, direction): a face of each cube whose middle part is in full view, if it has one.

    Letters that look the same way read best: of the directions, the one with most such faces comes first.
    """
    faces, hidden = _in_view(structure, camera)
    seen = [face for face, covered in zip(faces, np.any(hidden, axis=1), strict=True) if not covered]
    shown = Counter(direction for _, direction in seen)
    order = sorted(shown, key=lambda d: (shown[d], round(float(FACE_NORMALS[d] @ camera.towards), 9)))
    chosen = {cube: direction for last in order for cube, direction in seen if direction == last}
    return sorted(chosen.items())


def _in_view(structure: DrawableCubes, camera: Camera) -> tuple[list[tuple[int, int]], NDArray[np.bool_]]:
    """The painted faces, and (faces, N_SPOTS) whether each of the spots where a letter would be is hidden."""
    faces = _painted(structure, camera)
    if not faces:
        return faces, np.empty((0, N_SPOTS), dtype=bool)
    cubes, directions = (np.array(part) for part in zip(*faces, strict=True))
    places = np.array(structure.positions, dtype=float)
    grids = []
    for direction in range(6):
        right, up, normal = _frame(direction, camera)
        grids.append([normal / 2 + u * right + v * up for u in SPOTS for v in SPOTS])
    spots = (places[cubes][:, None, :] + np.array(grids)[directions]).reshape(-1, 3)
    return faces, _is_hidden(spots, places, camera.towards).reshape(len(faces), N_SPOTS)


def _is_hidden(points: Floats, places: Floats, towards: Floats) -> NDArray[np.bool_]:
    """(n,): whether the ray from each point (n, 3) to the eye enters a cube."""
    enters, leaves = np.full((2, len(points), len(places)), -np.inf)
    leaves[:] = np.inf
    for axis in range(3):
        along = towards[axis] or 1e-12
        middle = (places[:, axis] - points[:, axis, None]) / along
        np.maximum(enters, middle - 0.5 / abs(along), out=enters)
        np.minimum(leaves, middle + 0.5 / abs(along), out=leaves)
    covers: NDArray[np.bool_] = (leaves > enters + 1e-9) & (leaves > 1e-9)
    return np.asarray(covers.any(axis=1))


@lru_cache(maxsize=256)
def _frame(direction: int, camera: Camera) -> tuple[Floats, Floats, Floats]:
    """To the right and up on a face, as a letter on it is read, and out of it."""
    normal = FACE_NORMALS[direction].astype(float)
    right = max(
        (axis.astype(float) for axis in FACE_NORMALS if axis @ normal == 0 and (direction > 3 or axis[2] == 0)),
        key=lambda axis: round(float(camera.screen[0] @ axis), 9),
    )
    return right, np.cross(normal, right), normal


def _on_screen(place: Sequence[int], frame: tuple[Floats, Floats, Floats], spots: Floats, camera: Camera) -> Floats:
    """Points (n, 2) given within a face of the cube at a place, as they appear in the picture."""
    right, up, normal = frame
    middle = np.array(place) + normal / 2
    return (middle + spots[:, :1] * right + spots[:, 1:] * up) @ camera.screen.T


def _write(
    drawing: Drawing, text: str, place: Sequence[int], frame: tuple[Floats, Floats, Floats], camera: Camera
) -> None:
    """A text in the middle of a face, slanted with it, and small enough for it."""
    flat = Drawing()
    flat.write(text, 0, 0, min(LETTER, 0.8 * LETTER / max(width_of(text, LETTER), 1e-9)))
    for shape in flat.shapes:
        low, high = shape.points.min(axis=0), shape.points.max(axis=0)
        points = _on_screen(place, frame, shape.points - (low + high) / 2, camera)
        drawing.shapes.append(shape._replace(points=points))
    for words in flat.words:
        left, bottom, right, top = words.box
        spots = _on_screen(place, frame, np.array([(left, bottom), (right, top), (left, top), (right, bottom)]), camera)
        (x0, y0), (x1, y1) = spots.min(axis=0).tolist(), spots.max(axis=0).tolist()
        drawing.words.append(words._replace(box=(x0, y0, x1, y1)))
