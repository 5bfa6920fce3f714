"""Bridges: the bonds whose loss parts a structure, and the largest load that a collision can put on one."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from kinetics.assembly import Structure

SLACK = 1 + 1e-6  # rounding, in the loads and in the poses they are computed from


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
        """Of a structure; bonds in a loop are none."""
        bonds, sides = [], []
        for i, j in structure.bonds:
            parts = structure.sides(i, j)
            if parts is not None:
                bonds.append((i, j))
                sides.append([cube in parts[0] for cube in range(len(structure))])
        return cls(np.array(bonds, np.int64).reshape(-1, 2), np.array(sides, bool).reshape(-1, len(structure)))

    def push_bound(self, places: np.ndarray) -> tuple[float, float]:
        """(b, c) such that no bridge carries a push above the sum over the impulses J of |J| (b + c a / edge).

        places : (k, 3) the structure's cubes, in edges
        a : distance of the contact point from the structure's centre of mass

        Proof, with mass and edge 1. The push P through a bond is linear in each impulse J at x from the centre of mass:
        P = (f - s) J + m ((I^-1 (x × J)) × d), where m is one side's mass, f its share of the whole, d its centre from
        the whole's, and s is 1 where J hit this side, else 0 (kernels.loads.bond_loads). By the operator norm and
        |x × J| <= a |J|, |P| <= |J| (max(f, 1 - f) + m |[d]x I^-1| a); pushes of several impulses add up at most.
        """
        return self._largest(places, 1.0, 0.0)

    def wrench_bound(self, places: np.ndarray) -> tuple[float, float]:
        """The same for tension + shear / 2 + moment over half an edge.

        Tension and half the shear are at most sqrt(5/4) |P| (Cauchy and Schwarz). The moment about the bond, at h from
        the side's centre, is (I_side I^-1 - s) (x × J) + s d × J - h × P, with I_side about the side's own centre.
        """
        return self._largest(places, np.sqrt(1.25), 2.0)

    def _largest(self, places: np.ndarray, of_push: float, of_moment: float) -> tuple[float, float]:
        """Bound of of_push |P| + of_moment |moment|: the largest coefficients over bonds and struck sides."""
        whole = places - places.mean(axis=0)
        inverse = np.linalg.inv(_inertia(whole))
        fixed, by_arm = 0.0, 0.0
        for (i, j), side in zip(self.bonds, self.sides, strict=True):
            d = whole[side].mean(axis=0)
            h = np.linalg.norm((whole[i] + whole[j]) / 2 - d)
            mass, own = side.sum(), _inertia(whole[side] - d)
            turn = mass * np.linalg.norm(_cross(d) @ inverse, 2)
            for struck in (0.0, 1.0):
                push = abs(side.mean() - struck)
                moment = struck * np.linalg.norm(d) + h * push
                moment_arm = np.linalg.norm(own @ inverse - struck * np.eye(3), 2) + h * turn
                fixed = max(fixed, float(of_push * push + of_moment * moment))
                by_arm = max(by_arm, float(of_push * turn + of_moment * moment_arm))
        return fixed * SLACK, by_arm * SLACK


def _inertia(places: np.ndarray) -> np.ndarray:
    """Inertia tensor of unit cubes about the origin."""
    return np.eye(3) * ((places**2).sum() + len(places) / 6) - places.T @ places


def _cross(v: np.ndarray) -> np.ndarray:
    """The matrix [v]x, with [v]x w = v × w."""
    x, y, z = v
    return np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
