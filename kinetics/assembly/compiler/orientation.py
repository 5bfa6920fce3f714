"""Orientations of a target's cubes, chosen where the target leaves them open."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import product

from kinetics.assembly.faces import Position
from kinetics.assembly.rules.conditions import BookTarget, Direction
from kinetics.assembly.structure import Structure

AXES: tuple[Direction, ...] = ("x", "y", "z")
MOST = 8  # cubes of a target whose parts, and turns of its cubes, are all tried


def chosen_tops(positions: Sequence[Position]) -> tuple[Direction, ...]:
    """Axes for cubes with two face types: as few bonds between side faces as possible, then as many as possible
    between tops and bottoms, then the first in order of x, y, z.

    Cubes that meet with two side faces may be twisted against each other, which it takes a sense (roll) to see; where
    a top or bottom takes part, every twist looks the same. More than eight cubes stand upright: such targets are
    grown cube by cube from a seed, in layers.
    """
    if len(positions) > MOST:
        return (AXES[2],) * len(positions)
    bonds = [
        (i, j, axis)
        for i, p in enumerate(positions)
        for j, q in enumerate(positions[:i])
        for axis in range(3)
        if sum(abs(a - b) for a, b in zip(p, q, strict=True)) == 1 and p[axis] != q[axis]
    ]

    def cost(axes: tuple[int, ...]) -> tuple[int, int]:
        tops = [(axes[i] == axis) + (axes[j] == axis) for i, j, axis in bonds]
        return tops.count(0), -tops.count(2)

    best = min(product(range(3), repeat=len(positions)), key=cost)
    return tuple([AXES[axis] for axis in best])


def turnings(positions: Sequence[Position]) -> tuple[tuple[Direction, ...], ...]:
    """What is worth trying for cubes with two face types: the axes chosen above, then all cubes alike."""
    found: dict[Structure, tuple[Direction, ...]] = {}
    letters = ("#",) * len(positions)
    for tops in (chosen_tops(positions), *((axis,) * len(positions) for axis in AXES)):
        turned = BookTarget(cubes=tuple(positions), letters=letters, tops=tops).structure()
        found.setdefault(turned.canonical("two"), tops)
    return tuple(found.values())
