"""Pictures of runs: the tank from recorded poses, by the engine's own software renderer, and what grew in it."""

from __future__ import annotations

from typing import Any

import numpy as np

from kinetics.assembly.drawing import Drawing
from kinetics.assembly.history import alike_first
from kinetics.assembly.pictures import strip
from mechsim.bodies import Bodies, quaternion_of
from mechsim.engine import Engine
from mechsim.record import RunRecord, book_of

# Okabe and Ito's colours, by the number of cubes in a structure: 1, 2, 3, 4, 5, more.
COLOURS = ("#BBBBBB", "#56B4E9", "#E69F00", "#D55E00", "#009E73", "#CC79A7")
EYE = (4.8, -3.15, 2.25)  # in halves of the tank's mean edge


def draw_tank(record: RunRecord, ax: Any, frame: int = -1, width: int = 900, height: int = 720) -> Any:
    """The tank at one recorded moment, cubes coloured by the size of their structure; returns `ax`.

    frame : index into the recorded poses. Raises ValueError for a run without poses.
    """
    if "centres" not in record.arrays:
        raise ValueError(f"{record.spec.title}: no poses were recorded; run it again with poses every so many tu")
    slots = record.arrays["slots"][frame]
    sizes = np.bincount(slots)[slots]
    size = np.asarray(record.spec.scene.tank.size)
    image, clip = _image(record, frame, sizes, np.asarray(EYE) * size.mean() / 2, width, height)
    ax.imshow(image)
    for start, end in _edges(size / 2):
        x, y = zip(*(_pixel(clip, p, width, height) for p in (start, end)), strict=True)
        ax.plot(x, y, color="0.55", lw=0.7)
    for n in sorted(set(sizes.tolist())):
        count = int((sizes == n).sum()) // n
        label = f"{n} cube{'s' if n > 1 else ''}: {count}"
        ax.plot([], [], "s", ms=9, color=_colour(n), mec="0.4", label=label)
    ax.legend(loc="upper right", frameon=False, title="structures of")
    ax.set(xlim=(0, width), ylim=(height, 0), xticks=[], yticks=[])
    when = record.arrays["pose_times"][frame]
    ax.set_title(f"{record.spec.scene.name}, {record.spec.n_cubes} cubes at {round(when, 1):g} tu")
    for spine in ax.spines.values():
        spine.set_visible(False)
    return ax


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


def _image(record: RunRecord, frame: int, sizes: np.ndarray, eye: np.ndarray, width: int, height: int) -> tuple:
    """Every cube as a body of its own at its recorded pose, painted."""
    monomer = book_of(record.spec.scene.rules)[0].monomer()
    n = len(sizes)
    bodies = Bodies(n, record.spec.scene.cubes.edge, 1.0)
    engine = Engine(bodies, step=0.01, iterations=1)
    try:
        for cube in range(n):
            bodies.fill(cube, monomer, (cube,))
            bodies.position[cube] = record.arrays["centres"][frame, cube]
            bodies.orientation[cube] = quaternion_of(record.arrays["axes"][frame, cube])
            engine.create(cube)
            engine.put(cube)
            colour = _colour(int(sizes[cube]))
            red, green, blue = (int(colour[i : i + 2], 16) / 255 for i in (1, 3, 5))
            engine.paint(cube, (red, green, blue, 1.0))
        return engine.picture(eye.tolist(), width, height)
    finally:
        engine.close()


def _colour(size: int) -> str:
    return COLOURS[min(size, len(COLOURS)) - 1]


def _edges(half: np.ndarray) -> list[tuple[np.ndarray, np.ndarray]]:
    """The twelve edges of the tank."""
    corners = [half * np.array([x, y, z]) for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]
    return [(a, b) for i, a in enumerate(corners) for b in corners[:i] if np.count_nonzero(a != b) == 1]


def _pixel(clip: np.ndarray, point: np.ndarray, width: int, height: int) -> tuple[float, float]:
    """Where a point of the world falls in the image."""
    x, y, _, w = clip @ np.append(point, 1.0)
    return (x / w + 1) / 2 * width, (1 - y / w) / 2 * height
