"""Quadratic drag of the fluid on the external faces of the cubes, integrated semi-implicitly."""

from __future__ import annotations

from typing import Annotated, ClassVar, Literal

import numpy as np
from msgspec import Meta

from kinetics.assembly import FACE_NORMALS
from kinetics.support.settings import Positive
from mechsim import kernels
from mechsim.effects.base import Action, Effect
from mechsim.effects.view import ViewOfWorld

# Centres of the eight sub-cubes, in half edges from the cube's centre: +-1/2 on each axis.
_CORNERS = np.array([[x, y, z] for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (-0.5, 0.5)])


class Drag(Effect, tag="drag"):
    """Quadratic drag: f = 1/2 Cd rho A |u - v| (u - v) at each drag point (paper, eq. 4), torque about the centre.

    Its steps are semi-implicit: stable at any step, first order in the step.

    coefficient : Cd, a number, 1.05 for a cube
    fluid_density : rho, mass / length^3, 1 in the paper's units
    points : "sub-cubes" - the eight of the paper, each of area (edge/2)^2 times the uncovered share of its three
        faces; "sub-faces" - the 24 quarter faces, each of area (edge/2)^2 where uncovered
    sub_cycles : semi-implicit steps of drag within one step of the engine, at the cost of the kernel alone. Fluid
        velocity and pose, and with it the lever arms of the drag, are held over them: a body turns only when the
        engine moves it, at the velocity after the last of them and over the whole step. Sub-cycles thus reduce the
        drag's own error, of order step / sub_cycles, and leave that of the engine, first order in the step: they do
        not replace a finer step.

    Cost: one solution of a 6x6 system per body and sub-cycle. Explicit Euler steps cost as much, had errors of speed
    25 to 45 times as large, and were unstable for structures (results/accuracy).
    """

    # Scenes and runs keep the names that they had before there was a choice.
    unless_usual: ClassVar[tuple[str, ...]] = ("sub_cycles",)
    coefficient: Positive = 1.05
    fluid_density: Positive = 1.0
    points: Literal["sub-cubes", "sub-faces"] = "sub-cubes"
    sub_cycles: Annotated[int, Meta(ge=1, le=64)] = 1

    def attach(self, world: ViewOfWorld) -> Action:
        """Lay out the drag points of every cube."""
        return _Dragging(self, world)


def drag_points(points: str) -> tuple[np.ndarray, np.ndarray]:
    """Places (P, 3) in edges from the cube's centre, and each face's share (P, 6) of a point's area of (edge/2)^2."""
    if points == "sub-cubes":
        # Each corner shows one quarter of three faces; one third of its area belongs to each.
        share = (np.einsum("pk,fk->pf", _CORNERS, FACE_NORMALS) > 0) / 3.0
        return _CORNERS / 2.0, share
    corner, face = np.nonzero(np.einsum("pk,fk->pf", _CORNERS, FACE_NORMALS) > 0)
    place = _CORNERS[corner] / 2.0
    normal = FACE_NORMALS[face]
    place = np.where(normal != 0, normal / 2.0, place)
    return place, np.eye(6)[face]


class _Dragging(Action):
    """Where the fluid drags on each body, and on how much area: kept up to date as bodies join and part."""

    def __init__(self, settings: Drag, world: ViewOfWorld):
        self.world, self.sub_cycles = world, settings.sub_cycles
        self.coefficient = 0.5 * settings.coefficient * settings.fluid_density
        self.place, self.share = drag_points(settings.points)
        n = world.bodies.n_cubes
        self.points = np.zeros((n, len(self.place), 3))
        self.areas = np.zeros((n, len(self.place)))
        world.set_drag_points(self.place * world.bodies.edge)
        world.on_change(self.lay_out)

    def lay_out(self, slot: int) -> None:
        """Points and uncovered areas of the cubes of a new body."""
        bodies = self.world.bodies
        for cube in bodies.members[slot]:
            self.points[cube] = bodies.offset[cube] + bodies.edge * self.place @ bodies.turn[cube].T
            self.areas[cube] = self.share @ bodies.uncovered[cube] * (bodies.edge / 2) ** 2

    def before_step(self) -> None:
        b, w = self.world.bodies, self.world
        for _ in range(self.sub_cycles):
            kernels.motion.drag(
                b.live, b.first, b.flat, self.points, self.areas, w.fluid,
                b.orientation, b.velocity, b.spin, b.mass, b.inertia, self.coefficient, w.step_size / self.sub_cycles,
            )  # fmt: skip
