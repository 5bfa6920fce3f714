"""Rigid bodies made of cubes: geometry, table of poses, and the conservation of momenta in joins and breaks."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from kinetics.assembly import FACE_NORMALS, ROTATIONS, Placement, Structure
from mechsim import kernels


@dataclass(frozen=True, eq=False)
class BodyShape:
    """Geometry of a set of lattice cubes of edge 1 and mass 1 about their centre of mass, in principal axes.

    centre (3,) : centre of mass in the lattice frame
    frame (3, 3) : columns are the principal axes in the lattice frame; lattice = centre + frame @ body
    offset (k, 3) : the cubes in the body frame
    inertia (3,) : principal moments, in units of mass * edge^2
    """

    centre: np.ndarray
    frame: np.ndarray
    offset: np.ndarray
    inertia: np.ndarray

    @staticmethod
    @lru_cache(maxsize=4096)
    def of(positions: tuple[tuple[int, int, int], ...]) -> BodyShape:
        """Shape of cubes at these lattice places; equal cubes of uniform density (parallel-axis theorem)."""
        places = np.asarray(positions, float)
        centre = places.mean(axis=0)
        offset = places - centre
        tensor = np.eye(3) * ((offset**2).sum() + len(places) / 6.0) - offset.T @ offset
        if np.abs(tensor - np.diag(np.diag(tensor))).max() < 1e-12:
            frame = np.eye(3)  # keeps lattice axes where they are principal, also when moments coincide
        else:
            frame = np.linalg.eigh(tensor)[1]
            frame[:, 2] *= np.sign(np.linalg.det(frame))
        inertia = np.diag(frame.T @ tensor @ frame).copy()
        return BodyShape(centre, frame, offset @ frame, inertia)


def matrix_of(quaternion: np.ndarray) -> np.ndarray:
    """Rotation matrix (3, 3) of a unit quaternion (x, y, z, w)."""
    return np.array(kernels.motion.rotation_of(*quaternion)).reshape(3, 3)


def quaternion_of(matrix: np.ndarray) -> np.ndarray:
    """Unit quaternion (x, y, z, w) of a rotation matrix; the largest component is divided by, so none is ever
    lost."""
    m = matrix
    squares = np.array(
        [
            1 + m[0, 0] - m[1, 1] - m[2, 2],
            1 - m[0, 0] + m[1, 1] - m[2, 2],
            1 - m[0, 0] - m[1, 1] + m[2, 2],
            1 + m[0, 0] + m[1, 1] + m[2, 2],
        ]
    )
    pick = int(np.argmax(squares))
    columns = np.array(
        [
            [squares[0], m[0, 1] + m[1, 0], m[0, 2] + m[2, 0], m[2, 1] - m[1, 2]],
            [m[0, 1] + m[1, 0], squares[1], m[1, 2] + m[2, 1], m[0, 2] - m[2, 0]],
            [m[0, 2] + m[2, 0], m[1, 2] + m[2, 1], squares[2], m[1, 0] - m[0, 1]],
            [m[2, 1] - m[1, 2], m[0, 2] - m[2, 0], m[1, 0] - m[0, 1], squares[3]],
        ]
    )
    q = columns[pick]
    unit: np.ndarray = q / np.sqrt(q @ q)
    return unit


class Bodies:
    """The table of bodies. A slot is a row; a joined body keeps one slot and frees the other.

    position, velocity, spin (B, 3), orientation (B, 4; x y z w), mass (B,), inertia (B, 3; principal) : by slot
    structure, members : by slot, the lattice structure and the cubes' numbers in its order
    body (C,), offset (C, 3), turn (C, 3, 3) : by cube, its slot, its place and rotation in the body frame
    uncovered (C, 6) : by cube and face, True where no cube of the same body touches it
    centre (C, 3), axes (C, 3, 3; columns) : by cube, in the world; current after `locate`
    born (B,) : time at which the body got its present structure
    """

    def __init__(self, n_cubes: int, edge: float, cube_mass: float):
        self.n_cubes, self.edge, self.cube_mass = n_cubes, edge, cube_mass
        n = n_cubes
        self.position, self.velocity, self.spin = np.zeros((n, 3)), np.zeros((n, 3)), np.zeros((n, 3))
        self.orientation = np.tile([0.0, 0.0, 0.0, 1.0], (n, 1))
        self.mass, self.inertia = np.ones(n), np.ones((n, 3))
        self.structure: list[Structure | None] = [None] * n
        self.members: list[tuple[int, ...]] = [()] * n
        self.body = np.zeros(n, np.int64)
        self.offset, self.turn = np.zeros((n, 3)), np.zeros((n, 3, 3))
        self.uncovered = np.ones((n, 6), bool)
        self.centre, self.axes = np.zeros((n, 3)), np.zeros((n, 3, 3))
        self.born = np.zeros(n)
        self.index()

    def index(self) -> None:
        """Rebuild the lists that the kernels walk, after a slot has been filled or freed."""
        self.live = np.array([s for s, m in enumerate(self.members) if m], np.int64)
        sizes = [len(m) for m in self.members]
        self.first = np.concatenate([[0], np.cumsum(sizes)]).astype(np.int64)
        self.flat = np.array([cube for m in self.members for cube in m], np.int64)

    def shape(self, slot: int) -> BodyShape:
        """Geometry of the structure in a slot, for cubes of edge 1 and mass 1."""
        return BodyShape.of(self.held(slot).positions)

    def held(self, slot: int) -> Structure:
        """The structure in a slot that holds one."""
        structure = self.structure[slot]
        if structure is None:
            raise KeyError(f"slot {slot} holds no body")
        return structure

    def title(self, slot: int) -> str:
        """A body for a message."""
        cubes = ", ".join(map(str, self.members[slot][:8])) + (", ..." if len(self.members[slot]) > 8 else "")
        return f"body {slot} (cube{'s' if len(self.members[slot]) > 1 else ''} {cubes})"

    def lattice(self, slot: int) -> np.ndarray:
        """Rotation (3, 3) from the structure's lattice frame to the world."""
        rotation: np.ndarray = matrix_of(self.orientation[slot]) @ self.shape(slot).frame.T
        return rotation

    def fill(self, slot: int, structure: Structure, members: tuple[int, ...], time: float = 0.0) -> None:
        """Put a structure into a slot: mass, inertia and the cubes' places in it; its pose and motion are the
        caller's."""
        self.structure[slot], self.members[slot], self.born[slot] = structure, members, time
        shape = BodyShape.of(structure.positions)
        cubes = list(members)
        self.mass[slot] = self.cube_mass * len(cubes)
        self.inertia[slot] = shape.inertia * self.cube_mass * self.edge**2
        self.body[cubes] = slot
        self.offset[cubes] = shape.offset * self.edge
        turns = ROTATIONS[list(structure.rotations)]
        self.turn[cubes] = shape.frame.T @ turns
        taken = set(structure.positions)
        for cube, place, turn in zip(cubes, structure.positions, turns, strict=True):
            beside = np.asarray(place) + FACE_NORMALS @ turn.T
            self.uncovered[cube] = [tuple(p) not in taken for p in beside.tolist()]

    def clear(self, slot: int) -> None:
        """Free a slot; its cubes belong nowhere until a `fill` names them."""
        self.structure[slot], self.members[slot] = None, ()

    def locate(self) -> None:
        """Bring `centre` and `axes` of all cubes up to date with the poses."""
        kernels.motion.place_cubes(
            self.live,
            self.first,
            self.flat,
            self.offset,
            self.turn,
            self.position,
            self.orientation,
            self.centre,
            self.axes,
        )

    def cubes_at(
        self, position: np.ndarray, orientation: np.ndarray, structure: Structure
    ) -> tuple[np.ndarray, np.ndarray]:
        """World centres (k, 3) and axes (k, 3, 3) that a structure's cubes would have at this pose of its body."""
        shape = BodyShape.of(structure.positions)
        r = matrix_of(orientation)
        centre = position + self.edge * shape.offset @ r.T
        return centre, r @ (shape.frame.T @ ROTATIONS[list(structure.rotations)])

    def world_inertia(self, slot: int) -> np.ndarray:
        """Inertia tensor (3, 3) about the centre of mass in the world frame."""
        r = matrix_of(self.orientation[slot])
        tensor: np.ndarray = (r * self.inertia[slot]) @ r.T  # R diag(principal moments) R'
        return tensor

    def momentum(self) -> tuple[np.ndarray, np.ndarray]:
        """Total linear momentum and angular momentum about the origin."""
        linear, angular = np.zeros(3), np.zeros(3)
        for s in self.live:
            p = self.mass[s] * self.velocity[s]
            linear += p
            angular += np.cross(self.position[s], p) + self.world_inertia(s) @ self.spin[s]
        return linear, angular

    def nearest(self, keeper: int, other: int, placements: Sequence[Placement]) -> Placement:
        """The placement of the other's lattice in the keeper's that turns the bodies least from how they hang now."""
        turn = self.lattice(keeper).T @ self.lattice(other)
        return max(placements, key=lambda p: float((ROTATIONS[p.rotation] * turn).sum()))

    def joined_motion(self, keeper: int, other: int, structure: Structure) -> tuple[np.ndarray, ...]:
        """Pose and motion (position, orientation, velocity, spin) of two bodies as one, with their momenta.

        The keeper keeps its orientation; `structure` is the joined structure in the keeper's lattice frame.
        """
        ms = self.mass[keeper], self.mass[other]
        x = (ms[0] * self.position[keeper] + ms[1] * self.position[other]) / sum(ms)
        v = (ms[0] * self.velocity[keeper] + ms[1] * self.velocity[other]) / sum(ms)
        angular = np.zeros(3)
        for s in (keeper, other):
            arm = self.position[s] - x
            angular += self.mass[s] * np.cross(arm, self.velocity[s] - v) + self.world_inertia(s) @ self.spin[s]
        shape = BodyShape.of(structure.positions)
        r = self.lattice(keeper) @ shape.frame
        inertia = shape.inertia * self.cube_mass * self.edge**2
        spin = r @ ((r.T @ angular) / inertia)
        return x, quaternion_of(r), v, spin

    def fragment_motion(self, slot: int, fragment: Structure) -> tuple[np.ndarray, ...]:
        """Pose and motion of a part of the body in `slot`: it goes on as it moved, v + w x r and the same spin."""
        whole, part = self.shape(slot), BodyShape.of(fragment.positions)
        lattice = self.lattice(slot)
        arm = lattice @ (part.centre - whole.centre) * self.edge
        position = self.position[slot] + arm
        velocity = self.velocity[slot] + np.cross(self.spin[slot], arm)
        return position, quaternion_of(lattice @ part.frame), velocity, self.spin[slot].copy()
