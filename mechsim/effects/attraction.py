"""Short-range magnetic attraction between the centres of faces that may bond."""

from __future__ import annotations

from typing import Any, ClassVar

from kinetics.support.settings import NotNegative, Positive
from mechsim import kernels
from mechsim.effects.base import Action, Effect
from mechsim.effects.faces import CompatibleFaces
from mechsim.effects.view import ViewOfScene, ViewOfWorld


class Attraction(Effect, tag="attraction"):
    """A short-range attraction F = strength / (1 + d / decay)^4 between the centres of two faces, d apart.

    It is the force between two coaxial magnetic dipoles (~ 1 / distance^4) that sit `decay / 2` behind their faces, so
    that it stays finite at contact; potential -strength decay / 3 / (1 + d / decay)^3. The paper's cubes attract each
    other by magnets (section I, after White et al.) but its simulation has no such force: strength and range are the
    user's. Faces attract if the rules let them bond as they are. The two impulses of a pair are equal
    and opposite along one line, so linear and angular momentum are kept to rounding; one step never carries two faces
    past each other, and hands over no more energy than the well still holds, at any step and strength.

    strength : force at contact, mass length / tu^2
    decay : length at which the force has fallen to a sixteenth, length
    reach : distance of the faces' centres beyond which there is no force, length; at most half an edge
    """

    needs: ClassVar[tuple[str, ...]] = ("contact",)  # cubes that pass through each other would end in one place
    example: ClassVar[dict[str, Any]] = {"strength": 0.1}
    strength: NotNegative
    decay: Positive = 0.02
    reach: Positive = 0.05

    def check(self, scene: ViewOfScene) -> None:
        """Check the reach: faces that are not turned towards each other cannot come within half an edge."""
        super().check(scene)
        if self.reach > scene.cubes.edge / 2:
            raise ValueError(
                f"attraction.reach = {self.reach} is more than half the cubes' edge of {scene.cubes.edge}; "
                f"attraction is short-range: use at most {scene.cubes.edge / 2:g}"
            )

    def attach(self, world: ViewOfWorld) -> Action:
        """Watch all pairs of uncovered faces."""
        return _Attracting(self, world)


class _Attracting(Action):
    def __init__(self, settings: Attraction, world: ViewOfWorld):
        self.settings, self.world = settings, world
        # Faces with centres within half an edge are within this gap, angle and offset; the kernel looks at the centres.
        self.faces = CompatibleFaces(world, distance=settings.reach, angle=90.0, sideways=world.bodies.edge)

    def before_step(self) -> None:
        pairs = self.faces.within_reach()
        if len(pairs):
            b, s, w = self.world.bodies, self.settings, self.world
            kernels.forces.attract(
                pairs, b.body, b.centre, b.axes, b.edge, b.position, b.orientation, b.velocity, b.spin,
                b.mass, b.inertia, s.strength, s.decay, s.reach, w.step_size,
            )  # fmt: skip
