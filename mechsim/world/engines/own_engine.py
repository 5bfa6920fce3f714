"""An engine of our own: boxes and walls, compiled, in the table of bodies itself.

It keeps the conventions of `base`, and PyBullet's on what these leave open: contacts are looked for where bodies lie
before the step; restitution is taken of the speeds before any impulse; friction keeps within a cone. Other than there,
an impulse acts at one point on both bodies, so that angular momentum is kept, too; and a wall has no back through which
a fast body could leave.

Nothing is called for each body: a step is one call of a kernel, whatever the tank holds, and a body that touches
nothing is left to the world's free flight bit for bit.
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from mechsim.kernels.contact_step import contact_step
from mechsim.world.bodies import Bodies, BodyShape
from mechsim.world.boxes import boxes_of
from mechsim.world.engines.base import LEAST_BOUNCE, OF_ALL_ENGINES, RECOVERY, SLOP, Engine, Touch

FIRST_ROOM = 1024  # contacts; doubled where a step finds more


class OwnEngine(Engine):
    """Contacts of boxes, in Numba. A body of k cubes has at most k boxes, which lie in the rows of its first cubes.

    step : tu; iterations : of the contact solver, at most; it ends earlier once nothing changes
    """

    def __init__(self, bodies: Bodies, step: float, iterations: int):
        n = bodies.n_cubes
        self.bodies, self.step_size, self.iterations = bodies, step, iterations
        self.restitution = self.friction = 0.0
        self._do_collide = False
        self._wall = np.full(3, np.inf)
        self._order = np.empty(0, np.int64)
        self._slot, self._radius = np.zeros(n, np.int64), np.zeros(n)
        self._half, self._offset, self._turn = np.zeros((n, 3)), np.zeros((n, 3)), np.zeros((n, 3, 3))
        self._centre, self._axes = np.zeros((n, 3)), np.zeros((n, 3, 3))
        self._pushed, self._ready = np.full(n, -1), np.zeros((n, 5, 3))
        self._moved, self._found = np.zeros((n, 3)), 0
        self._make_room(FIRST_ROOM)

    def close(self) -> None:
        """Nothing lies outside Python."""

    def set_surface(self, restitution: float, friction: float) -> None:
        """Let cubes collide with each other; the coefficients between any two surfaces, walls included."""
        self.restitution, self.friction, self._do_collide = restitution, friction, True

    def build_walls(self, half: np.ndarray, thickness: float) -> None:  # noqa: ARG002 - planes have none
        """The six planes around the space -half..half; of any thickness, for they have no back."""
        self._wall = half.copy()

    def create(self, slot: int) -> None:
        """Lay out the boxes of a slot that has just been filled."""
        edge, positions = self.bodies.edge, self.bodies.held(slot).positions
        shape, boxes = BodyShape.of(positions), boxes_of(positions)
        rows = list(self.bodies.members[slot][: len(boxes)])
        sizes = np.array([size for _, size in boxes])
        middles = np.array([low for low, _ in boxes]) + (sizes - 1) / 2
        self._slot[rows] = slot
        self._half[rows] = sizes * edge / 2
        self._radius[rows] = np.linalg.norm(self._half[rows], axis=1)
        self._offset[rows] = (middles - shape.centre) @ shape.frame * edge
        self._turn[rows] = shape.frame.T
        self._order = np.concatenate([self._order, np.array(rows, np.int64)])

    def remove(self, slot: int) -> None:
        """Take a slot's boxes out, and the impulses of its contacts."""
        self._order = self._order[self._slot[self._order] != slot]
        self._impulse[: self._found][(self._who[: self._found, :2] == slot).any(axis=1)] = 0.0

    def put(self, slot: int) -> None:
        """The table is what the engine works in."""

    def set_motions(self) -> None:
        """The table is what the engine works in."""

    def step(self) -> None:
        """Find the contacts as the bodies lie, exchange impulses in the table, recover overlaps; the world moves on."""
        b = self.bodies
        while True:
            found = contact_step(
                self._order, self._slot, self._offset, self._turn, self._half, self._radius, self._centre, self._axes,
                self._do_collide, self._wall, b.position, b.orientation, b.velocity, b.spin, b.mass, b.inertia,
                self.restitution, self.friction, LEAST_BOUNCE, RECOVERY, SLOP, self.step_size, self.iterations,
                self._who, self._contact, self._pushed, self._ready, self._rows, self._impulse, self._approach,
                self._moved,
            )  # fmt: skip
            if found <= len(self._who):
                break
            self._make_room(2 * found)
        self._found = found

    def near_contacts(self) -> Iterable[int]:
        """None: free flight takes every body on from the motions that the contacts gave it."""
        return ()

    def read(self, slots: Iterable[int]) -> None:
        """The table is what the engine works in."""

    def touches(self, of_structures: bool = False) -> list[Touch]:
        """Contact points of the last step that carried an impulse, by the bodies' places along z.

        of_structures : only those with a body of several cubes
        """
        n, members = self._found, self.bodies.members
        if not n:
            return []
        found = []
        bounces = self._approach[:n] >= LEAST_BOUNCE
        for (a, b), place, impulse, does_bounce in zip(
            self._who[:n, :2].tolist(), self._contact[:n, :3].tolist(), self._impulse[:n].tolist(), bounces.tolist(),
            strict=True,
        ):  # fmt: skip
            if of_structures and len(members[a]) < 2 and (b < 0 or len(members[b]) < 2):
                continue
            if any(impulse):
                found.append(Touch(a, b, tuple(place), tuple(impulse), does_bounce))
        return found

    def in_force(self) -> dict[str, float]:
        """What the engine has in force; what it has no way to do is 0, and -1 where collisions are hard."""
        return {
            "step": self.step_size,
            "substeps": 0,
            "solver_iterations": self.iterations,
            "gravity": 0.0,
            "inner_iterations": 1,
            **OF_ALL_ENGINES,
            "mass_error": 0.0,
            "inertia_error": 0.0,
            "restitution": self.restitution,
            "friction": self.friction,
            "rolling_friction": 0.0,
            "spinning_friction": 0.0,
            "contact_damping": -1.0,
            "contact_stiffness": -1.0,
            "margin": 0.0,
            "differences": 0.0,
        }

    def _make_room(self, most: int) -> None:
        """Make room for so many contacts in a step."""
        self._who, self._contact = np.zeros((most, 4), np.int64), np.zeros((most, 7))
        self._rows, self._impulse, self._approach = np.zeros((most, 3, 17)), np.zeros((most, 3)), np.zeros(most)
