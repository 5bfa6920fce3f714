"""Collisions between cubes, with restitution and friction."""

from __future__ import annotations

from typing import Annotated

from msgspec import Meta

from kinetics.support.settings import NotNegative
from mechsim.effects.base import Action, Effect
from mechsim.effects.view import ViewOfWorld


class Contact(Effect, tag="contact"):
    """Collisions of cubes with each other; without this effect they pass through one another, but not through walls.

    restitution : ratio of speeds after and before a collision, 0 to 1. Approaches below 0.2 length / tu do not bounce.
        Collisions are found once bodies overlap, by up to speed * step, and overlaps are recovered by position
    friction : Coulomb's coefficient, a number
    Both hold between any two surfaces, the walls' included.
    """

    restitution: Annotated[float, Meta(ge=0, le=1)] = 0.3
    friction: NotNegative = 0.3

    def attach(self, world: ViewOfWorld) -> Action:
        """Let cubes collide."""
        world.engine.set_surface(self.restitution, self.friction)
        return Action()
