"""Breaking of bonds by the impulse that they transmit in a collision."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, ClassVar, Literal

import numpy as np
from pydantic import Field

from kinetics.assembly import Structure
from mechsim.effects.base import Action, Effect, EventKind
from mechsim.effects.view import ViewOfWorld
from mechsim.kernels.loads import bond_loads


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


class Breaking(Effect):
    """Breaking of the most loaded bond of a structure, when its load in a collision exceeds a threshold.

    threshold : impulse, mass length / tu; for "velocity" a speed, length / tu
    criterion : "impulse" - the pull and the shear through the bond; "wrench" - tension + shear / 2 + moment over
        half an edge, which tears long structures far more easily than short ones; "velocity" - the change of velocity
        of the structure, impulse over its mass, which spares long structures: its most loaded bond breaks
    grace : time after docking in which a bond does not break, tu: the push that a snap into place may cause is no
        collision

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

    def attach(self, world: ViewOfWorld) -> Action:
        """Watch the contacts of compounds."""
        return _Breaking(self, world)


def bridges(structure: Structure) -> tuple[np.ndarray, np.ndarray]:
    """Bonds whose loss parts the structure: (n, 2) cubes, and (n, k) bool, the cubes that stay with the first one."""
    bonds, sides = [], []
    for i, j in structure.bonds:
        parts = structure.sides(i, j)
        if parts is not None:
            bonds.append((i, j))
            sides.append([cube in parts[0] for cube in range(len(structure))])
    return np.array(bonds, np.int64).reshape(-1, 2), np.array(sides, bool).reshape(-1, len(structure))


class _Breaking(Action):
    def __init__(self, settings: Breaking, world: ViewOfWorld):
        self.settings, self.world = settings, world
        self.known: dict[Structure, tuple[np.ndarray, np.ndarray]] = {}

    def after_step(self) -> None:
        bodies = self.world.bodies
        hits: dict[int, list[tuple[np.ndarray, np.ndarray]]] = {}
        for touch in self.world.engine.touches(of_structures=True):
            for slot, sign in ((touch.a, 1.0), (touch.b, -1.0)):
                if slot >= 0 and len(bodies.members[slot]) > 1:
                    hits.setdefault(slot, []).append((touch.place, sign * touch.impulse))
        for slot in sorted(hits):
            if self.world.time - bodies.born[slot] >= self.settings.grace:
                self.judge(slot, np.array([h[0] for h in hits[slot]]), np.array([h[1] for h in hits[slot]]))

    def judge(self, slot: int, place: np.ndarray, impulse: np.ndarray) -> None:
        """Break the most loaded bond of a body if its load is too high."""
        bodies = self.world.bodies
        structure = bodies.held(slot)
        if structure not in self.known:
            self.known[structure] = bridges(structure)
        bonds, sides = self.known[structure]
        if not len(bonds):
            return
        loads = np.zeros((len(bonds), 3))
        cubes = list(bodies.members[slot])
        bond_loads(bonds, sides, bodies.centre[cubes], place, impulse, bodies.cube_mass, bodies.edge, loads)
        change = float(np.linalg.norm(impulse.sum(axis=0)) / bodies.mass[slot])
        tear = CRITERIA[self.settings.criterion](loads, change)
        weakest = int(np.argmax(tear))
        if tear[weakest] > self.settings.threshold:
            i, j = (int(c) for c in bonds[weakest])
            self.world.part(slot, self.world.book.break_bond(structure, i, j))
