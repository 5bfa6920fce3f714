"""A tank at work: the only door to the physics engine.

PyBullet facts this module rests on (each held by a test): velocities are set, not forces, so that velocity after minus velocity set
is exactly the contact impulse over the mass; a body without any contact point moved ballistically, so only touched bodies and compounds
are read back; compounds get their own principal inertia (the engine would take a bounding box's); damping is switched off (its default
is 0.04); contact points are taken unfiltered (a filtered list flips normals but not friction directions); ids are reused at once.
"""

from __future__ import annotations

import zlib
from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
import pybullet

from kinetics.assembly import RuleBook, Structure, placements
from mechsim.bodies import Bodies, Shape, quaternion_of
from mechsim.kernels.contact import blocked
from mechsim.kernels.motion import TROUBLES, coast, trouble
from mechsim.placement import scatter
from mechsim.effects.base import Action
from mechsim.scene import Scene

RESYNC = 100  # steps after which every body is read back: rounding between our free flight and the engine's cannot build up


class Touch(NamedTuple):
    """One contact point of a step: bodies by slot (-1: a wall), place, and the impulse on `a` (on `b` it is the opposite)."""

    a: int
    b: int
    place: np.ndarray
    impulse: np.ndarray


class Stopped(Exception):  # noqa: N818 - a named outcome, not a fault of the program
    """The guard ended the run; the text is the named reason."""


class World:
    """Cubes in a tank under the effects of a scene, one step at a time.

    scene, book : what is simulated, and the rules its cubes follow
    seed : of all streams of this world; each part draws from its own stream, so leaving one out does not change the others
    """

    def __init__(self, scene: Scene, book: RuleBook, n_cubes: int, seed: np.random.SeedSequence):
        self.scene, self.book, self._seed = scene, book, seed
        self.step_size = scene.numerics.step
        self.step_count = 0
        self.time = 0.0
        self.low, self.high = -np.asarray(scene.tank.size) / 2, np.asarray(scene.tank.size) / 2
        self.bodies = Bodies(n_cubes, scene.cubes.edge, scene.cubes.density * scene.cubes.edge**3)
        self.fluid = np.zeros((n_cubes, 0, 3))
        self.escape = np.full(3, np.inf)
        self.listeners: list[Callable[[tuple[Structure, ...], tuple[Structure, ...]], None]] = []
        self._changed: list[Callable[[int], None]] = []
        self._engine: dict[int, int] = {}  # slot -> engine id
        self._slot: dict[int, int] = {}  # engine id -> slot
        self._shapes: dict[tuple[tuple[int, int, int], ...], int] = {}
        self._restitution, self._friction, self._collide = 0.0, 0.0, False
        self._walls: list[int] = []
        self._contacts: Sequence[tuple] = ()
        self.client = pybullet.connect(pybullet.DIRECT)
        pybullet.setPhysicsEngineParameter(
            fixedTimeStep=self.step_size,
            numSubSteps=0,  # with sub-steps the contact forces are those of the last one only
            numSolverIterations=scene.numerics.solver_iterations,
            deterministicOverlappingPairs=1,
            physicsClientId=self.client,
        )
        actions = [effect.attach(self) for effect in scene.effects]
        self._before = [a.before_step for a in actions if _overrides(a, "before_step")]
        self._after = [a.after_step for a in actions if _overrides(a, "after_step")]
        self._reset = [a.after_reset for a in actions if _overrides(a, "after_reset")]
        self._placing = self.stream("placement")

    def __enter__(self) -> World:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Free the engine."""
        pybullet.disconnect(self.client)

    # -- for effects, while they attach -------------------------------------------------------------------------------------

    def stream(self, name: str) -> np.random.Generator:
        """The random stream of one named part of this world."""
        key = (*self._seed.spawn_key, zlib.crc32(name.encode()))
        return np.random.Generator(np.random.PCG64(np.random.SeedSequence(self._seed.entropy, spawn_key=key)))

    def on_change(self, hook: Callable[[int], None]) -> None:
        """Call `hook(slot)` whenever a slot has got a new structure."""
        self._changed.append(hook)

    def surface(self, restitution: float, friction: float, *, collide: bool) -> None:
        """Surface of all cubes and walls, and whether cubes collide with each other."""
        self._restitution, self._friction, self._collide = restitution, friction, collide
        for wall in self._walls:
            pybullet.changeDynamics(
                wall, -1, restitution=restitution, lateralFriction=friction, physicsClientId=self.client
            )

    def build_walls(self, thickness: float) -> None:
        """Six fixed boxes around the tank."""
        half = self.high
        for axis in range(3):
            extents = (half + thickness).tolist()
            extents[axis] = thickness / 2
            shape = pybullet.createCollisionShape(
                pybullet.GEOM_BOX, halfExtents=extents, physicsClientId=self.client
            )
            for sign in (-1, 1):
                place = [0.0, 0.0, 0.0]
                place[axis] = sign * (half[axis] + thickness / 2)
                wall = pybullet.createMultiBody(0, shape, basePosition=place, physicsClientId=self.client)
                pybullet.setCollisionFilterGroupMask(wall, -1, 2, 1, physicsClientId=self.client)
                pybullet.changeDynamics(
                    wall, -1, restitution=self._restitution, lateralFriction=self._friction, physicsClientId=self.client
                )
                self._walls.append(wall)
        self.escape = half.copy()

    # -- the bodies --------------------------------------------------------------------------------------------------------------

    def populate(self, structures: Sequence[Structure]) -> None:
        """Place these structures at random, at rest; those that still stand as they should are moved, not rebuilt.

        Raises ValueError when they do not fit.
        """
        b = self.bodies
        wanted = list(structures)
        for slot in b.live:
            held = b.held(slot)
            if held in wanted:
                wanted.remove(held)
            else:
                self._remove(slot)
        free_cubes = sorted(set(range(b.n_cubes)) - {c for m in b.members for c in m})
        free_slots = [s for s in range(b.n_cubes) if not b.members[s]]
        for structure in wanted:
            members, free_cubes = tuple(free_cubes[: len(structure)]), free_cubes[len(structure) :]
            self._create(free_slots.pop(0), structure, members)
        b.index()
        scatter(b, self.low, self.high, self._placing)
        for slot in b.live:
            self._put(slot)
            b.born[slot] = self.time
        b.locate()
        for hook in self._reset:
            hook()

    def fits(self, keeper: int, other: int, structure: Structure) -> bool:
        """Would the joined structure overlap a third body or a wall?"""
        b = self.bodies
        position, orientation, _, _ = b.joined_motion(keeper, other, structure)
        centre, axes = b.cubes_at(position, orientation, structure)
        skip = (b.body == keeper) | (b.body == other)
        # A touch is no overlap: the cubes are tested 2 % smaller than they are.
        return not blocked(centre, axes, b.centre, b.axes, skip, b.edge / 2, 0.98, -self.escape, self.escape)

    def join(self, keeper: int, other: int, structure: Structure) -> None:
        """Make one body of two; `structure` holds the keeper's cubes first, in its lattice frame. Momenta are kept exactly."""
        b = self.bodies
        before = b.held(keeper), b.held(other)
        motion = b.joined_motion(keeper, other, structure)
        members = b.members[keeper] + b.members[other]
        self._remove(keeper)
        self._remove(other)
        self._create(keeper, structure, members, motion)
        b.index()
        b.locate()
        self._tell(before, (structure,))

    def part(self, slot: int, fragments: Sequence[tuple[Sequence[int], Structure]]) -> list[int]:
        """Split a body into fragments (indices of its cubes, structure); each goes on as it moved. Returns their slots."""
        b = self.bodies
        before = b.held(slot)
        motions = [b.fragment_motion(slot, structure) for _, structure in fragments]
        members = [tuple(b.members[slot][i] for i in part) for part, _ in fragments]
        self._remove(slot)
        free = [s for s in range(b.n_cubes) if not b.members[s]]
        slots = [slot, *[s for s in free if s != slot][: len(fragments) - 1]]
        for target, (_, structure), cubes, motion in zip(slots, fragments, members, motions, strict=True):
            self._create(target, structure, cubes, motion)
        b.index()
        b.locate()
        self._tell((before,), tuple(structure for _, structure in fragments))
        return slots

    def docking(self, i: int, face: int, j: int, other_face: int) -> tuple[int, int, Structure] | None:
        """How the bodies of cubes i and j would join by these faces: keeper, other, joined structure.

        The heavier body keeps its orientation. None where the rules or the lattice refuse.
        """
        b = self.bodies
        if b.mass[b.body[i]] < b.mass[b.body[j]]:
            i, face, j, other_face = j, other_face, i, face
        keeper, other = int(b.body[i]), int(b.body[j])
        a, c = b.held(keeper), b.held(other)
        at, to = b.members[keeper].index(i), b.members[other].index(j)
        twist = b.nearest(keeper, other, placements(a, at, face, c, to, other_face))
        joined = self.book.join(a, at, c, to, twist)
        return None if joined is None else (keeper, other, joined)

    # -- one step -----------------------------------------------------------------------------------------------------------------

    def step(self) -> None:
        """One step of the engine with all effects; raises Stopped when the guard finds the state wrong."""
        b, client = self.bodies, self.client
        for hook in self._before:
            hook()
        reset = pybullet.resetBaseVelocity
        engine = self._engine
        for slot, v, w in zip(b.live.tolist(), b.velocity[b.live].tolist(), b.spin[b.live].tolist(), strict=True):
            reset(engine[slot], v, w, client)
        pybullet.stepSimulation(client)
        self._contacts = pybullet.getContactPoints(physicsClientId=client)
        coast(b.live, b.position, b.orientation, b.velocity, b.spin, self.step_size)
        self.step_count += 1
        self.time = self.step_count * self.step_size
        self._read(b.live.tolist() if self.step_count % RESYNC == 0 else self._touched())
        self._guard()
        b.locate()
        for hook in self._after:
            hook()

    def touches(self) -> list[Touch]:
        """Contact points of the last step that carried an impulse. Order is the engine's, the same in every rerun."""
        found = []
        for point in self._contacts:
            normal_force = point[9]
            if normal_force == 0.0:
                continue
            impulse = (
                np.array(point[7]) * normal_force + np.array(point[11]) * point[10] + np.array(point[13]) * point[12]
            ) * self.step_size
            found.append(Touch(self._slot.get(point[1], -1), self._slot.get(point[2], -1), np.array(point[5]), impulse))
        return found

    def _touched(self) -> list[int]:
        """Slots whose motion the engine may have changed: those near a contact, and compounds (it turns them gyroscopically)."""
        slot = self._slot
        near = {slot[i] for point in self._contacts for i in point[1:3] if i in slot}
        near.update(self._compounds)
        return sorted(near)

    def _read(self, slots: Sequence[int]) -> None:
        b, client = self.bodies, self.client
        pose, motion = pybullet.getBasePositionAndOrientation, pybullet.getBaseVelocity
        for slot in slots:
            body = self._engine[slot]
            b.position[slot], b.orientation[slot] = pose(body, client)
            b.velocity[slot], b.spin[slot] = motion(body, client)

    def _guard(self) -> None:
        b, limits = self.bodies, self.scene.guard
        code, slot = trouble(
            b.live, b.position, b.velocity, b.spin, -self.escape, self.escape, b.edge, self.step_size,
            limits.max_speed, limits.max_turn,
        )  # fmt: skip
        if code:
            speed, spin = np.linalg.norm(b.velocity[slot]), np.linalg.norm(b.spin[slot])
            raise Stopped(f"{TROUBLES[code]} (time {self.time:.4f} tu, speed {speed:.3g}, spin {spin:.3g})")

    # -- the engine's side of the table -----------------------------------------------------------------------------------------

    def _create(self, slot: int, structure: Structure, members: tuple[int, ...], motion: tuple | None = None) -> None:
        b, client = self.bodies, self.client
        b.fill(slot, structure, members, self.time)
        body = pybullet.createMultiBody(float(b.mass[slot]), self._shape(structure), physicsClientId=client)
        pybullet.changeDynamics(
            body, -1,
            linearDamping=0.0, angularDamping=0.0,
            restitution=self._restitution, lateralFriction=self._friction, rollingFriction=0.0, spinningFriction=0.0,
            localInertiaDiagonal=b.inertia[slot].tolist(),
            activationState=pybullet.ACTIVATION_STATE_DISABLE_SLEEPING,
            physicsClientId=client,
        )  # fmt: skip
        pybullet.setCollisionFilterGroupMask(body, -1, 1, 3 if self._collide else 2, physicsClientId=client)
        self._engine[slot], self._slot[body] = body, slot
        if motion is not None:
            b.position[slot], b.orientation[slot], b.velocity[slot], b.spin[slot] = motion
            self._put(slot)
        self._compounds = [s for s in range(b.n_cubes) if len(b.members[s]) > 1]
        for hook in self._changed:
            hook(slot)

    def _remove(self, slot: int) -> None:
        body = self._engine.pop(slot)
        del self._slot[body]  # the engine hands this id to the next body it makes
        pybullet.removeBody(body, physicsClientId=self.client)
        self.bodies.clear(slot)
        # Contacts of the last step name bodies that are gone; nothing may read them as the new owners of their ids.
        self._contacts = [p for p in self._contacts if body not in p[1:3]]

    def _put(self, slot: int) -> None:
        b = self.bodies
        body, client = self._engine[slot], self.client
        pybullet.resetBasePositionAndOrientation(
            body, b.position[slot].tolist(), b.orientation[slot].tolist(), physicsClientId=client
        )
        pybullet.resetBaseVelocity(body, b.velocity[slot].tolist(), b.spin[slot].tolist(), physicsClientId=client)

    def _shape(self, structure: Structure) -> int:
        """The engine's collision shape; cached, because a new compound shape leaks 9 kB each time it is made."""
        known = self._shapes.get(structure.positions)
        if known is None:
            b, client = self.bodies, self.client
            shape = Shape.of(structure.positions)
            half = [b.edge / 2] * 3
            if len(structure) == 1:
                known = pybullet.createCollisionShape(pybullet.GEOM_BOX, halfExtents=half, physicsClientId=client)
            else:
                k = len(structure)
                turn = quaternion_of(shape.frame.T).tolist()
                known = pybullet.createCollisionShapeArray(
                    shapeTypes=[pybullet.GEOM_BOX] * k,
                    halfExtents=[half] * k,
                    collisionFramePositions=(shape.offset * b.edge).tolist(),
                    collisionFrameOrientations=[turn] * k,
                    physicsClientId=client,
                )
            if known < 0:
                raise RuntimeError(f"the engine refused the collision shape of {structure}")
            self._shapes[structure.positions] = known
        return known

    def _tell(self, before: tuple[Structure, ...], after: tuple[Structure, ...]) -> None:
        for hook in self.listeners:
            hook(before, after)


def _overrides(action: Action, hook: str) -> bool:
    return getattr(type(action), hook) is not getattr(Action, hook)
