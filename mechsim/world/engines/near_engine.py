"""PyBullet with only those bodies in it that may touch something in a step; all others fly freely in the table.

It costs calls a body, set and read from Python, and time for bodies that touch nothing; with one cube in ten in
it at a time a step is 1.5 times cheaper (`tests.benchmarks.bench_mechanics`).

PyBullet makes contact points of boxes that overlap when a step begins, drops them once the boxes are further apart
than BREAKING of the smaller one's radius, and changes the motion of no body without one. So bodies nearer than that to
another, or to a wall, are all whose motion it could change. What differs from having all of them in it is when its
solver stops: after `solver_iterations`, or once no velocity in a group of bodies changes by 3e-4 any more. A group is
of boxes whose bounds overlap, and falls apart where bodies between two contacts are left out: most velocities after a
contact are the same to rounding, most others to 3e-4, and records are other ones.
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from mechsim.kernels.closeness import mark_close
from mechsim.world.bodies import Bodies
from mechsim.world.engines.base import BREAKING
from mechsim.world.engines.pybullet_engine import PyBulletEngine

# Left-out bodies stand in a row so far away, in edges, that nothing else comes there, at rest.
AWAY = 1e9
UPRIGHT = (0.0, 0.0, 0.0, 1.0)


class NearEngine(PyBulletEngine):
    """PyBullet that holds the bodies near a contact alone; `is_in` (B,) says which.

    step : tu; iterations : of the contact solver
    """

    def __init__(self, bodies: Bodies, step: float, iterations: int):
        super().__init__(bodies, step, iterations)
        self.is_in = np.zeros(bodies.n_cubes, bool)
        self._reach, self._margin = np.zeros(bodies.n_cubes), np.zeros(bodies.n_cubes)
        self._spare: dict[tuple[tuple[int, int, int], ...], list[int]] = {}  # the engine's bodies that no slot has
        self._wall = np.full(3, np.inf)
        self._is_colliding = False

    def set_surface(self, restitution: float, friction: float) -> None:
        """Let cubes collide with each other; the coefficients between any two surfaces, walls included."""
        super().set_surface(restitution, friction)
        self._is_colliding = True

    def build_walls(self, half: np.ndarray, thickness: float) -> None:
        """Six fixed boxes around the space -half..half."""
        super().build_walls(half, thickness)
        self._wall = half

    def create(self, slot: int) -> None:
        """Note the size of a slot's body that has just been filled; the engine gets one where it comes near another."""
        shape, edge = self.bodies.shape(slot), self.bodies.edge
        corner = 0.5 if np.array_equal(shape.frame, np.eye(3)) else 0.75**0.5  # along the body's axes, at most
        low, high = shape.offset.min(axis=0) - corner, shape.offset.max(axis=0) + corner
        self._reach[slot] = edge * (np.linalg.norm(shape.offset, axis=1).max() + 0.75**0.5)
        # The engine's radius of a shape: half of its bounds' diagonal, and how far their middle is from its centre.
        self._margin[slot] = BREAKING * edge * (np.linalg.norm(high - low) + np.linalg.norm(high + low)) / 2

    def remove(self, slot: int) -> None:
        """Forget a slot's body, its contact points included."""
        if self.is_in[slot]:
            self._contacts = [point for point in self._contacts if self._body[slot] not in point[1:3]]
            self._take_out(slot)
            self.is_in[slot] = False

    def put(self, slot: int) -> None:
        """Hand a slot's pose and motion to the engine, if it is in it."""
        if self.is_in[slot]:
            super().put(slot)

    def set_motions(self) -> None:
        """Let in the bodies that may touch something, take out the others, and hand the motions over of those in it."""
        b, is_in = self.bodies, self.is_in
        changed = mark_close(
            b.live, b.first, b.flat, b.position, b.centre, b.axes, self._reach, self._margin, b.edge / 2,
            self._wall, self._is_colliding, is_in,
        ).tolist()  # fmt: skip
        for slot in changed:
            if not is_in[slot]:
                self._take_out(slot)
        for slot in changed:
            if is_in[slot]:
                self._let_in(slot)
        self.hand_over(is_in.nonzero()[0])

    def _take_out(self, slot: int) -> None:
        """Set a slot's body aside, for the next one of its shape."""
        b, body = self.bodies, self._body[slot]
        self.place(slot, (AWAY * b.edge, 2.0 * body * b.n_cubes * b.edge, 0.0), UPRIGHT)
        del self._body[slot], self._slot[body]
        self._spare[b.held(slot).positions].append(body)

    def _let_in(self, slot: int) -> None:
        """Give a slot a body, where the table has it."""
        spare = self._spare.setdefault(self.bodies.held(slot).positions, [])
        if spare:
            body = spare.pop()
            self._body[slot], self._slot[body] = body, slot
        else:
            super().create(slot)
        self.place(slot, self.bodies.position[slot].tolist(), self.bodies.orientation[slot].tolist())

    def step(self) -> None:
        """One step of the bodies in the engine."""
        if self._body:
            super().step()
        else:
            self._contacts = ()

    def read(self, slots: Iterable[int]) -> None:
        """Take the poses and motions of these slots from the engine; of those left out the table knows better."""
        super().read(slot for slot in slots if slot in self._body)
