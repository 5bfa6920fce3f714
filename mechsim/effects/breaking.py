"""Breaking of bonds by the impulse that they transmit in a collision."""

from __future__ import annotations

import math
from collections.abc import Callable
from itertools import product
from typing import Any, ClassVar, Literal, NamedTuple

import numpy as np

from kinetics.assembly import Structure
from kinetics.support.settings import NotNegative, Positive
from mechsim import kernels
from mechsim.effects.base import Action, Effect, EventKind
from mechsim.effects.bridges import Bridges
from mechsim.effects.hits import Hit
from mechsim.effects.view import ViewOfScene, ViewOfTouch, ViewOfWorld


def _pull(load: np.ndarray) -> np.ndarray:
    """Pull and shear of each bond; a push tears nothing."""
    found: np.ndarray = np.hypot(np.maximum(load[:, 0], 0.0), load[:, 1])
    return found


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


class Breaking(Effect, tag="breaking"):
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

    Of several bodies and walls that touch a structure in one step, each that bounces is a collision of its own, whose
    load adds to that of those that rest on it, and not to one another's: how often two collisions fall into one step
    is the step's doing.
    Bonds in a loop carry a load that rigid-body mechanics leaves open; they do not break one at a time.
    The paper breaks a bond whose face gap exceeds a threshold; in a constraint solver that gap shrinks with the
    step squared, so it is no property of the collision. The impulse is, and the change of velocity.
    """

    needs: ClassVar[tuple[str, ...]] = ("contact",)  # impulses come from collisions
    opens: ClassVar[tuple[EventKind, ...]] = ("break",)
    example: ClassVar[dict[str, Any]] = {"threshold": 0.008}
    threshold: Positive
    criterion: Literal["impulse", "wrench", "velocity"] = "impulse"
    grace: NotNegative = 0.05
    unless_usual: ClassVar[tuple[str, ...]] = ("log_above",)  # a run without a log keeps its name
    log_above: Positive | None = None

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


class _Known(NamedTuple):
    """What hits do to a structure: bridges, their levers, cubes (k, 3) in edges; `most`: what a push of 1 counts as."""

    bridges: Bridges
    levers: np.ndarray
    cubes: np.ndarray
    most: float


def most_of_a_push(bridges: Bridges, levers: np.ndarray, cubes: np.ndarray, bound: tuple[float, float, float]) -> float:
    """At least what `hit_bound` gives for an impulse of 1, wherever on the structure it hits.

    bound : of pull and shear, of the moment, of the impulse itself. For a given impulse both loads are norms of affine
        functions of the place, so they are largest at a corner; of boxes that hold each cube however it is turned (.87
        edges to its corners), and more than how far apart bodies that touch may be.
    """
    of_pull, of_moment, of_impulse = bound
    most = 0.0
    corners = np.array(list(product((-1.0, 1.0), repeat=3)))
    for lever, side in zip(levers, bridges.sides, strict=True):
        for struck, who in enumerate((~side, side)):
            places = (cubes[who][:, None] + corners).reshape(-1, 3)
            turns = np.array([[np.zeros(len(places)), -places[:, 2], places[:, 1]],
                              [places[:, 2], np.zeros(len(places)), -places[:, 0]],
                              [-places[:, 1], places[:, 0], np.zeros(len(places))]])  # fmt: skip
            loads = lever[struck, :, :3, None] + np.einsum("ij,jkp->ikp", lever[struck, :, 3:], turns)
            sizes = np.linalg.norm(loads.reshape(2, 3, 3, -1), ord=2, axis=(1, 2))  # of pull and shear, of the moment
            most = max(most, float((of_pull * sizes[0] + of_moment * sizes[1]).max()))
    farthest = float(np.abs(cubes).sum(axis=1).max()) + 3.0
    return (1.0 + kernels.loads.SLACK) * (
        most + of_impulse + kernels.loads.SLACK * ((of_pull + of_moment) * (2.0 + farthest) + of_impulse)
    )


def _partner(slot: int, touch: ViewOfTouch) -> int:
    """The other body of a touch, -1 for a wall."""
    return touch.b if touch.a == slot else touch.a


class _Breaking(Action):
    def __init__(self, settings: Breaking, world: ViewOfWorld):
        self.settings, self.world = settings, world
        self.notable = settings.threshold if settings.log_above is None else settings.log_above
        self.known: dict[Structure, _Known] = {}
        self.of_slot: dict[int, _Known] = {}
        world.on_change(self.renew)

    def renew(self, slot: int) -> None:
        """Note what hits do to the structure that a slot has got."""
        bodies = self.world.bodies
        structure = bodies.held(slot)
        if structure not in self.known:
            bridges, cubes = Bridges.of(structure), bodies.offset[list(bodies.members[slot])] / bodies.edge
            levers = bridges.levers(cubes)
            of_pull, of_moment, of_change = BOUNDS[self.settings.criterion]
            bound = of_pull, of_moment, of_change / float(bodies.mass[slot])
            self.known[structure] = _Known(bridges, levers, cubes, most_of_a_push(bridges, levers, cubes, bound))
        self.of_slot[slot] = self.known[structure]

    def after_step(self) -> None:
        """Judge all bodies that were hit hard enough, then break bonds: partners are seen as they were."""
        bodies = self.world.bodies
        touched: dict[int, list[ViewOfTouch]] = {}
        for touch in self.world.engine.touches(of_structures=True):
            for slot in (touch.a, touch.b):
                if slot >= 0 and len(bodies.members[slot]) > 1:
                    touched.setdefault(slot, []).append(touch)
        struck = [slot for slot in sorted(touched) if self.may_matter(slot, touched[slot])]
        for hit in [hit for slot in struck for hit in self.hits(slot, touched[slot])]:
            if self.settings.log_above is not None:
                self.world.log_hit(hit)
            if hit.breaks:
                self.world.part(hit.slot, self.world.book.break_bond(hit.struck, *hit.bond), hit)

    def may_matter(self, slot: int, touches: list[ViewOfTouch]) -> bool:
        """False only where no bond can carry a notable load, by the sum of bounds of its contacts; mostly so."""
        bodies = self.world.bodies
        bridges, levers, cubes, most = self.of_slot[slot]
        if not len(levers) or self.world.time - bodies.born[slot] < self.settings.grace:
            return False
        if sum(math.hypot(*touch.impulse) for touch in touches) * most <= self.notable:
            return False
        of_pull, of_moment, of_change = BOUNDS[self.settings.criterion]
        total = 0.0
        for touch in touches:
            total += kernels.loads.hit_bound(
                levers, bridges.sides, cubes, bodies.position, bodies.orientation, slot, touch.place, touch.impulse,
                1.0 if touch.a == slot else -1.0, bodies.edge, of_pull, of_moment, of_change / bodies.mass[slot],
            )  # fmt: skip
        return total > self.notable

    def hits(self, slot: int, touches: list[ViewOfTouch]) -> list[Hit]:
        """The notable hits of a body in a step, one a partner that bounced off it; the hardest alone if it breaks.

        Collisions of two partners in one step are apart in time, if by less than the step, so that their loads do not
        add. Surfaces that rest on the body, or touch it too slowly to bounce, take part in the load of each.
        """
        partners = {_partner(slot, touch) for touch in touches if touch.bounces}
        if len(partners) < 2:
            found = [self.judge(slot, touches)]
        else:
            found = [
                self.judge(slot, [each for each in touches if not each.bounces or _partner(slot, each) == partner])
                for partner in sorted(partners)
            ]
        hits = sorted((hit for hit in found if hit is not None), key=lambda hit: -hit.load)
        return hits[:1] if hits and hits[0].breaks else hits

    def judge(self, slot: int, touches: list[ViewOfTouch]) -> Hit | None:
        """The load on the most loaded bond of a body, and who put it there; None where it is not notable."""
        bodies = self.world.bodies
        structure = bodies.held(slot)
        bridges = self.known[structure].bridges
        loads = np.zeros((len(bridges.bonds), 3))
        place = np.array([touch.place for touch in touches])
        impulse = np.array([t.impulse if t.a == slot else [-x for x in t.impulse] for t in touches])
        centre = bodies.centre[list(bodies.members[slot])]
        kernels.loads.bond_loads(
            bridges.bonds, bridges.sides, centre, place, impulse, bodies.cube_mass, bodies.edge, loads
        )
        total = impulse.sum(axis=0)
        tear = CRITERIA[self.settings.criterion](loads, math.sqrt(total @ total) / float(bodies.mass[slot]))
        weakest = int(tear.argmax())
        load = float(tear[weakest])
        if load <= self.notable:
            return None
        others: dict[int, float] = {}
        for touch in touches:
            other = _partner(slot, touch)
            others[other] = others.get(other, 0.0) + math.hypot(*touch.impulse)
        partner = max(others, key=lambda other: others[other])
        i, j = bridges.bonds[weakest].tolist()
        by = None if partner < 0 else bodies.held(partner)
        breaks = load > self.settings.threshold
        return Hit(slot, float(bodies.born[slot]), structure, (i, j), load, partner, by, len(others) > 1, breaks)
