"""Latches: rules by which two faces within reach become a bond, at once or after a delay."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Annotated, ClassVar

import numpy as np
from msgspec import Meta

from kinetics.support.settings import NotNegative, Positive, Settings
from mechsim.effects.view import ViewOfWorld

Pair = tuple[int, int, int, int]  # cube, face, cube, face
Latch = Callable[[Pair], bool]  # asked once a step for every pair within reach


class Encounter(Settings, tag_field="kind", tag="encounter"):
    """Each meeting of two faces latches with a fixed probability, decided when they come within reach.

    probability : that a meeting latches
    refractory : a meeting is over when the faces have been out of reach for this long, tu; faces that rattle against
        each other come within reach again and again, and that is still one meeting
    """

    in_passing: ClassVar[bool] = True  # a meeting counts also where it begins and ends between two steps
    probability: Annotated[float, Meta(gt=0, le=1)]
    refractory: NotNegative = 0.05

    def attach(self, world: ViewOfWorld, rng: np.random.Generator) -> Meetings:
        """Keep account of who meets whom."""
        return Meetings(self, world, rng)


class MagnetDelay(Settings, tag_field="kind", tag="delay"):
    """The magnet switches on after a memoryless delay while the faces stay within reach. rate : 1 / tu."""

    in_passing: ClassVar[bool] = False  # steps within reach add up to the time there, which more looks would overstate
    rate: Positive

    def attach(self, world: ViewOfWorld, rng: np.random.Generator) -> Latch:
        """The chance that the delay ends within this step."""
        chance = -math.expm1(-self.rate * world.step_size)
        return lambda _: bool(rng.random() < chance)


class Meetings:
    """Meetings of faces under way: when the two were last within reach, and whether they are to latch."""

    def __init__(self, settings: Encounter, world: ViewOfWorld, rng: np.random.Generator):
        self.settings, self.world, self.rng = settings, world, rng
        self.under_way: dict[Pair, tuple[float, bool]] = {}
        self.begun = 0

    def __call__(self, pair: Pair) -> bool:
        """Is this meeting one that latches? Drawn once, when it begins."""
        now, refractory = self.world.time, self.settings.refractory
        last, accepted = self.under_way.get(pair, (-math.inf, False))
        if self._side_by_side(pair):
            accepted = False
        elif now - last > refractory:
            self.begun += 1
            accepted = bool(self.rng.random() < self.settings.probability)
        self.under_way[pair] = (now, accepted)
        if len(self.under_way) > 4096:
            self.under_way = {p: m for p, m in self.under_way.items() if now - m[0] <= refractory}
        return accepted

    def _side_by_side(self, pair: Pair) -> bool:
        """Did both bodies come to be in the last step, by parting or by placement? Then their faces have not met."""
        born = self.world.bodies.born[self.world.bodies.body[[pair[0], pair[2]]]]
        return bool(born[0] == born[1] and self.world.time - born[0] < 1.5 * self.world.step_size)
