"""The settings that a work-precision diagram compares: numerical ones with a reference, the model's with the scene."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

from kinetics.support.settings import validated
from mechsim.accuracy.trial import with_numerics
from mechsim.scene import Scene

STEP_FACTORS = (4.0, 2.0, 1.0, 0.5)  # of the scene's step
DRAG_FACTORS = (2.0, 1.0, 0.5)  # of the scene's step, for the curve of steps with sub-cycles of the drag
SUB_CYCLES, SUB_CYCLES_OF_CURVE = (1, 2), 4
ITERATIONS = (1, 5, 10, 50)
REFERENCE_STEP, REFERENCE_ITERATIONS = 0.25, 4  # factors
MOST_ITERATIONS = 1000  # that a scene may ask for
Vary = Callable[[Any], Sequence[Any]]


def times(*factors: float) -> Vary:
    """Variations of a setting by factors."""
    return lambda value: [value * factor for factor in factors]


# Settings of the model whose influence is shown: effect, setting, what else it is set to. The probability of a capture
# is not among them: with bonds off it changes nothing, and the rate of bonds is proportional to it. The drag points
# are: more of them are no finer picture of one fluid but another fluid. Each draws a velocity of its own, so that
# speeds fall with their number, and they sit elsewhere, so that the torque differs even where the fluid is smooth.
VARIATIONS: tuple[tuple[str, str, Vary], ...] = (
    ("agitation", "hold", times(0.5, 2)),
    ("ornstein-uhlenbeck", "correlation_time", times(0.5, 2)),
    ("random-field", "correlation_time", times(0.5, 2)),
    ("random-field", "correlation_length", times(0.5, 2)),
    ("drag", "points", lambda value: ["sub-faces" if value == "sub-cubes" else "sub-cubes"]),
    ("contact", "restitution", lambda _: [0.0, 0.8]),
    ("contact", "friction", lambda _: [0.0, 0.8]),
    ("bonding", "capture_distance", times(0.5, 1.5)),
    ("bonding", "capture_angle", lambda value: [angle for angle in (value - 15, value + 15) if 90 <= angle < 180]),
)
CORRELATED_OVER = (0.25, 0.5)  # edges; how far fluid is made to move together where in the scene it does not at all


@dataclass(frozen=True)
class Setting:
    """One way to simulate the scene. curve : the knob that is turned; label : its value"""

    curve: str
    label: str
    scene: Scene


@dataclass(frozen=True)
class Refused:
    """A setting that the scene's own checks do not let run."""

    curve: str
    label: str
    reason: str


@dataclass(frozen=True)
class AccuracyPlan:
    """The comparisons: `numerical` settings with the reference, `model` settings with the scene as it is (`base`)."""

    reference: Setting
    base: Setting
    numerical: tuple[Setting, ...]
    model: tuple[Setting, ...]
    refused: tuple[Refused, ...]


def plan(scene: Scene) -> AccuracyPlan:
    """All settings for a scene. What its own checks refuse is listed with the reason."""
    step, iterations = scene.numerics.step, scene.numerics.solver_iterations
    numerical: list[Setting] = []
    model: list[Setting] = []
    refused: list[Refused] = []

    def add(to: list[Setting], curve: str, value: Any, make: Callable[[], Scene]) -> None:
        label = f"{value:.6g}" if isinstance(value, float) else str(value)
        try:
            to.append(Setting(curve, label, make()))
        except ValueError as error:
            refused.append(Refused(curve, label, str(error)))

    for factor in STEP_FACTORS:
        add(numerical, "step", step * factor, partial(with_numerics, scene, step=step * factor))
    drag = scene.effect("drag")
    if drag is not None:
        own = drag.sub_cycles
        for n in SUB_CYCLES:
            if n != own:
                add(numerical, "drag sub-cycles", n, partial(scene.changed, "drag", sub_cycles=n))
        if own != SUB_CYCLES_OF_CURVE:
            cycled = scene.changed("drag", sub_cycles=SUB_CYCLES_OF_CURVE)
            for factor in DRAG_FACTORS:
                make = partial(with_numerics, cycled, step=step * factor)
                add(numerical, f"step, {SUB_CYCLES_OF_CURVE} drag sub-cycles", step * factor, make)
    for n in ITERATIONS:
        if n != iterations:
            add(numerical, "solver iterations", n, partial(with_numerics, scene, solver_iterations=n))
    for effect, name, vary in VARIATIONS:
        settings = scene.effect(effect)
        if settings is not None:
            own = getattr(settings, name)
            for value in vary(own):
                if value != own:
                    add(
                        model,
                        f"{effect} {name}".replace("_", " "),
                        value,
                        partial(scene.changed, effect, **{name: value}),
                    )
    agitation = scene.effect("agitation")
    if agitation is not None:
        for edges in CORRELATED_OVER:
            field = {
                "effect": "random-field",
                "sigma": agitation.sigma,
                "correlation_length": edges * scene.cubes.edge,
                "correlation_time": agitation.hold / 2,
            }
            make = partial(_with, scene, "agitation", field)
            add(model, "agitation correlated over", edges * scene.cubes.edge, make)
    finest = min(MOST_ITERATIONS, REFERENCE_ITERATIONS * iterations)
    reference = with_numerics(scene, step=step * REFERENCE_STEP, solver_iterations=finest)
    return AccuracyPlan(
        reference=Setting("reference", f"{step * REFERENCE_STEP:.6g}", reference),
        base=Setting("step", f"{step:.6g}", scene),
        numerical=tuple(numerical),
        model=tuple(model),
        refused=tuple(refused),
    )


def _with(scene: Scene, effect: str, other: dict[str, Any]) -> Scene:
    """The scene with another effect in the place of one that it lists."""
    data = scene.as_dict()
    data["effects"] = [other if item["effect"] == effect else item for item in data["effects"]]
    return validated(Scene, data, f"scene {scene.name} with {other['effect']}")
