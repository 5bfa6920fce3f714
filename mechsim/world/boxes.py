"""Few boxes that make up a structure: what the engine collides.

The engine finds contacts box by box. Between two boxes of one body lies a face that no other body can touch; a corner
that comes in beside such a seam is also pushed out through it, along a direction in which nothing is there, and the
pushes that undo each other load the bonds many times over. A line, a plate or a block is one box without seams.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import lru_cache
from itertools import product

Place = tuple[int, int, int]
Box = tuple[Place, Place]  # its lowest cube, and how many cubes it has along each axis


@lru_cache(maxsize=4096)
def boxes_of(positions: tuple[Place, ...]) -> tuple[Box, ...]:
    """Boxes that hold each cube once, the largest first: of a T, the bar and the stem's cube.

    positions : lattice places of the cubes. Greedy (of several largest boxes, the one that leaves the largest next), so
    not always the fewest.

    >>> boxes_of(((0, 0, 0), (1, 0, 0), (2, 0, 0), (1, 1, 0)))
    (((0, 0, 0), (3, 1, 1)), ((1, 1, 0), (1, 1, 1)))
    """
    left, found = frozenset(positions), []
    while left:
        boxes = {box: _cubes(box) for box in _within(left)}
        most = max(map(len, boxes.values()))
        largest = [box for box in sorted(boxes) if len(boxes[box]) == most]
        box = largest[0] if len(largest) == 1 else max(largest, key=lambda box: _largest(left - boxes[box]))
        found.append(box)
        left -= boxes[box]
    return tuple(found)


def _largest(cubes: frozenset[Place]) -> int:
    """Cubes of the largest box within these."""
    return max((len(_cubes(box)) for box in _within(cubes)), default=0)


def _within(cubes: frozenset[Place]) -> Iterator[Box]:
    """All boxes of these cubes, from each lowest to each highest cube."""
    for low, high in product(sorted(cubes), repeat=2):
        size = high[0] - low[0] + 1, high[1] - low[1] + 1, high[2] - low[2] + 1
        if min(size) > 0 and _cubes((low, size)) <= cubes:
            yield low, size


def _cubes(box: Box) -> frozenset[Place]:
    (x, y, z), (a, b, c) = box
    return frozenset(product(range(x, x + a), range(y, y + b), range(z, z + c)))
