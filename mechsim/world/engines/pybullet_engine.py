"""The engine PyBullet, used nowhere else: rigid boxes, their contacts, one step at a time.

What this module rests on, each held by a test:
- velocities are set and no forces used: the velocity after a step minus the one set is the contact impulse over mass;
- a body without any contact point flew freely, so only bodies near a contact need to be read back;
- compounds get their own principal inertia (the engine would take their bounding box's);
- damping is switched off (0.04 by default);
- contact points are taken unfiltered (a filtered list flips normals but not friction directions);
- a removed body's id goes to the next one made.
"""

from __future__ import annotations

import os
from collections import deque
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from itertools import repeat
from pathlib import Path
from typing import Any

import numpy as np

from mechsim.kernels.contact_solver import move_bodies, recover_overlaps, solve_contacts
from mechsim.world.bodies import Bodies, BodyShape, quaternion_of
from mechsim.world.boxes import boxes_of
from mechsim.world.engines.base import LEAST_BOUNCE, OF_ALL_ENGINES, RECOVERY, SLOP, Engine, Touch


@contextmanager
def _quiet() -> Iterator[None]:
    """PyBullet's C code prints its build time when it is imported; a command's output is its own."""
    kept = os.dup(2)
    try:
        with Path(os.devnull).open("wb") as nowhere:
            os.dup2(nowhere.fileno(), 2)
        yield
    finally:
        os.dup2(kept, 2)
        os.close(kept)


with _quiet():
    import pybullet

CUBES, WALLS = 1, 2  # collision groups
# Length: contact points are forgotten once they are so far apart. Remembered ones stop surfaces that come back at the
# gap, whatever the restitution; at 0 the engine finds no contacts.
FORGETTING = 1e-6


class PyBulletEngine(Engine):
    """The engine's side of a table of bodies: one engine body a filled slot, kept in step with `bodies`.

    step : tu; iterations : of the contact solver
    """

    def __init__(self, bodies: Bodies, step: float, iterations: int):
        self.bodies, self.step_size, self.iterations = bodies, step, iterations
        self._body: dict[int, int] = {}  # slot -> engine id
        self._slot: dict[int, int] = {}  # engine id -> slot
        self._shapes: dict[tuple[tuple[int, int, int], ...], int] = {}
        self._walls: list[int] = []
        # Contact points of the last step: slots (-1: a wall), place, impulse on the first, did the surfaces bounce?
        self._who, self._place, self._impulse = np.empty((0, 2), np.int64), np.empty((0, 3)), np.empty((0, 3))
        self._bounces = np.empty(0, bool)
        n = bodies.n_cubes
        self._moved, self._pushed, self._ready = np.zeros((n, 3)), np.full(n, -1), np.zeros((n, 5, 3))
        self._surface, self._friction = {"restitution": 0.0, "lateralFriction": 0.0}, 0.0
        self._collides_with = WALLS
        self.client = pybullet.connect(pybullet.DIRECT)
        pybullet.setPhysicsEngineParameter(
            fixedTimeStep=step,
            numSubSteps=0,  # with sub-steps the contact forces would be those of the last one only
            numSolverIterations=iterations,
            deterministicOverlappingPairs=1,
            contactBreakingThreshold=FORGETTING,
            contactERP=0.0,  # overlaps are recovered in `_recover`: the engine would add a speed for that to bounces
            physicsClientId=self.client,
        )

    def close(self) -> None:
        """Free the engine's memory."""
        pybullet.disconnect(self.client)

    def set_surface(self, restitution: float, friction: float) -> None:
        """Let cubes collide with each other; the coefficients between any two surfaces, walls included.

        The engine multiplies the values of two surfaces, so each gets the square root.
        """
        self._surface = {"restitution": restitution**0.5, "lateralFriction": friction**0.5}
        self._friction, self._collides_with = friction, WALLS | CUBES
        for wall in self._walls:
            pybullet.changeDynamics(wall, -1, **self._surface, physicsClientId=self.client)

    def build_walls(self, half: np.ndarray, thickness: float) -> None:
        """Six fixed boxes around the space -half..half."""
        for axis in range(3):
            extents = (half + thickness).tolist()
            extents[axis] = thickness / 2
            shape = pybullet.createCollisionShape(pybullet.GEOM_BOX, halfExtents=extents, physicsClientId=self.client)
            for sign in (-1, 1):
                place = [0.0, 0.0, 0.0]
                place[axis] = sign * (half[axis] + thickness / 2)
                wall = pybullet.createMultiBody(0, shape, basePosition=place, physicsClientId=self.client)
                pybullet.setCollisionFilterGroupMask(wall, -1, WALLS, CUBES, physicsClientId=self.client)
                pybullet.changeDynamics(wall, -1, **self._surface, physicsClientId=self.client)
                self._walls.append(wall)

    def create(self, slot: int) -> None:
        """Make the engine's body for a slot that has just been filled."""
        b = self.bodies
        body = pybullet.createMultiBody(
            float(b.mass[slot]), self._shape(b.held(slot).positions), physicsClientId=self.client
        )
        pybullet.changeDynamics(
            body, -1,
            linearDamping=0.0, angularDamping=0.0, rollingFriction=0.0, spinningFriction=0.0,
            localInertiaDiagonal=b.inertia[slot].tolist(),
            activationState=pybullet.ACTIVATION_STATE_DISABLE_SLEEPING,
            physicsClientId=self.client, **self._surface,
        )  # fmt: skip
        pybullet.setCollisionFilterGroupMask(body, -1, CUBES, self._collides_with, physicsClientId=self.client)
        self._body[slot], self._slot[body] = body, slot

    def remove(self, slot: int) -> None:
        """Take a slot's body out. The engine gives its id to the next body, so nothing may remember it."""
        body = self._body.pop(slot)
        del self._slot[body]
        pybullet.removeBody(body, physicsClientId=self.client)
        self._impulse[(self._who == slot).any(axis=1)] = 0.0
        self._who[self._who == slot] = -1

    def put(self, slot: int) -> None:
        """Hand a slot's pose and motion to the engine."""
        b = self.bodies
        body, position, orientation = self._body[slot], b.position[slot].tolist(), b.orientation[slot].tolist()
        pybullet.resetBasePositionAndOrientation(body, position, orientation, self.client)
        pybullet.resetBaseVelocity(body, b.velocity[slot].tolist(), b.spin[slot].tolist(), self.client)

    def set_motions(self) -> None:
        """Hand the velocities and spins of all bodies to the engine."""
        b = self.bodies
        ids = map(self._body.__getitem__, b.live.tolist())
        motions = b.velocity[b.live].tolist(), b.spin[b.live].tolist()
        # One call a body is all that there is, and a third of a step: no loop of ours around it.
        deque(map(pybullet.resetBaseVelocity, ids, *motions, repeat(self.client)), maxlen=0)

    def step(self) -> None:
        """Let the engine find contacts, exchange impulses and move the bodies, from the motions last set."""
        pybullet.stepSimulation(self.client)
        points = pybullet.getContactPoints(physicsClientId=self.client)
        slot = self._slot
        self._who = np.array([(slot.get(point[1], -1), slot.get(point[2], -1)) for point in points], np.int64)
        self._who = self._who.reshape(-1, 2)
        # Place, normal, overlap; impulses along the normal and two directions across it.
        table = np.array([(*p[6], *p[7], -p[8], p[9], p[10], *p[11], p[12], *p[13]) for p in points]).reshape(-1, 16)
        table[table[:, 7] == 0.0, 8:] = 0.0  # what is not pushed is not rubbed, and has no directions: any numbers
        self._place = table[:, :3]
        self._impulse = self.step_size * (
            table[:, 7:8] * table[:, 3:6] + table[:, 8:9] * table[:, 9:12] + table[:, 12:13] * table[:, 13:]
        )
        self._bounces = self._recover(table[:, :7]) >= LEAST_BOUNCE

    def _recover(self, contact: np.ndarray) -> np.ndarray:
        """Put bodies apart that overlapped; returns how fast the surfaces of each contact approached before the step.

        By position where they bounced, and by a speed where they did not, whose impulses are added to the engine's.
        contact (M, 7) : place, normal, overlap. The table still has the poses and motions of the step's start, at which
        the engine found them.
        """
        b, client, n = self.bodies, self.client, len(contact)
        who, contact, approach = self._who.copy(), contact.copy(), np.empty(n)
        is_turned = who[:, 0] < 0  # a wall comes second, and the normal pushes the first
        who[is_turned] = who[is_turned, ::-1]
        contact[is_turned, 3:6] *= -1
        recover_overlaps(
            n, who, contact, b.position, b.velocity, b.spin, b.mass, LEAST_BOUNCE, SLOP, self.iterations, approach,
            self._moved,
        )  # fmt: skip
        is_pressed = bool((contact[:, 6] > SLOP).any())
        if not is_pressed and not self._moved.any():
            return approach
        touching = self.near_contacts()
        for slot in touching:
            b.velocity[slot], b.spin[slot] = pybullet.getBaseVelocity(self._body[slot], client)
        if is_pressed:
            impulse = np.empty((n, 3))
            solve_contacts(
                n, who, contact, b.position, b.orientation, b.velocity, b.spin, b.mass, b.inertia, 0.0, self._friction,
                np.inf, RECOVERY, SLOP, self.step_size, self.iterations, self._pushed, self._ready,
                np.zeros((n, 3, 17)), impulse,
            )  # fmt: skip
            self._impulse += np.where(is_turned[:, None], -impulse, impulse)
        for slot in touching:
            b.position[slot], b.orientation[slot] = pybullet.getBasePositionAndOrientation(self._body[slot], client)
        move_bodies(n, who, b.position, self._moved)
        for slot in touching:
            self.put(slot)
        return approach

    def near_contacts(self) -> list[int]:
        """Slots with a contact point in the last step (touching, or just parted): the only ones it may have pushed."""
        return [slot for slot in np.unique(self._who).tolist() if slot >= 0]

    def read(self, slots: Iterable[int]) -> None:
        """Take the poses and motions of these slots from the engine."""
        b, client = self.bodies, self.client
        pose, motion = pybullet.getBasePositionAndOrientation, pybullet.getBaseVelocity
        for slot in slots:
            body = self._body[slot]
            b.position[slot], b.orientation[slot] = pose(body, client)
            b.velocity[slot], b.spin[slot] = motion(body, client)

    def touches(self, of_structures: bool = False) -> list[Touch]:
        """Contact points of the last step that carried an impulse, in the engine's order (the same in every rerun).

        of_structures : only those with a body of several cubes
        """
        found, members = [], self.bodies.members
        points: list[Any] = [each.tolist() for each in (self._who, self._place, self._impulse, self._bounces)]
        for (one, other), place, impulse, bounces in zip(*points, strict=True):
            if of_structures and (one < 0 or len(members[one]) < 2) and (other < 0 or len(members[other]) < 2):
                continue
            if any(impulse):
                found.append(Touch(one, other, tuple(place), tuple(impulse), bounces))
        return found

    def in_force(self) -> dict[str, float]:
        """What the engine says it has in force: its settings, and of all bodies and walls the largest value of each.

        restitution, friction : between two surfaces; mass_error, inertia_error : largest relative deviation of a body
            from the table; contact_damping, contact_stiffness : -1 where collisions are hard; differences : largest one
            between two bodies or walls in any of these
        """
        world = pybullet.getPhysicsEngineParameters(self.client)
        found = {
            "step": world["fixedTimeStep"],
            "substeps": world["numSubSteps"],
            "solver_iterations": world["numSolverIterations"],
            "gravity": max(abs(world[f"gravityAcceleration{axis}"]) for axis in "XYZ"),
            "inner_iterations": world["numNonContactInnerIterations"],
            **OF_ALL_ENGINES,
            "mass_error": 0.0,
            "inertia_error": 0.0,
        }
        least: dict[str, float] = {}
        bodies = {self._body[slot]: slot for slot in self._body}
        for body in (*bodies, *self._walls):
            mass, friction, inertia, _, _, restitution, rolling, spinning, damping, stiffness, _, margin, *_ = (
                pybullet.getDynamicsInfo(body, -1, self.client)
            )
            own = {
                "restitution": restitution**2,
                "friction": friction**2,
                "rolling_friction": rolling,
                "spinning_friction": spinning,
                "contact_damping": damping,
                "contact_stiffness": stiffness,
                "margin": margin,
            }
            if body in bodies:
                slot = bodies[body]
                own["mass_error"] = abs(mass / self.bodies.mass[slot] - 1)
                own["inertia_error"] = float(np.abs(np.array(inertia) / self.bodies.inertia[slot] - 1).max())
            for name, value in own.items():
                found[name] = max(found.get(name, -np.inf), value)
                least[name] = min(least.get(name, np.inf), value)
        compared = [name for name in least if name != "margin" and "error" not in name]  # a compound's own margin is 0
        found["differences"] = max((found[name] - least[name] for name in compared), default=0.0)
        return found

    def _shape(self, positions: tuple[tuple[int, int, int], ...]) -> int:
        """Collision shape of cubes at these lattice places; cached, for each new compound shape leaks 9 kB."""
        known = self._shapes.get(positions)
        if known is None:
            edge, shape, boxes = self.bodies.edge, BodyShape.of(positions), boxes_of(positions)
            halves = [(np.array(size) * edge / 2).tolist() for _, size in boxes]
            if len(boxes) == 1:  # its principal axes are the lattice's
                known = pybullet.createCollisionShape(
                    pybullet.GEOM_BOX, halfExtents=halves[0], physicsClientId=self.client
                )
            else:
                middles = np.array([np.add(low, (np.array(size) - 1) / 2) for low, size in boxes])
                known = pybullet.createCollisionShapeArray(
                    shapeTypes=[pybullet.GEOM_BOX] * len(boxes),
                    halfExtents=halves,
                    collisionFramePositions=((middles - shape.centre) @ shape.frame * edge).tolist(),
                    collisionFrameOrientations=[quaternion_of(shape.frame.T).tolist()] * len(boxes),
                    physicsClientId=self.client,
                )
            if known < 0:
                raise RuntimeError(f"the engine refused a collision shape of {len(positions)} cubes")
            self._shapes[positions] = known
        return known
