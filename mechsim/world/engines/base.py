"""Base class of engines: what a world requires of whatever finds contacts and exchanges impulses.

To add an engine: a file `<name>_engine.py` with an `Engine`, and its line in `ENGINES`, where its name, its packages
and the effects that it lacks are known before it is imported. Scenes, effects, the cost profile and records ask nobody
which engine it is; tests/contracts/test_engines.py then holds it to the conventions below.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterable
from importlib import import_module
from typing import NamedTuple

import numpy as np

from mechsim.world.bodies import Bodies

# What every engine has in force, though no scene sets it; tests measure it.
LEAST_BOUNCE = 0.2  # length / tu: slower approaches do not bounce
RECOVERY = 0.08  # share of an overlap that a step takes back by a speed, where surfaces do not bounce
SLOP = 1e-5  # length: overlap that is left as it is; deeper ones that bounce are put back to it
SLEEPING = 0.0  # speed below which a body is put to rest: switched off
CONTINUOUS = 0.0  # collisions are looked for at the end of a step alone, not along the way: the guard limits that way
OF_ALL_ENGINES = {  # the constants above, as `Engine.in_force` reports them
    "least_bounce": LEAST_BOUNCE,
    "overlap_recovery": RECOVERY,
    "sleeping": SLEEPING,
    "continuous_collision": CONTINUOUS,
}


class Touch(NamedTuple):
    """A contact point of the last step: bodies by slot (-1: a wall), place, impulse on `a` (on `b` it is the
    opposite), and whether the surfaces came fast enough to bounce."""

    a: int
    b: int
    place: tuple[float, float, float]
    impulse: tuple[float, float, float]
    bounces: bool = True


class Engine(ABC):
    """The contacts of a table of bodies: what a step exchanges between them, from the motions in the table.

    step : tu; iterations : of the contact solver

    A step is `set_motions`, `step`, the world's own free flight of all bodies in the table, and `read` of those of
    which the engine knows better. An engine that writes into the table has nothing to set and nothing to read.
    """

    @abstractmethod
    def __init__(self, bodies: Bodies, step: float, iterations: int): ...

    @abstractmethod
    def close(self) -> None:
        """Free what the engine holds outside Python."""

    @abstractmethod
    def set_surface(self, restitution: float, friction: float) -> None:
        """Let cubes collide with each other; the coefficients between any two surfaces, walls included."""

    @abstractmethod
    def build_walls(self, half: np.ndarray, thickness: float) -> None:
        """Six fixed walls around the space -half..half."""

    @abstractmethod
    def create(self, slot: int) -> None:
        """Take up the body of a slot that has just been filled."""

    @abstractmethod
    def remove(self, slot: int) -> None:
        """Forget a slot's body, its contact points included."""

    @abstractmethod
    def put(self, slot: int) -> None:
        """Take a slot's pose and motion from the table, where something other than a step has changed them."""

    @abstractmethod
    def set_motions(self) -> None:
        """Take the velocities and spins of all bodies from the table."""

    @abstractmethod
    def step(self) -> None:
        """Find the contacts and exchange impulses, from the motions last set."""

    @abstractmethod
    def near_contacts(self) -> Iterable[int]:
        """Slots that free flight in the table may have left wrong in the last step."""

    @abstractmethod
    def read(self, slots: Iterable[int]) -> None:
        """Write the poses and motions of these slots into the table."""

    @abstractmethod
    def touches(self, of_structures: bool = False) -> list[Touch]:
        """Contact points of the last step that carried an impulse, in an order that is the same in every rerun.

        of_structures : only those with a body of several cubes
        """

    @abstractmethod
    def in_force(self) -> dict[str, float]:
        """What the engine has in force: its settings, and of all bodies and walls the largest value of each.

        restitution, friction : between two surfaces; mass_error, inertia_error : largest relative deviation of a body
            from the table; contact_damping, contact_stiffness : -1 where collisions are hard; differences : largest one
            between two bodies or walls in any of these
        """


class EngineEntry(NamedTuple):
    """Facts about an engine that are known before it is imported.

    name : by which a scene chooses it
    home, kind : the module and the class
    packages : whose versions decide its numbers, and so are part of a run's name
    lacks : effects that it cannot do
    version : raised by hand whenever it makes another record of the same inputs; part of a run's name but for the first
    """

    name: str
    home: str
    kind: str
    packages: tuple[str, ...]
    lacks: tuple[str, ...] = ()
    version: int = 1

    def load(self) -> type[Engine]:
        """The engine's class. ModuleNotFoundError: a package that it needs is not installed."""
        found = getattr(import_module(self.home), self.kind)
        assert isinstance(found, type) and issubclass(found, Engine)  # noqa: S101, PT018 - of a line in ENGINES
        return found
