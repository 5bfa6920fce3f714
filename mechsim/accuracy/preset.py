"""Presets draft, standard and reference: settings whose error and cost were measured for one scene."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from msgspec import Meta

from kinetics.support.config import find, read_toml, write_toml
from kinetics.support.settings import AtLeastOne, NotNegative, Positive, Settings, validated
from mechsim.accuracy.plan import MOST_ITERATIONS
from mechsim.accuracy.quantities import BY_NAME
from mechsim.accuracy.trial import with_numerics
from mechsim.runs.record import PHYSICS
from mechsim.scene import Scene

if TYPE_CHECKING:
    from mechsim.accuracy.changes import RelativeChange
    from mechsim.accuracy.diagram import Accuracy, SettingResult

PRESETS = Path(__file__).parent / "presets"
# The cheapest step whose error is, with 95 % confidence, within this.
TOLERANCES = {"draft": 0.10, "standard": 0.04}
REFERENCE = "reference"


class Expected(Settings):
    """A measured relative error, and half the width of its 95 % interval."""

    error: float
    half_width: NotNegative

    def __str__(self) -> str:
        return f"{100 * self.error:+.2f} ± {100 * self.half_width:.2f} %"


class Preset(Settings):
    """Numerical settings with what they lead to.

    sub_cycles : of the drag, within a step
    cpu_per_cube : CPU s a simulated tu and cube, on the machine that measured it
    errors : of each quantity that was compared, by its name; see `quantities.QUANTITIES`
    """

    step: Positive
    solver_iterations: Annotated[int, Meta(ge=1, le=MOST_ITERATIONS)]
    sub_cycles: AtLeastOne = 1
    cpu_per_cube: Positive
    errors: Annotated[dict[str, Expected], Meta(min_length=1)]

    def __post_init__(self) -> None:
        if unknown := sorted(set(self.errors) - set(BY_NAME)):
            raise ValueError(f"errors: an error of {unknown[0]!r}; expected one of {', '.join(BY_NAME)}")


class Presets(Settings):
    """The presets of one scene, and how they were measured.

    fingerprint : of the scene; with any other content its presets are not known
    cubes, runs, duration, seed : of the measurement; physics : `record.PHYSICS` then
    """

    scene: str
    fingerprint: str
    cubes: int
    runs: int
    duration: float
    seed: int
    physics: int
    presets: dict[str, Preset]

    def write(self, path: str | Path) -> None:
        """Keep them as TOML."""
        write_toml(self.as_dict(none=False), Path(path))


@dataclass(frozen=True)
class Chosen:
    """A preset under its name. physics : by which it was measured"""

    name: str
    preset: Preset
    physics: int

    def scene(self, scene: Scene) -> Scene:
        """The scene computed with the preset's settings."""
        p = self.preset
        computed = with_numerics(scene, step=p.step, solver_iterations=p.solver_iterations)
        return computed if scene.effect("drag") is None else computed.changed("drag", sub_cycles=p.sub_cycles)

    def expected(self, cubes: int, simulated: float) -> Expectation:
        """Expected error and cost of runs with so many cubes, for so many tu in all."""
        return Expectation(self.name, self.preset, self.physics, self.preset.cpu_per_cube * cubes * simulated)


@dataclass(frozen=True)
class Expectation:
    """Expected error and cost of runs made with a preset; cpu_seconds : on the machine that measured it."""

    name: str
    preset: Preset
    physics: int
    cpu_seconds: float

    def __str__(self) -> str:
        p = self.preset
        errors = ", ".join(f"of the {BY_NAME[name].title} {error}" for name, error in p.errors.items())
        earlier = "" if self.physics == PHYSICS else f" (measured by physics {self.physics}, these runs are {PHYSICS})"
        cycles = f" with {p.sub_cycles} drag sub-cycles" if p.sub_cycles > 1 else ""
        return (
            f"preset {self.name}: step {p.step:.6g} tu{cycles}, {p.solver_iterations} solver iterations; expected "
            f"error {errors}{earlier}; expected cost {self.cpu_seconds:.3g} CPU s"
        )

    def as_dict(self) -> dict[str, Any]:
        """For JSON."""
        found = {"name": self.name, "physics": self.physics} | self.preset.as_dict()
        return found | {"expected_cpu_seconds": self.cpu_seconds}


def load(text: str, scene: Scene, without: Sequence[str] = ()) -> Chosen:
    """The preset `NAME` of a shipped scene, or `FILE.toml:NAME`.

    without : effects that will be left out of the scene. What makes or breaks bonds may be, it was not there when the
        preset was measured; ValueError where another one is, or where no such preset was measured for the scene.
    """
    file, _, name = text.rpartition(":")
    others = [effect for effect in without if effect not in scene.openers("join") + scene.openers("break")]
    if others:
        raise ValueError(
            f"preset {name!r} was never measured for scene {scene.name} without {others[0]}: leave out --preset, or "
            "write that scene to a file and measure it with wellmixed trust accuracy mechanics"
        )
    paths = [find(file, PRESETS, "preset")] if file else sorted(PRESETS.glob("*.toml"))
    known = [validated(Presets, read_toml(path), path.name) for path in paths]
    for measured in known:
        if measured.fingerprint == scene.fingerprint:
            if name not in measured.presets:
                raise ValueError(f"there is no preset {name!r}; scene {scene.name} has {', '.join(measured.presets)}")
            return Chosen(name, measured.presets[name], measured.physics)
    where = f"{file} holds" if file else "the shipped presets are"
    scenes = ", ".join(f"{m.scene} ({m.fingerprint[:8]})" for m in known) or "no scene"
    raise ValueError(
        f"preset {name!r} was never measured for scene {scene.name} as it is ({scene.fingerprint[:8]}); {where} of "
        f"{scenes}. Measure it: wellmixed trust accuracy mechanics SCENE --presets FILE.toml; then say "
        f"--preset FILE.toml:{name}"
    )


def choose(accuracy: Accuracy) -> Presets:
    """Presets from a measured work-precision diagram: the cheapest step, with or without sub-cycles of the drag, within
    each tolerance. The solver's iterations are left as they are: where their curve is flat, chance would choose them.
    What of an error counts against a tolerance is the quantity's to say (`Quantity.against`).

    The error of the reference itself cannot be seen: it is put down as zero, give or take the limit of the next coarser
    step's difference from it. ValueError where the measurement is too short to vouch for a tolerance.
    """
    plain = _but_for_steps(accuracy.scene)
    points = [p for p in accuracy.numerical if p.changes and not p.stopped and _but_for_steps(p.setting.scene) == plain]
    found = {}
    for name, tolerance in TOLERANCES.items():
        within = [p for p in points if _error(p) <= tolerance]
        if not within:
            best = min((_error(p) for p in points), default=float("inf"))
            raise ValueError(
                f"no step is within {tolerance:.0%} ({name}) with 95 % confidence, the best is within {best:.1%}: "
                "measure longer (--rounds, --budget), or make the scene's step smaller"
            )
        found[name] = _preset(min(within, key=lambda p: p.cost), accuracy)
    finest = min(points, key=lambda p: p.setting.scene.numerics.step)
    found[REFERENCE] = _preset(accuracy.reference, accuracy, finest)
    return Presets(
        scene=accuracy.scene.name,
        fingerprint=accuracy.scene.fingerprint,
        cubes=accuracy.cubes,
        runs=accuracy.runs,
        duration=accuracy.duration,
        seed=accuracy.seed,
        physics=PHYSICS,
        presets=found,
    )


def _error(point: SettingResult) -> float:
    """The largest error that counts."""
    return max(BY_NAME[name].against(change) for name, change in point.changes.items())


def _but_for_steps(scene: Scene) -> dict[str, Any]:
    """The content shared by scenes that differ only in their step and in the sub-cycles of the drag."""
    data = scene.as_dict()
    del data["numerics"]["step"]
    for item in data["effects"]:
        item.pop("sub_cycles", None)
    return data


def _preset(point: SettingResult, accuracy: Accuracy, coarser: SettingResult | None = None) -> Preset:
    """A point of the diagram as a preset; `coarser` : the step above it, where it is the reference."""

    def expected(change: RelativeChange) -> Expected:
        if coarser is not None:
            return Expected(error=0.0, half_width=round(change.limit, 5))
        return Expected(error=round(change.value, 5), half_width=round(change.half_width, 5))

    numerics = point.setting.scene.numerics
    return Preset(
        step=numerics.step,
        solver_iterations=numerics.solver_iterations,
        sub_cycles=getattr(point.setting.scene.effect("drag"), "sub_cycles", 1),
        cpu_per_cube=float(f"{point.cost / accuracy.cubes:.3g}"),
        errors={name: expected(change) for name, change in (coarser or point).changes.items()},
    )
