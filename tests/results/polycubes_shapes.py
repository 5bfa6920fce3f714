"""Polycubes: every one of so many cubes, free of rotation, mirror images apart; and samples of them."""

from __future__ import annotations

from collections.abc import Iterable
from functools import cache

import numpy as np

from kinetics.assembly.faces import NORMALS, ROTATIONS, Position

Shape = tuple[Position, ...]
# How many there are of 1, 2, ... cubes: sequence A000162 of the On-Line Encyclopedia of Integer Sequences.
KNOWN = (1, 1, 2, 8, 29, 166, 1023, 6922)
SIZES = tuple(range(1, len(KNOWN) + 1))  # of the table: all shapes of few cubes, a sample of each larger size
ALL_UP_TO, SAMPLE, SEED = 6, 50, 1


def canonical(cubes: Shape) -> Shape:
    """The same cubes turned and moved so that their sorted places are the smallest; alike for all turns of a shape."""
    turned = ROTATIONS @ np.array(cubes).T  # (24, 3, n)
    turned -= turned.min(axis=2, keepdims=True)
    size = len(cubes)
    codes = np.sort((turned[:, 0] * size + turned[:, 1]) * size + turned[:, 2], axis=1)
    smallest = min(codes.tolist())
    return tuple((code // size**2, code // size % size, code % size) for code in smallest)


@cache
def polycubes(size: int) -> tuple[Shape, ...]:
    """All of that many cubes, sorted: each of one cube less, with a cube added wherever one fits; 2 s for 8 cubes."""
    if size == 1:
        return (((0, 0, 0),),)
    found: set[Shape] = set()
    for cubes in polycubes(size - 1):
        taken = set(cubes)
        free = {(x + u, y + v, z + w) for x, y, z in cubes for u, v, w in NORMALS} - taken
        found |= {canonical((*cubes, place)) for place in free}
    return tuple(sorted(found))


def sampled(size: int, number: int, seed: int) -> tuple[int, ...]:
    """Numbers of that many different polycubes within `polycubes(size)`, sorted; every set of them equally likely.

    Shapes are drawn as they are free of rotation, so symmetrical ones are as likely as others. All, if there are no
    more than `number`.
    """
    there = len(polycubes(size))
    if there <= number:
        return tuple(range(there))
    drawn = np.random.default_rng([seed, size]).choice(there, number, replace=False)
    return tuple(sorted(drawn.tolist()))


def chosen(sizes: Iterable[int], seed: int) -> list[tuple[int, int]]:
    """(cubes, number) of the shapes of the table."""
    return [
        (size, number)
        for size in sizes
        for number in (range(len(polycubes(size))) if size <= ALL_UP_TO else sampled(size, SAMPLE, seed))
    ]
