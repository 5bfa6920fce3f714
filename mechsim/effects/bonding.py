"""Bonding of faces that meet and whose rules allow it."""

from __future__ import annotations

from typing import Annotated, Any, ClassVar

from msgspec import Meta

from kinetics.support.settings import Positive
from mechsim.effects.base import Action, Effect, EventKind
from mechsim.effects.faces import CompatibleFaces
from mechsim.effects.latches import Encounter, MagnetDelay, Pair
from mechsim.effects.view import ViewOfWorld


class Bonding(Effect, tag="bonding"):
    """Bonding of two faces that look at each other within reach, if the rule book allows it (paper, III and IV).

    capture_distance : largest gap between the cubes along the faces' bisecting normal, length
    capture_angle : smallest angle between the outward normals, degrees (paper: 135)
    sideways : largest offset of the cubes' centres across that normal, in edges
    latch : the rule that decides whether a capture becomes a bond

    The smaller body snaps to the nearest of the four twists; momenta and the centre of mass are kept. A snap that
    would overlap a third body waits. Where the latch counts meetings, faces that came within reach and left it between
    two steps have met, too, and dock from where they are at the end of the step.
    """

    needs: ClassVar[tuple[str, ...]] = ("contact",)  # cubes that pass through each other have no faces that meet
    opens: ClassVar[tuple[EventKind, ...]] = ("join",)
    example: ClassVar[dict[str, Any]] = {"latch": {"kind": "encounter", "probability": 0.1}}
    capture_distance: Positive = 0.02
    capture_angle: Annotated[float, Meta(ge=90, lt=180)] = 135.0
    sideways: Annotated[float, Meta(gt=0, le=1)] = 0.5
    latch: Encounter | MagnetDelay

    def attach(self, world: ViewOfWorld) -> Action:
        """Watch all pairs of uncovered faces."""
        return _Bonding(self, world)


class _Bonding(Action):
    def __init__(self, settings: Bonding, world: ViewOfWorld):
        self.world = world
        sideways = settings.sideways * world.bodies.edge
        self.faces = CompatibleFaces(
            world, settings.capture_distance, settings.capture_angle, sideways, settings.latch.in_passing
        )
        self.latch = settings.latch.attach(world, world.stream("bonding"))

    def after_step(self) -> None:
        for i, face, j, other in self.faces.within_reach().tolist():
            if self.faces.still_may(i, face, j, other) and self.latch((i, face, j, other)):
                self.dock((i, face, j, other))

    def dock(self, pair: Pair) -> None:
        """Join the two bodies if nothing stands in the way."""
        docking = self.world.docking(*pair)
        if docking is not None and self.world.fits(*docking):
            self.world.join(*docking)
