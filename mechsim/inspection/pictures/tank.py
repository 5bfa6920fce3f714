"""Pictures of the tank from recorded poses, and of the structures that grew in it."""

from __future__ import annotations

from collections import Counter
from typing import Any, Literal

import numpy as np

from kinetics.assembly import FACE_NORMALS
from kinetics.assembly.deriving.history import alike_first
from kinetics.assembly.drawing.drawing import Drawing
from kinetics.assembly.drawing.pictures import FACE_COLOURS, strip
from kinetics.support.packages import mpl
from kinetics.support.plots import colour
from mechsim.inspection.poses import Poses
from mechsim.runs.record import RunRecord, book_of

LARGEST = 6  # number of cubes in a structure from which on all have one colour
EYE = np.array((4.8, -3.15, 2.25))  # in halves of the tank's mean edge
LIGHT = np.array((0.45, -0.6, 0.9))
Paint = Literal["size", "type"]

# Corners of the six faces, in half edges, going round each, in the order of FACE_NORMALS.
CORNERS = np.array(
    [
        [np.roll((s, t * s * p, p), axis) for t, p in ((-1, -1), (1, -1), (-1, 1), (1, 1))]
        for axis, s in ((0, 1), (0, -1), (1, 1), (1, -1), (2, 1), (2, -1))
    ]
)


def draw_tank(record: RunRecord, ax: Any, frame: int = -1, paint: Paint = "size") -> Any:
    """Draw the tank at one recorded moment; returns `ax`.

    frame : index into the recorded poses
    paint : cubes by the "size" of their structure, or faces by their "type"
    ValueError: the run has no poses, or damaged ones.

    >>> from matplotlib.figure import Figure
    >>> from mechsim import RunSpec, Scene, draw_tank, execute
    >>> record = execute(RunSpec(Scene.load("line4"), {"monomer": 4}, duration=0.1, seed=1, run=0, poses=0.05))
    >>> draw_tank(record, Figure().add_subplot()).get_title()
    'line4, 4 cubes at 0.1 tu'
    """
    return draw_frame(Poses.of(record), ax, frame, paint)


def draw_frame(poses: Poses, ax: Any, frame: int, paint: Paint = "size", legend: bool = True) -> Any:
    """Draw one recorded moment of poses that have been checked; returns `ax`."""
    eye = EYE * poses.tank.mean() / 2
    edges = np.array(tank_edges(poses.tank / 2))
    behind = _far_edges(edges, eye)
    polygons, colours = faces_seen(poses, frame, eye, paint)
    ax.add_collection(
        mpl.collections.LineCollection(list(_project(edges[behind], eye)), colors="0.55", linewidths=0.7, zorder=1)
    )
    ax.add_collection(
        mpl.collections.PolyCollection(list(polygons), facecolors=colours, edgecolors="0.25", linewidths=0.3, zorder=2)
    )
    ax.add_collection(
        mpl.collections.LineCollection(list(_project(edges[~behind], eye)), colors="0.55", linewidths=0.7, zorder=3)
    )
    if legend:
        for label, painted in labels(poses, frame, paint):
            ax.plot([], [], "s", ms=9, color=painted, mec="0.4", label=label)
        title = "structures of" if paint == "size" else "faces of type"
        ax.legend(loc="upper left", bbox_to_anchor=(0.97, 1.0), frameon=False, title=title)
    corners = _project(edges, eye).reshape(-1, 2)
    low, high = corners.min(axis=0), corners.max(axis=0)
    room = 0.03 * (high - low)
    ax.set(xlim=(low[0] - room[0], high[0] + room[0]), ylim=(low[1] - room[1], high[1] + room[1]), aspect="equal")
    ax.set(xticks=[], yticks=[])
    ax.set_title(f"{poses.name}, {poses.slots.shape[1]} cubes at {round(float(poses.times[frame]), 1):g} tu")
    for spine in ax.spines.values():
        spine.set_visible(False)
    return ax


def faces_seen(poses: Poses, frame: int, eye: np.ndarray, paint: Paint) -> tuple[np.ndarray, np.ndarray]:
    """Faces turned to the eye as polygons (n, 4, 2), furthest cubes first, and their shaded colours (n, 3).

    Painting them in this order is exact for cubes of a common lattice (a plane between two equal cubes has the nearer
    centre on the eye's side); of two tilted cubes that nearly touch, a corner may come out on the wrong side.
    """
    centres, axes = poses.centres[frame], poses.axes[frame]
    normals = np.einsum("cij,fj->cfi", axes, FACE_NORMALS)
    middles = centres[:, None] + 0.5 * poses.edge * normals
    order = np.argsort(-np.linalg.norm(centres - eye, axis=1), kind="stable")
    shown = ((eye - middles) * normals).sum(axis=2) > 0
    cube, face = np.nonzero(shown[order])
    cube = order[cube]
    corners = centres[cube, None] + 0.5 * poses.edge * np.einsum("nij,nkj->nki", axes[cube], CORNERS[face])
    light = 0.72 + 0.28 * (normals[cube, face] @ (LIGHT / np.linalg.norm(LIGHT)))
    return _project(corners, eye), face_colours(poses, frame, paint)[cube, face] * light[:, None]


def face_colours(poses: Poses, frame: int, paint: Paint) -> np.ndarray:
    """RGB (C, 6, 3), from 0 to 1, of all faces."""
    if paint == "type":
        by_face = np.array([_rgb(FACE_COLOURS[kind]) for kind in poses.face_types])
        return np.broadcast_to(by_face, (poses.slots.shape[1], 6, 3))
    by_cube = np.array([_rgb(_colour(int(size))) for size in poses.sizes(frame)])
    return np.repeat(by_cube[:, None], 6, axis=1)


def labels(poses: Poses, frame: int, paint: Paint) -> list[tuple[str, str]]:
    """Lines of a legend and their colours."""
    if paint == "type":
        return [(kind, FACE_COLOURS[kind]) for kind in sorted(set(poses.face_types))]
    cubes = Counter(poses.sizes(frame).tolist())
    return [(f"{n} cube{'s' if n > 1 else ''}: {cubes[n] // n}", _colour(n)) for n in sorted(cubes)]


def tank_edges(half: np.ndarray) -> list[tuple[np.ndarray, np.ndarray]]:
    """The twelve edges of the tank."""
    corners = [half * np.array([x, y, z]) for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]
    return [(a, b) for i, a in enumerate(corners) for b in corners[:i] if np.count_nonzero(a != b) == 1]


def growth(record: RunRecord, frames: int = 9) -> Drawing:
    """The largest structures so far, from left to right, each with the time at which it came to be.

    frames : at most so many of them, the first and the last among them
    Each lies as it does in the book's target, where it fits into that.
    """
    book, derivation = book_of(record.spec.scene.rules)
    structures = list(derivation.structures.values())
    sizes = np.array([len(structure) for structure in structures])
    present = np.where(record.path.states > 0, sizes, 0)
    largest = len(sizes) - 1 - present[:, ::-1].argmax(axis=1)  # of equal ones the last: the seed, not a free cube
    moments = np.flatnonzero(np.diff(np.maximum.accumulate(sizes[largest]), prepend=0))
    moments = moments[np.unique(np.linspace(0, len(moments) - 1, min(frames, len(moments))).round().astype(int))]
    when = np.concatenate([[0.0], record.path.times])[moments]
    shown = [structures[s] for s in largest[moments]]
    if book.target is not None:
        shown = [next(alike_first(structure, book.target, book.scheme), structure) for structure in shown]
    captions = [f"{len(s)} cube{'s' if len(s) > 1 else ''}, {t:.0f} tu" for s, t in zip(shown, when, strict=True)]
    return strip(shown, captions, book.scheme)


def _colour(size: int) -> str:
    """Colour of structures of n cubes: that of the n-mer's curve, if a network has one structure of each size."""
    return colour(min(size, LARGEST) - 1)


def _rgb(colour: str) -> tuple[float, ...]:
    return tuple(int(colour[i : i + 2], 16) / 255 for i in (1, 3, 5))


def _project(points: np.ndarray, eye: np.ndarray) -> np.ndarray:
    """Where points (..., 3) of the world fall in the picture (..., 2), in perspective, for an eye on the tank's
    middle."""
    ahead = -eye / np.linalg.norm(eye)
    right = np.cross(ahead, (0.0, 0.0, 1.0))
    right /= np.linalg.norm(right)
    seen = (points - eye) @ np.stack([right, np.cross(right, ahead), ahead], axis=1)
    pictured: np.ndarray = seen[..., :2] / seen[..., 2:]
    return pictured


def _far_edges(edges: np.ndarray, eye: np.ndarray) -> np.ndarray:
    """Which of the edges (12, 2, 3) belong to two walls that we look at from within: cubes are in front of them."""
    walls = edges.reshape(-1, 3).max(axis=0)
    on = np.isclose(edges[:, 0], edges[:, 1]) & np.isclose(np.abs(edges[:, 0]), walls)
    faces_eye = np.sign(edges[:, 0]) * eye > walls  # the wall on that side stands between the eye and the cubes
    behind: np.ndarray = ~(on & faces_eye).any(axis=1)
    return behind
