"""Scenes: tank, cubes and list of effects, read from TOML and named by a fingerprint."""

from __future__ import annotations

import hashlib
import json
from pathlib import Path
from typing import Annotated, Any, ClassVar, Literal

from msgspec import Meta

from kinetics.network import Tank
from kinetics.support.config import find, is_path, read_toml
from kinetics.support.settings import Positive, Settings, validated
from mechsim.effects import AnyEffect
from mechsim.effects.base import Effect, EventKind
from mechsim.world.engines import ENGINES, engine_named

SCENES = Path(__file__).parent / "scenes"
LEAST_INERTIA, LARGEST_MASS = 1e-13, 1e9  # of a cube


class Units(Settings):
    """The only units a scene may be written in: the paper's length and time, density relative to the fluid's."""

    length: Literal["paper"] = "paper"
    time: Literal["tu"] = "tu"
    density: Literal["fluid"] = "fluid"


class TankSize(Settings):
    """Inside of the tank. size : (x, y, z), length; the origin is its centre."""

    size: tuple[Positive, Positive, Positive]

    def __post_init__(self) -> None:
        Tank(self.size)


class Cubes(Settings):
    """The cubes. edge : length; density : relative to the fluid (1: neutrally buoyant).

    The engine lets bodies that are far too light or heavy pass through each other and says nothing (measured: with
    moments of inertia of 1e-16, with masses of 3e17), so such cubes are refused.
    """

    edge: Positive
    density: Positive = 1.0

    def __post_init__(self) -> None:
        mass = self.density * self.edge * self.edge * self.edge
        inertia = mass * self.edge * self.edge / 6
        if not (inertia >= LEAST_INERTIA and mass <= LARGEST_MASS):
            raise ValueError(
                f"density = {self.density} and edge = {self.edge} give a cube the mass {mass:.3g} and the moment of "
                f"inertia {inertia:.3g}; the engine finds collisions of masses up to {LARGEST_MASS:g} and moments from "
                f"{LEAST_INERTIA:g} on"
            )


class Numerics(Settings):
    """By what, and how finely, motions and contacts are computed.

    step : tu; solver_iterations : of the engine's contact solver
    engine : a name of `mechsim.world.engines`: what finds the contacts and exchanges their impulses
    """

    step: Annotated[float, Meta(ge=1e-9)]  # shorter ones take years for a tu
    solver_iterations: Annotated[int, Meta(ge=1, le=1000)] = 50
    # A run by the first engine keeps the name that it had before there were several.
    unless_usual: ClassVar[tuple[str, ...]] = ("engine",)
    engine: str = ENGINES[0].name

    def __post_init__(self) -> None:
        engine_named(self.engine)


class Guard(Settings):
    """When a run is stopped with a named reason, because its state can no longer be trusted.

    max_speed : of a body, length / tu; max_turn : rotation in one step, rad (the engine caps it at pi/4)
    """

    max_speed: Positive = 40.0
    max_turn: Annotated[float, Meta(gt=0, le=0.785)] = 0.7


class Scene(Settings):
    """Everything on which a mechanics run depends, except the initial composition, the duration and the seed.

    rules : a shipped rule book, or a file; in the file of a scene, a path is relative to the folder of that file
    units : of all numbers here, the paper's length and time unit (tu), and densities relative to the fluid's
    tank, cubes : their sizes, length
    numerics, guard : how finely the engine computes, and when a run is stopped
    effects : the physics, in the order in which they act; what is not listed is not simulated
    ValueError: an effect that is listed twice, lacks one that it needs, contradicts another, or is none that the engine
        can do

    >>> from mechsim import Scene
    >>> scene = Scene.load("line4")
    >>> scene.tank.size, [effect.effect for effect in scene.effects]
    ((2.0, 2.0, 3.0), ['agitation', 'drag', 'walls', 'contact', 'breaking', 'bonding'])
    >>> still = scene.without("agitation").changed("drag", coefficient=2.0)
    >>> still.effect("drag").coefficient, still.fingerprint == scene.fingerprint
    (2.0, False)
    """

    name: Annotated[str, Meta(min_length=1, max_length=80)]
    rules: str
    units: Units = Units()
    tank: TankSize
    cubes: Cubes
    numerics: Numerics
    guard: Guard = Guard()
    effects: tuple[AnyEffect, ...]

    def __post_init__(self) -> None:
        names = [e.effect for e in self.effects]
        twice = sorted({n for n in names if names.count(n) > 1})
        if twice:
            raise ValueError(f"effect {twice[0]!r} is listed twice")
        listed: dict[str, str] = {}
        for effect in self.effects:
            what = effect.provides or effect.effect
            rival = listed.setdefault(what, effect.effect)
            if rival != effect.effect:
                raise ValueError(f"effects {rival!r} and {effect.effect!r} conflict: both are the {what}; keep one")
        checked: tuple[Effect, ...] = self.effects
        for effect in checked:
            effect.check(self)
        engine = engine_named(self.numerics.engine)
        for name in names:
            if name in engine.lacks:
                able = ", ".join(other.name for other in ENGINES if name not in other.lacks)
                raise ValueError(
                    f"engine {engine.name!r} lacks effect {name!r}, which the scene lists; leave the effect out, or "
                    f"choose numerics.engine from {able}"
                )

    @classmethod
    def load(cls, name_or_path: str | Path) -> Scene:
        """Load a shipped scene by its name (`line4`), or a TOML file of your own."""
        path = find(name_or_path, SCENES, "scene")
        scene = validated(cls, read_toml(path), path.name)
        return scene.replace(rules=str(path.parent / scene.rules)) if is_path(scene.rules) else scene

    def effect(self, name: str) -> Any | None:
        """Settings of a listed effect, or None."""
        return next((e for e in self.effects if e.effect == name), None)

    def provider(self, what: str) -> Any | None:
        """Settings of the listed effect that has this name or provides it (`agitation`: three ways of it), or None."""
        return next((e for e in self.effects if what in (e.effect, e.provides)), None)

    @property
    def packages(self) -> tuple[str, ...]:
        """Packages whose versions decide the numbers of a run, beside our own."""
        return (*engine_named(self.numerics.engine).packages, "numpy")

    def openers(self, kind: EventKind) -> tuple[str, ...]:
        """Names of the listed effects that make events of this kind happen."""
        return tuple(e.effect for e in self.effects if kind in e.opens)

    def without(self, *names: str) -> Scene:
        """The scene without these effects and their physics. ValueError: another effect needs one of them."""
        data = self.as_dict()
        data["effects"] = [item for item in data["effects"] if item["effect"] not in names]
        return validated(Scene, data, f"scene {self.name} without {', '.join(names)}")

    def changed(self, effect: str, **settings: Any) -> Scene:
        """The scene with other settings of one effect, validated again."""
        data = self.as_dict()
        found = [item for item in data["effects"] if item["effect"] == effect]
        if not found:
            listed = ", ".join(e.effect for e in self.effects)
            raise ValueError(f"scene {self.name} does not list the effect {effect!r}; it lists {listed}")
        found[0].update(settings)
        return validated(Scene, data, f"scene {self.name}")

    def by(self, engine: str | None) -> Scene:
        """The scene with another engine, checked again; None leaves it as it is."""
        if engine is None:
            return self
        return self.replace(numerics=self.numerics.replace(engine=engine))

    @property
    def content(self) -> dict[str, Any]:
        """All settings, ready for JSON; a book of one's own without its folder, so that it may be kept anywhere."""
        return self.as_dict() | {"rules": Path(self.rules).name}

    @property
    def fingerprint(self) -> str:
        """SHA-256 of the scene's content (not of its file)."""
        return hashlib.sha256(json.dumps(self.content, sort_keys=True).encode()).hexdigest()
