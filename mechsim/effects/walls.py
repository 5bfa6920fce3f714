"""Walls of the tank: six fixed boxes."""

from __future__ import annotations

from kinetics.support.settings import Positive
from mechsim.effects.base import Action, Effect
from mechsim.effects.view import ViewOfWorld


class Walls(Effect, tag="walls"):
    """The walls of the tank: six fixed boxes, thick enough that a fast cube is pushed back and does not pass through.

    thickness : thickness of a wall, length; the walls of the engine `own` have no back, whatever it is
    """

    thickness: Positive = 0.5

    def attach(self, world: ViewOfWorld) -> Action:
        """Build the six boxes; from now on a cube outside the tank is an escape."""
        world.engine.build_walls(world.half, self.thickness)
        world.confine()
        return Action()
