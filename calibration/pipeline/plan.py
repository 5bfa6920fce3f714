"""The plan of a study: which runs measure the rates, which are held out, and by which rules the verdict falls.

It is a file of its own, so that it can be written down before the first run.
"""

from __future__ import annotations

import hashlib
import json
import os
from pathlib import Path
from typing import Annotated, ClassVar

from msgspec import Meta

from kinetics.support.config import is_path, read_toml, write_toml
from kinetics.support.settings import AtLeastOne, Positive, Settings, validated
from mechsim.runs.record import PHYSICS, RunSpec
from mechsim.scene import Scene


class Tanks(Settings):
    """Runs alike in all but their random numbers.

    composition : species -> copies at time 0
    tank : edges; None for the scene's own
    runs, duration : how many, and how long each, tu
    restart : whether a tank is put back to its composition after every event
    along : for the reader, the time on the predicted path at which the composition is expected, tu
    engine : of the mechanics; None for the scene's own
    """

    unless_usual: ClassVar[tuple[str, ...]] = ("engine",)
    composition: Annotated[dict[str, Annotated[int, Meta(ge=0)]], Meta(min_length=1)]
    tank: tuple[float, float, float] | None = None
    runs: AtLeastOne
    duration: Positive
    restart: bool = False
    along: float | None = None
    engine: str | None = None


class PlannedRuns(Settings):
    """Runs of one seed. Runs of different tanks have different numbers, so that none share random numbers."""

    seed: Annotated[int, Meta(ge=0)]
    tanks: Annotated[tuple[Tanks, ...], Meta(min_length=1)]


class VerdictRules(Settings):
    """The rules by which a prediction is judged, stated before the runs.

    p_row : smallest predictive p-value of any row of seen and expected events
    ratio, from_events : range of seen / expected wherever at least `from_events` events are expected
    pooled_ratio : the same over all sizes together, for joins and for breaks, of which as many must be expected
    pooled_breaks : that of breaks, where it is another
    p_pit : smallest p-value of the randomised PIT over all single runs
    control : a break model that must fail these rules; where the plan has a crowding, so must rates without it
    """

    unless_usual: ClassVar[tuple[str, ...]] = ("pooled_breaks",)
    p_row: float = 0.01
    ratio: tuple[float, float] = (0.85, 1.15)
    from_events: float = 150.0
    pooled_ratio: tuple[float, float] = (0.9, 1.1)
    pooled_breaks: tuple[float, float] | None = None
    p_pit: float = 0.05
    control: str = "first-order"


class StudyPlan(Settings):
    """A calibration and its test on held-out runs, as planned.

    scene : name or file; in the file of a plan, a path is relative to the folder of that file
    log_above : loads on bonds above this are logged in every run, see the effect `breaking`; None: no log
    breaks : name of a break model, or `auto` for the one that the calibration runs choose
    crowding : name of a model of crowding, or `auto` for those that hits logged in the calibration runs choose
    purpose : for the reader, what the plan is to find out and how its numbers were chosen
    physics : version of the mechanics of its runs; an earlier one than today's names stored runs, which can be read
    """

    unless_usual: ClassVar[tuple[str, ...]] = ("crowding", "physics")
    name: Annotated[str, Meta(pattern=r"^[A-Za-z0-9][A-Za-z0-9._-]*\Z", max_length=80)]
    purpose: str = ""
    scene: str
    log_above: Positive | None = None
    breaks: str = "auto"
    crowding: str = "none"
    physics: int = PHYSICS
    calibration: PlannedRuns
    held_out: PlannedRuns
    verdict: VerdictRules = VerdictRules()

    def __post_init__(self) -> None:
        if self.calibration.seed == self.held_out.seed:
            raise ValueError(f"seed {self.calibration.seed} for both; held-out runs need a seed of their own")
        for tanks in self.held_out.tanks:
            if tanks.restart:
                raise ValueError("held-out runs are not restarted: they are to show a whole assembly")
            if tanks.runs < 2:
                raise ValueError(f"runs = {tanks.runs} of a held-out tank; a scatter needs at least 2")

    @classmethod
    def load(cls, path: str | Path) -> StudyPlan:
        """Read a plan from a TOML file."""
        source = Path(path)
        if not source.exists():
            raise ValueError(f"plan {source} does not exist; give the path of a TOML file")
        plan = validated(cls, read_toml(source), source.name)
        return plan.replace(scene=str(source.parent / plan.scene)) if is_path(plan.scene) else plan

    def save(self, path: str | Path) -> None:
        """Write the plan as a TOML file, atomically."""
        target = Path(path)
        scene = os.path.relpath(self.scene, target.parent) if is_path(self.scene) else self.scene
        write_toml(self.as_dict(none=False) | {"scene": scene}, target)

    @property
    def fingerprint(self) -> str:
        """SHA-256 of the plan's content, the scene by its name: the same wherever plan and scene are kept."""
        content = self.as_dict() | {"scene": Path(self.scene).name}
        content.pop("physics", None)  # the mechanics' own, and not what was planned
        return hashlib.sha256(json.dumps(content, sort_keys=True).encode()).hexdigest()

    def scene_of(self, tanks: Tanks) -> Scene:
        """The scene of some runs: the plan's, with their tank, their engine and the log of loads."""
        scene = Scene.load(self.scene).by(tanks.engine)
        if self.log_above is not None:
            scene = scene.changed("breaking", log_above=self.log_above)
        return in_tank(scene, tanks.tank)

    def specs(self, part: PlannedRuns) -> list[RunSpec]:
        """All runs of one part, `calibration` or `held_out`, in order."""
        specs: list[RunSpec] = []
        for tanks in part.tanks:
            scene = self.scene_of(tanks)
            specs += [
                RunSpec(scene, tanks.composition, tanks.duration, part.seed, run, tanks.restart, physics=self.physics)
                for run in range(len(specs), len(specs) + tanks.runs)
            ]
        return specs


def in_tank(scene: Scene, tank: tuple[float, float, float] | None) -> Scene:
    """The scene in a tank of these edges; None: in its own."""
    if tank is None:
        return scene
    data = scene.as_dict() | {"tank": {"size": tank}}
    return validated(Scene, data, f"scene {scene.name} in a tank of {tank}")


def is_plan(path: str | Path) -> bool:
    """True if the file holds a plan, not a scene."""
    source = Path(path)
    return source.suffix == ".toml" and source.is_file() and "held_out" in read_toml(source)
