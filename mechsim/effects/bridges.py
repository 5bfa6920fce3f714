"""Bridges: the bonds whose loss parts a structure, and what an impulse puts on them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from kinetics.assembly import Structure


@dataclass(frozen=True, eq=False)
class Bridges:
    """Bonds of one structure whose loss parts it.

    bonds : (n, 2) cubes, indices in the structure
    sides : (n, k) bool, the cubes that stay with the bond's first one
    """

    bonds: np.ndarray
    sides: np.ndarray

    @classmethod
    def of(cls, structure: Structure) -> Bridges:
        """The bridges of a structure; a bond in a loop is none."""
        bonds, sides = [], []
        for i, j in structure.bonds:
            parts = structure.sides(i, j)
            if parts is not None:
                bonds.append((i, j))
                sides.append([cube in parts[0] for cube in range(len(structure))])
        return cls(np.array(bonds, np.int64).reshape(-1, 2), np.array(sides, bool).reshape(-1, len(structure)))

    def levers(self, places: np.ndarray) -> np.ndarray:
        """What an impulse J and its torque T = x × J put on each bridge, (n, 2, 6, 6): mass and edge 1.

        places : (k, 3) the cubes about the structure's centre of mass, from which x is counted
        Second axis: whether J hit the second cube's side or the first's. Rows: tension, two components of the shear,
        and the moment over half an edge; columns: J, T.

        As `kernels.loads.bond_loads` has it, the push through a bond is P = (f - s) J + m ((I^-1 T) × d), where m is
        the mass of one side, f its share of the whole, d its centre, and s is 1 where J hit this side, else 0. The
        moment about the bond, at h from that centre, is (I_side I^-1 - s) T + s d × J - h × P.
        """
        inverse = np.linalg.inv(_inertia(places))
        found = np.zeros((len(self.bonds), 2, 6, 6))
        for n, ((i, j), side) in enumerate(zip(self.bonds, self.sides, strict=True)):
            d = places[side].mean(axis=0)
            arm = _cross((places[i] + places[j]) / 2 - d)
            along = places[j] - places[i]
            frame = np.vstack([along, np.linalg.svd(along[None])[2][1:]])  # and two directions across it
            own = _inertia(places[side] - d) @ inverse
            for struck in (0, 1):
                push = np.hstack([(side.mean() - struck) * np.eye(3), -side.sum() * _cross(d) @ inverse])
                moment = np.hstack([struck * _cross(d), own - struck * np.eye(3)]) - arm @ push
                found[n, struck] = np.vstack([frame @ push, 2 * moment])
        return found


def _inertia(places: np.ndarray) -> np.ndarray:
    """Inertia tensor of unit cubes about the origin."""
    tensor: np.ndarray = np.eye(3) * ((places**2).sum() + len(places) / 6) - places.T @ places
    return tensor


def _cross(v: np.ndarray) -> np.ndarray:
    """The matrix [v]x, with [v]x w = v × w."""
    x, y, z = v
    return np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
