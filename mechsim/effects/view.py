"""Protocols of what an effect sees of its scene and of the world in which it acts."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, Protocol

import numpy as np

from kinetics.assembly import RuleBook, Structure
from mechsim.effects.hits import Hit


class ViewOfCubes(Protocol):
    """The cubes of a scene."""

    @property
    def edge(self) -> float:
        """Length."""

    @property
    def density(self) -> float:
        """Relative to the fluid's."""


class ViewOfNumerics(Protocol):
    """How finely a scene is computed."""

    @property
    def step(self) -> float:
        """Step of the engine, tu."""


class ViewOfScene(Protocol):
    """A scene, as the check of an effect sees it."""

    @property
    def cubes(self) -> ViewOfCubes:
        """Size and density of a cube."""

    @property
    def numerics(self) -> ViewOfNumerics:
        """The step."""

    def provider(self, what: str) -> Any | None:
        """Settings of the listed effect that is this or a way of this (`agitation`: three ways of it), or None."""


class ViewOfBodies(Protocol):
    """The table of bodies: B slots, C cubes. Effects may write `velocity` and `spin`, the rest is for reading."""

    @property
    def n_cubes(self) -> int:
        """C."""

    @property
    def edge(self) -> float:
        """Edge of a cube, length."""

    @property
    def cube_mass(self) -> float:
        """Mass of a cube."""

    @property
    def position(self) -> np.ndarray:
        """Centres of mass (B, 3), length."""

    @property
    def velocity(self) -> np.ndarray:
        """(B, 3), length / tu."""

    @property
    def spin(self) -> np.ndarray:
        """Angular velocities (B, 3), rad / tu, world frame."""

    @property
    def orientation(self) -> np.ndarray:
        """Unit quaternions (B, 4), x y z w."""

    @property
    def mass(self) -> np.ndarray:
        """(B,)"""

    @property
    def inertia(self) -> np.ndarray:
        """Principal moments (B, 3)."""

    @property
    def born(self) -> np.ndarray:
        """Time (B,) at which a body got its present structure, tu."""

    @property
    def members(self) -> Sequence[tuple[int, ...]]:
        """By slot, the cubes' numbers in the order of its structure; empty where it holds no body."""

    @property
    def live(self) -> np.ndarray:
        """The slots that hold a body."""

    @property
    def body(self) -> np.ndarray:
        """By cube (C,), its slot."""

    @property
    def offset(self) -> np.ndarray:
        """By cube (C, 3), its place in the body frame, length."""

    @property
    def turn(self) -> np.ndarray:
        """By cube (C, 3, 3), its rotation in the body frame."""

    @property
    def uncovered(self) -> np.ndarray:
        """By cube and face (C, 6) bool, True where no cube of the same body touches it."""

    @property
    def centre(self) -> np.ndarray:
        """By cube (C, 3), in the world, length."""

    @property
    def axes(self) -> np.ndarray:
        """By cube (C, 3, 3; columns), its own axes in the world."""

    @property
    def first(self) -> np.ndarray:
        """The cubes of slot b are flat[first[b]:first[b + 1]]."""

    @property
    def flat(self) -> np.ndarray:
        """See `first`."""

    def held(self, slot: int) -> Structure:
        """The structure in a slot that holds one."""

    def title(self, slot: int) -> str:
        """A body for a message."""


class ViewOfTouch(Protocol):
    """A contact point of the last step."""

    @property
    def a(self) -> int:
        """Slot of one body, -1 for a wall."""

    @property
    def b(self) -> int:
        """Slot of the other."""

    @property
    def place(self) -> tuple[float, float, float]:
        """Length."""

    @property
    def impulse(self) -> tuple[float, float, float]:
        """On `a`, mass length / tu; on `b` it is the opposite."""

    @property
    def bounces(self) -> bool:
        """The surfaces came fast enough to bounce; else they rest on each other, or move slowly."""


class ViewOfEngine(Protocol):
    """What effects ask of the engine of rigid bodies."""

    def set_surface(self, restitution: float, friction: float) -> None:
        """Let cubes collide with each other; the coefficients between any two surfaces."""

    def build_walls(self, half: np.ndarray, thickness: float) -> None:
        """Six fixed boxes around the space -half..half."""

    def touches(self, of_structures: bool = False) -> Sequence[ViewOfTouch]:
        """Contact points of the last step that carried an impulse; of_structures: only those of several cubes."""


class ViewOfWorld(Protocol):
    """A tank at work, as an effect sees it."""

    @property
    def bodies(self) -> ViewOfBodies:
        """Poses and motions."""

    @property
    def engine(self) -> ViewOfEngine:
        """Surfaces, walls, contacts."""

    @property
    def book(self) -> RuleBook:
        """The rules that the cubes follow."""

    @property
    def scene(self) -> ViewOfScene:
        """What is simulated."""

    @property
    def time(self) -> float:
        """tu."""

    @property
    def step_size(self) -> float:
        """tu."""

    @property
    def step_count(self) -> int:
        """Steps made so far."""

    @property
    def half(self) -> np.ndarray:
        """Half the tank's size (3,), length."""

    @property
    def drag_points(self) -> np.ndarray:
        """Where the fluid acts on a cube (P, 3), from its centre along its own axes, length."""

    @property
    def fluid(self) -> np.ndarray:
        """Velocity of the fluid at the drag points (C, P, 3), world frame: the sum of all sources; only read it."""

    def stream(self, name: str) -> np.random.Generator:
        """The random stream of one named part of this world."""

    def on_change(self, hook: Callable[[int], None]) -> None:
        """Call `hook(slot)` whenever a slot has got a new structure."""

    def set_drag_points(self, points: np.ndarray) -> None:
        """Let the fluid act on every cube at these points (P, 3)."""

    def confine(self) -> None:
        """From now on a body outside the tank is an escape."""

    def docking(self, i: int, face: int, j: int, other_face: int) -> tuple[int, int, Structure] | None:
        """How the bodies of cubes i and j would join by these faces, or None: keeper, other, joined structure."""

    def fits(self, keeper: int, other: int, joined: Structure) -> bool:
        """Is there room for the joined structure?"""

    def join(self, keeper: int, other: int, joined: Structure) -> None:
        """Make one body of two."""

    def part(self, slot: int, fragments: Sequence[tuple[Sequence[int], Structure]], hit: Hit | None = None) -> None:
        """Split a body into fragments (indices of its cubes, structure); hit: the collision that did it."""

    def log_hit(self, hit: Hit) -> None:
        """Have a hit logged; it changes nothing."""
