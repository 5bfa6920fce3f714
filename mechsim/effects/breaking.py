"""Breaking of bonds by the impulse that they transmit in a collision."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, ClassVar, Literal

import numpy as np
from pydantic import Field

from kinetics.assembly import Structure
from mechsim.effects.base import Action, Effect, EventKind
from mechsim.effects.bridges import Bridges
from mechsim.effects.hits import Hit
from mechsim.effects.view import ViewOfScene, ViewOfTouch, ViewOfWorld
from mechsim.kernels.loads import bond_loads, hit_bound


def _pull(load: np.ndarray) -> np.ndarray:
    """Pull and shear of each bond; a push tears nothing."""
    return np.hypot(np.maximum(load[:, 0], 0.0), load[:, 1])


# What tears a bond: (tension, shear, moment) of each bond, (bonds, 3), and the structure's change of velocity, to one
# number each; the bond with the largest one breaks where that exceeds the threshold.
CRITERIA: dict[str, Callable[[np.ndarray, float], np.ndarray]] = {
    "impulse": lambda load, _: _pull(load),
    "wrench": lambda load, _: np.maximum(load[:, 0], 0.0) + 0.5 * load[:, 1] + load[:, 2],
    "velocity": lambda load, change: change * _pull(load) / max(_pull(load).max(), np.finfo(float).tiny),
}

# By criterion, (of_pull, of_moment, of_change) such that no bond carries more than of_pull times its pull and shear +
# of_moment times its moment + of_change times the structure's change of velocity. For "wrench" by Cauchy and Schwarz.
BOUNDS = {
    "impulse": (1.0, 0.0, 0.0),
    "wrench": (math.sqrt(1.25), 1.0, 0.0),
    "velocity": (0.0, 0.0, 1.0),
}


class Breaking(Effect):
    """Breaking of the most loaded bond of a structure, when its load in a collision exceeds a threshold.

    threshold : impulse, mass length / tu; for "velocity" a speed, length / tu
    criterion : "impulse" - the pull and the shear through the bond; "wrench" - tension + shear / 2 + moment over
        half an edge, which tears long structures far more easily than short ones; "velocity" - the change of velocity
        of the structure, impulse over its mass, which spares long structures: its most loaded bond breaks
    grace : time after docking in which a bond does not break, tu: the push that a snap into place may cause is no
        collision
    log_above : the run's record keeps every hit whose load on the most loaded bond is above this, in the threshold's
        unit and at most the threshold, also those that break nothing; none: no log. It changes nothing that happens.
        Down to .6 of the threshold a step takes hardly longer (`tests.benchmarks.bench_load_log`)

    Bonds in a loop carry a load that rigid-body mechanics leaves open; they do not break one at a time.
    The paper breaks a bond whose face gap exceeds a threshold; in a constraint solver that gap shrinks with the
    step squared, so it is no property of the collision. The impulse is, and the change of velocity.
    """

    effect: Literal["breaking"] = "breaking"
    needs: ClassVar[tuple[str, ...]] = ("contact",)  # impulses come from collisions
    opens: ClassVar[tuple[EventKind, ...]] = ("break",)
    example: ClassVar[dict[str, Any]] = {"threshold": 0.008}
    threshold: float = Field(gt=0)
    criterion: Literal["impulse", "wrench", "velocity"] = "impulse"
    grace: float = Field(default=0.05, ge=0)
    # Written only where it is asked for: a run without a log keeps its name.
    log_above: float | None = Field(default=None, gt=0, exclude_if=lambda value: value is None)

    def check(self, scene: ViewOfScene) -> None:
        """A hit that breaks a bond is always logged."""
        super().check(scene)
        if self.log_above is not None and self.log_above > self.threshold:
            raise ValueError(
                f"log_above = {self.log_above} with threshold = {self.threshold}; expected at most the threshold: "
                "lower it, or leave it out for no log"
            )

    def attach(self, world: ViewOfWorld) -> Action:
        """Watch the contacts of compounds."""
        return _Breaking(self, world)


class _Breaking(Action):
    def __init__(self, settings: Breaking, world: ViewOfWorld):
        self.settings, self.world = settings, world
        self.notable = settings.threshold if settings.log_above is None else settings.log_above
        self.known: dict[Structure, tuple[Bridges, np.ndarray, np.ndarray]] = {}  # and their levers, cubes in edges
        world.on_change(self.renew)

    def renew(self, slot: int) -> None:
        """Note what hits do to the structure that a slot has got."""
        bodies = self.world.bodies
        structure = bodies.held(slot)
        if structure not in self.known:
            bridges, cubes = Bridges.of(structure), bodies.offset[list(bodies.members[slot])] / bodies.edge
            self.known[structure] = bridges, bridges.levers(cubes), cubes

    def after_step(self) -> None:
        """Judge all bodies that were hit hard enough, then break bonds: partners are seen as they were."""
        bodies = self.world.bodies
        touched: dict[int, list[ViewOfTouch]] = {}
        for touch in self.world.engine.touches(of_structures=True):
            for slot in (touch.a, touch.b):
                if slot >= 0 and len(bodies.members[slot]) > 1:
                    touched.setdefault(slot, []).append(touch)
        struck = [slot for slot in sorted(touched) if self.may_matter(slot, touched[slot])]
        for hit in [hit for slot in struck if (hit := self.judge(slot, touched[slot])) is not None]:
            if self.settings.log_above is not None:
                self.world.log_hit(hit)
            if hit.breaks:
                self.world.part(hit.slot, self.world.book.break_bond(hit.struck, *hit.bond), hit)

    def may_matter(self, slot: int, touches: list[ViewOfTouch]) -> bool:
        """False only where no bond can carry a notable load, by the sum of bounds of its contacts; mostly so."""
        bodies = self.world.bodies
        bridges, levers, cubes = self.known[bodies.held(slot)]
        if not len(levers) or self.world.time - bodies.born[slot] < self.settings.grace:
            return False
        of_pull, of_moment, of_change = BOUNDS[self.settings.criterion]
        most = 0.0
        for touch in touches:
            most += hit_bound(
                levers, bridges.sides, cubes, bodies.position, bodies.orientation, slot, touch.place, touch.impulse,
                1.0 if touch.a == slot else -1.0, bodies.edge, of_pull, of_moment, of_change / bodies.mass[slot],
            )  # fmt: skip
        return most > self.notable

    def judge(self, slot: int, touches: list[ViewOfTouch]) -> Hit | None:
        """The load on the most loaded bond of a body, and who put it there; None where it is not notable."""
        bodies = self.world.bodies
        structure = bodies.held(slot)
        bridges, _, _ = self.known[structure]
        loads = np.zeros((len(bridges.bonds), 3))
        place = np.array([touch.place for touch in touches])
        impulse = np.array([t.impulse if t.a == slot else [-x for x in t.impulse] for t in touches])
        centre = bodies.centre[list(bodies.members[slot])]
        bond_loads(bridges.bonds, bridges.sides, centre, place, impulse, bodies.cube_mass, bodies.edge, loads)
        total = impulse.sum(axis=0)
        tear = CRITERIA[self.settings.criterion](loads, math.sqrt(total @ total) / float(bodies.mass[slot]))
        weakest = int(tear.argmax())
        load = float(tear[weakest])
        if load <= self.notable:
            return None
        others: dict[int, float] = {}
        for touch in touches:
            other = touch.b if touch.a == slot else touch.a
            others[other] = others.get(other, 0.0) + math.hypot(*touch.impulse)
        partner = max(others, key=lambda other: others[other])
        i, j = bridges.bonds[weakest].tolist()
        by = None if partner < 0 else bodies.held(partner)
        breaks = load > self.settings.threshold
        return Hit(slot, float(bodies.born[slot]), structure, (i, j), load, partner, by, len(others) > 1, breaks)
