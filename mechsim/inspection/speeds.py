"""Mean speeds: over bodies, and over all phases of the hold of the fluid's velocity.

Where agitation holds a velocity for a while, the speed of bodies swings within the hold, in line4 between 1.09 and
1.22. A mean speed of ours is the mean over the hold's phase: every step of a hold counts alike.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from mechsim.effects.view import ViewOfBodies
from mechsim.scene import Scene


def steps_of_hold(scene: Scene) -> int:
    """Steps for which the scene holds a velocity of the fluid, the longest of its effects'; 1 where none holds any."""
    held = [effect.held_for for effect in scene.effects if effect.held_for is not None]
    return round(max(held) / scene.numerics.step) if held else 1


def whole_holds(scene: Scene, duration: float) -> int:
    """Steps that make the whole number of holds nearest to `duration` tu, at least one hold."""
    steps = steps_of_hold(scene)
    return steps * max(1, round(duration / (steps * scene.numerics.step)))


def mean_speed(bodies: ViewOfBodies, slots: Sequence[int] | NDArray[np.int64]) -> float:
    """Mean speed of the bodies in these slots now, length / tu."""
    velocity = bodies.velocity[slots]
    return float(np.sqrt(np.einsum("ij,ij->i", velocity, velocity)).mean())
