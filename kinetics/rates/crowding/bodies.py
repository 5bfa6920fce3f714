"""The geometry of bodies: how large they are for those that hit them, and the room that they have in a tank."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from itertools import product
from typing import TYPE_CHECKING

import numpy as np

from kinetics.network import Tank
from kinetics.support.arrays import Floats, reals
from kinetics.support.frozen import set_fields
from kinetics.support.packages import spatial

if TYPE_CHECKING:
    from kinetics.assembly import Structure


@dataclass(frozen=True, eq=False)
class ConvexBodies:
    """Convex bodies of S species.

    radius (S,) : mean radius of curvature, half the mean width over all directions
    surface (S,), volume (S,)
    ValueError: numbers that are not above 0, or arrays of different lengths

    >>> from kinetics.rates.crowding import ConvexBodies
    >>> spheres = ConvexBodies([0.5], [3.1416], [0.5236])
    >>> spheres.contact([0], [0]).tolist()
    [0.25]
    """

    radius: Floats
    surface: Floats
    volume: Floats

    def __post_init__(self) -> None:
        radius = reals("radius", self.radius, (None,), minimum=0)
        surface, volume = (reals(n, getattr(self, n), radius.shape, minimum=0) for n in ("surface", "volume"))
        set_fields(self, radius=radius, surface=surface, volume=volume)
        if not (np.array([radius, surface, volume]) > 0).all():
            raise ValueError("a body without radius, surface or volume; expected numbers above 0")

    @classmethod
    def of(cls, structures: Iterable[Structure], edge: float) -> ConvexBodies:
        """The convex hulls of groups of cubes of this edge; their volumes are those of the cubes.

        The mean width of a convex polyhedron is the sum over its edges of length times exterior angle, over 4 pi
        (Santalo, Integral Geometry and Geometric Probability, 1976, section 13.6). Cost: milliseconds a structure.

        >>> from kinetics.assembly import RuleBook, derive
        >>> lines = ConvexBodies.of(derive(RuleBook.load("line4")).structures.values(), 0.15)
        >>> lines.radius.round(4).tolist()  # (2 + cubes) edge / 4
        [0.1125, 0.15, 0.1875, 0.225]
        """
        corners = np.array(list(product((-0.5, 0.5), repeat=3)))
        rows = []
        for structure in structures:
            places = np.array(structure.positions, dtype=float)
            hull = spatial.ConvexHull((places[:, None] + corners).reshape(-1, 3) * edge)
            width = 0.0
            for facet, (others, simplex) in enumerate(zip(hull.neighbors, hull.simplices, strict=True)):
                for opposite, other in enumerate(others):
                    if other > facet:
                        first, second = np.delete(simplex, opposite)
                        length = np.linalg.norm(hull.points[first] - hull.points[second])
                        cosine = hull.equations[facet, :3] @ hull.equations[other, :3]
                        width += length * np.arccos(np.clip(cosine, -1.0, 1.0)) / (4 * np.pi)
            rows.append((width / 2, hull.area, len(places) * edge**3))
        return cls(*np.array(rows).T)

    def contact(self, one: Floats, other: Floats) -> Floats:
        """R_i R_j / (R_i + R_j) of pairs of species, the length in their contact value; of a wall it is R_i itself."""
        first, second = self.radius[np.asarray(one)], self.radius[np.asarray(other)]
        return np.asarray(first * second / (first + second))

    def room_of_pairs(self, one: Floats, other: Floats, tank: Tank) -> Floats:
        """How much more often pairs (n,) meet in a tank than ideal points would, because the walls keep them inside.

        The centre of a body of mean width w has the room Pi (L - w), which makes it denser. Two bodies in contact move
        as one whose mean width is that of their union: averaged over directions, for spheres 2 R_i + 2 R_j less twice
        their contact length; for boxes of 1 to 4 cubes, by random placement, 2 % less. So a pair in contact has the
        probability Pi (L - w_ij) / (Pi (L - w_i) Pi (L - w_j)), in units of 1 / volume. ValueError: the tank is too
        narrow.
        """
        wide = 2 * self.radius
        union = wide[np.asarray(one)] + wide[np.asarray(other)] - 2 * self.contact(one, other)
        room, of_pair = self._room(wide, tank), self._room(union, tank)
        return np.asarray(tank.volume * of_pair / (room[np.asarray(one)] * room[np.asarray(other)]))

    def room_at_walls(self, one: Floats, tank: Tank) -> Floats:
        """How much more often bodies (n,) hit a wall: the sum of 1 / (L - w) over the edges, over that of 1 / L."""
        wide = 2 * self.radius[np.asarray(one)]
        self._room(wide, tank)
        sides = np.array(tank.size)
        return np.asarray((1 / (sides - wide[:, None])).sum(axis=1) / (1 / sides).sum())

    @staticmethod
    def _room(wide: Floats, tank: Tank) -> Floats:
        left = np.array(tank.size) - wide[:, None]
        if not (left > 0).all():
            raise ValueError(
                f"bodies of mean width {wide.max():.3g} in contact do not fit into a tank of {tank}; expected a tank "
                "that is wider: crowding models of hard bodies suppose that bodies can move in it"
            )
        return np.asarray(left.prod(axis=1))
