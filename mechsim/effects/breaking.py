"""Breaking: a bond gives way when a collision sends too strong an impulse through it."""

from __future__ import annotations

from typing import TYPE_CHECKING, ClassVar, Literal

import numpy as np
from pydantic import Field

from kinetics.assembly import Structure
from mechsim.effects.base import Action, Effect
from mechsim.kernels.loads import bond_loads

if TYPE_CHECKING:
    from mechsim.world import World


class Breaking(Effect):
    """A bond breaks when its load in one step exceeds a threshold; structures break where they are loaded most.

    threshold : impulse (mass length / tu) for "impulse"; speed (length / tu) for "velocity"
    criterion : "impulse" - tension + 2 |bending moment| / edge + |shear| / 2 transmitted by the bond (Newton-Euler of the part
        behind it); "velocity" - change of the whole structure's velocity, |sum of impulses| / mass, the most loaded bond breaks
    grace : time after docking in which a bond does not break, tu: the push that a snap into place may cause is no collision

    Bonds in a loop carry a load that rigid-body mechanics leaves open; they do not break one at a time.
    """

    effect: Literal["breaking"] = "breaking"
    needs: ClassVar[tuple[str, ...]] = ("contact",)  # impulses come from collisions
    threshold: float = Field(gt=0)
    criterion: Literal["impulse", "velocity"] = "impulse"
    grace: float = Field(default=0.05, ge=0)

    def attach(self, world: World) -> Action:
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
    def __init__(self, settings: Breaking, world: World):
        self.settings, self.world = settings, world
        self.known: dict[Structure, tuple[np.ndarray, np.ndarray]] = {}

    def after_step(self) -> None:
        bodies = self.world.bodies
        hits: dict[int, list[tuple[np.ndarray, np.ndarray]]] = {}
        for touch in self.world.engine.touches():
            for slot, sign in ((touch.a, 1.0), (touch.b, -1.0)):
                if slot >= 0 and len(bodies.members[slot]) > 1:
                    hits.setdefault(slot, []).append((touch.place, sign * touch.impulse))
        for slot in sorted(hits):
            if self.world.time - bodies.born[slot] >= self.settings.grace:
                self.judge(slot, np.array([h[0] for h in hits[slot]]), np.array([h[1] for h in hits[slot]]))

    def judge(self, slot: int, place: np.ndarray, impulse: np.ndarray) -> None:
        """Break the most loaded bond of a body if its load is too high."""
        bodies, settings = self.world.bodies, self.settings
        structure = bodies.held(slot)
        if structure not in self.known:
            self.known[structure] = bridges(structure)
        bonds, sides = self.known[structure]
        if not len(bonds):
            return
        loads = np.zeros(len(bonds))
        cubes = list(bodies.members[slot])
        bond_loads(bonds, sides, bodies.centre[cubes], place, impulse, bodies.cube_mass, bodies.edge, loads)
        weakest = int(np.argmax(loads))
        if settings.criterion == "impulse":
            load = loads[weakest]
        else:
            load = np.linalg.norm(impulse.sum(axis=0)) / bodies.mass[slot]
        if load > settings.threshold:
            i, j = (int(c) for c in bonds[weakest])
            self.world.part(slot, self.world.book.break_bond(structure, i, j))
