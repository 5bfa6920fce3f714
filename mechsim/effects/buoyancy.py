"""Gravity and buoyancy of cubes that are denser or lighter than the fluid."""

from __future__ import annotations

from typing import Any, ClassVar

from kinetics.support.settings import NotNegative, Positive
from mechsim.effects.base import Action, Effect
from mechsim.effects.view import ViewOfWorld


class Buoyancy(Effect, tag="buoyancy"):
    """Gravity and buoyancy: F = -(m - rho_fluid V) g along z at the centre of mass, without torque (uniform cubes).

    All bodies are made of one material, so single cubes and structures accelerate alike, by -(1 - rho_fluid / rho) g.
    The engine applies no forces: the velocity changes by this times the step before each step, and the momentum of a
    step is that of the contact impulses and of this weight. The fluid's own acceleration (added mass) is left out.
    In fluid at rest a cube sinks at sqrt(|rho / rho_fluid - 1| g edge / Cd) with the drag of sub-cubes.

    gravity : g, length / tu^2
    fluid_density : rho_fluid, mass / length^3, 1 in the paper's units; the scene gives that of the cubes, cubes.density
    """

    example: ClassVar[dict[str, Any]] = {"gravity": 1.0}
    gravity: Positive
    fluid_density: NotNegative = 1.0

    def attach(self, world: ViewOfWorld) -> Action:
        """Work out the change of velocity in a step."""
        return _Weighing(self, world)


class _Weighing(Action):
    def __init__(self, settings: Buoyancy, world: ViewOfWorld):
        self.bodies = world.bodies
        lightness = settings.fluid_density / world.scene.cubes.density
        self.change = -(1 - lightness) * settings.gravity * world.step_size

    def before_step(self) -> None:
        self.bodies.velocity[self.bodies.live, 2] += self.change
