"""Bonding: faces that meet and whose rules agree latch together."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Annotated, ClassVar, Literal

import numpy as np
from pydantic import Field

from kinetics.assembly import View
from mechsim.effects.base import Action, Effect, EventKind
from mechsim.effects.latches import Encounter, MagnetDelay, Pair
from mechsim.kernels.contact import facing_pairs

if TYPE_CHECKING:
    from mechsim.world import World


class Bonding(Effect):
    """Two faces that look at each other within reach bond if the rule book lets both cubes (paper, III and IV).

    capture_distance : largest gap between the cubes along the faces' bisecting normal, length
    capture_angle : smallest angle between the outward normals, degrees (paper: 135)
    sideways : largest offset of the cubes' centres across that normal, in edges
    latch : what decides whether a capture becomes a bond

    The smaller body snaps to the nearest of the four twists; momenta and the centre of mass are kept. A snap that
    would overlap a third body waits.
    """

    effect: Literal["bonding"] = "bonding"
    needs: ClassVar[tuple[str, ...]] = ("contact",)  # cubes that pass through each other have no faces that meet
    opens: ClassVar[tuple[EventKind, ...]] = ("join",)
    capture_distance: float = Field(default=0.02, gt=0)
    capture_angle: float = Field(default=135.0, ge=90, lt=180)
    sideways: float = Field(default=0.5, gt=0, le=1)
    latch: Annotated[Encounter | MagnetDelay, Field(discriminator="kind")]

    def attach(self, world: World) -> Action:
        """Watch all pairs of uncovered faces."""
        return _Bonding(self, world)


class _Bonding(Action):
    def __init__(self, settings: Bonding, world: World):
        self.settings, self.world = settings, world
        self.cosine = -math.cos(math.radians(settings.capture_angle))
        n = world.bodies.n_cubes
        self.kind = np.full((n, 6), -1, np.int64)
        self.kinds: dict[View, int] = {}
        self.allowed = np.zeros((0, 0), bool)
        self.found = np.zeros((64, 4), np.int64)
        self.latch = settings.latch.attach(world, world.stream("bonding"))
        world.on_change(self.read_faces)

    def read_faces(self, slot: int) -> None:
        """What the rules can tell of each face of a new body, as small numbers for the kernel."""
        bodies, book = self.world.bodies, self.world.book
        structure = bodies.held(slot)
        for index, cube in enumerate(bodies.members[slot]):
            for face in range(6):
                signature = book.view(structure, index, face)
                self.kind[cube, face] = -1 if signature is None else self.number(signature)

    def number(self, signature: View) -> int:
        """Number of a signature; a new one is compared with all known ones, once."""
        if signature not in self.kinds:
            self.kinds[signature] = len(self.kinds)
            book, known = self.world.book, list(self.kinds)
            self.allowed = np.array([[book.allows(a, b) for b in known] for a in known], bool)
        return self.kinds[signature]

    def within_reach(self) -> list[Pair]:
        """Pairs of faces that may bond and are within reach now, in a fixed order."""
        s, b = self.settings, self.world.bodies
        while True:
            count = facing_pairs(
                b.body, b.centre, b.axes, self.kind, self.allowed, b.edge,
                s.capture_distance, self.cosine, s.sideways * b.edge, self.found,
            )  # fmt: skip
            if count <= len(self.found):
                return [tuple(row) for row in self.found[:count].tolist()]
            self.found = np.zeros((2 * count, 4), np.int64)

    def after_step(self) -> None:
        for pair in self.within_reach():
            # An earlier bond of this step may have covered a face or changed what it allows.
            i, f, j, g = pair
            kinds = self.kind[i, f], self.kind[j, g]
            bodies = self.world.bodies
            if bodies.body[i] == bodies.body[j] or min(kinds) < 0 or not self.allowed[kinds]:
                continue
            if self.latch(pair):
                self.dock(pair)

    def dock(self, pair: Pair) -> None:
        """Join the two bodies if nothing stands in the way."""
        docking = self.world.docking(*pair)
        if docking is not None and self.world.fits(*docking):
            self.world.join(*docking)
