"""Walls of the tank: six fixed boxes."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from mechsim.effects.base import Action, Effect
from mechsim.effects.view import ViewOfWorld


class Walls(Effect):
    """Six fixed boxes around the tank; thick, so that a fast cube is pushed back rather than passed through.

    thickness : of a wall, length
    """

    effect: Literal["walls"] = "walls"
    thickness: float = Field(default=0.5, gt=0)

    def attach(self, world: ViewOfWorld) -> Action:
        """Build the six boxes; from now on a cube outside the tank is an escape."""
        world.engine.build_walls(world.half, self.thickness)
        world.confine()
        return Action()
