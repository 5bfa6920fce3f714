"""Protocols of what a picture needs to know of a structure, so that drawing depends on no structure or rule book."""

from __future__ import annotations

from typing import Protocol, Self

from kinetics.assembly.faces import Position


class DrawableCubes(Protocol):
    """Cubes on the lattice: places, orientations (indices into ROTATIONS) and letters, one of each a cube."""

    @property
    def positions(self) -> tuple[Position, ...]:
        """Lattice places."""

    @property
    def rotations(self) -> tuple[int, ...]:
        """From each cube's own frame to the lattice's."""

    @property
    def letters(self) -> tuple[str, ...]:
        """What is written on each cube."""

    def turned(self, rotation: int) -> Self:
        """A copy turned about the lattice's origin."""

    def __len__(self) -> int:
        """How many cubes there are."""

    def __hash__(self) -> int:
        """Equal cubes have equal hashes: how they are best seen is looked up."""
