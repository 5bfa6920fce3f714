"""The calibration study: mechanics runs along the assembly path, and the rates that they give."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np

from calibration.estimating.break_comparison import BreakComparison, rates_with_breaks
from calibration.estimating.diagnosing.diagnosis import Diagnosis
from calibration.estimating.estimate import Calibration, estimate
from calibration.pipeline.plan import StudyPlan
from calibration.pipeline.study_runs import assembly_specs, diagnosed, made, problems_of, sound_of
from kinetics.rates import Rates
from mechsim.effects import EFFECTS
from mechsim.runs.ensemble import Outcome
from mechsim.runs.executors import Executor
from mechsim.runs.record import RunRecord, book_of, kinds
from mechsim.runs.species import some_of
from mechsim.scene import Scene


@dataclass(frozen=True, eq=False)
class CalibrationStudy:
    """Calibration runs and what they show. Runs that the guard stopped are left out, and counted.

    breaks : name of the break model, or `auto` for the one that the runs choose
    """

    scene: Scene
    outcome: Outcome
    settings: dict[str, Any]
    breaks: str = "auto"

    @property
    def name(self) -> str:
        """The name of the scene."""
        return self.scene.name

    @property
    def source(self) -> str:
        """A sentence on the source of the rates."""
        cubes = ", ".join(map(str, sorted({record.spec.n_cubes for record in self.sound})))
        return f"{len(self.sound)} mechanics runs with {cubes} cubes, {self.cpu_seconds:.0f} s CPU"

    @property
    def made(self) -> str:
        """A sentence on how the runs were made."""
        if "plan" in self.settings:
            return f"Tanks, runs and lengths are those of the plan {self.settings['plan']}."
        return "Runs start from single cubes and are not restarted: rates are measured along the assembly itself."

    @cached_property
    def sound(self) -> list[RunRecord]:
        """Runs that reached their end; ValueError if none did."""
        return sound_of(self.outcome)

    @cached_property
    def calibration(self) -> Calibration:
        """Pooled events and exposures of all channels."""
        return estimate(record.path for record in self.sound)

    @cached_property
    def break_models(self) -> BreakComparison | None:
        """Break models fitted to the runs; all of them, or the one that was asked for. None without breaks."""
        paths = [record.path for record in self.sound]
        return BreakComparison.asked_for(self.breaks, paths, within=2 * self.scene.numerics.step)

    @cached_property
    def diagnosis(self) -> Diagnosis:
        """Are the runs those of a well-mixed Markov chain, whose bonds break as the chosen model says?"""
        return diagnosed(self.sound, None if self.break_models is None else self.break_models.chosen)

    @property
    def cpu_seconds(self) -> float:
        """The diagnosis of all runs."""
        return sum(record.cost["cpu_seconds"] for record in self.outcome.records)

    @property
    def problems(self) -> list[str]:
        """Runs that were stopped by the guard or given up, as sentences."""
        return problems_of(self.outcome)

    @cached_property
    def rates(self) -> Rates:
        """The estimates with their evidence, ready to be saved; see `Calibration.rates` for what was not measured."""
        evidence = {
            "scene": self.scene.name,
            "scene_hash": self.scene.fingerprint,
            "rules": self.scene.content["rules"],
            "rules_hash": book_of(self.scene.rules)[0].fingerprint,
            **self.settings,
            "runs": len(self.sound),
            "runs_left_out": len(self.problems),
            "runs_digest": self.outcome.digest,
            "cpu_seconds": round(self.cpu_seconds, 1),
            "versions": {name: version(name) for name in ("wellmixed", *self.scene.packages)},
            "doubtful_tests": self.diagnosis.doubtful,
        }
        return rates_with_breaks(self.calibration, self.break_models, evidence)


def check_measurable(scene: Scene, sizes: Sequence[int]) -> None:
    """ValueError if assembly from so many single cubes could not show every channel, however long it runs."""
    book, derivation = book_of(scene.rules)
    network = derivation.network
    if book.seed() is not None:
        raise ValueError(
            f"book {scene.rules} grows from a seed: a tank holds one growing structure, so its {len(network.channels)} "
            "channels are not measured one by one; calibrate --by class"
        )
    for kind in dict.fromkeys(kinds(derivation)):
        if not scene.openers(kind):
            able = [effect.name() for effect in EFFECTS if kind in effect.opens]
            raise ValueError(
                f"scene {scene.name} lists no effect that makes {kind}s happen ({', '.join(able)}); calibration "
                f"measures every channel of book {scene.rules}"
            )
    needed = network.reactants @ [len(derivation.structures[name]) for name in network.species]
    beyond = [network.channels[i] for i in np.flatnonzero(needed > max(sizes, default=0))]
    if beyond:
        raise ValueError(f"cubes = {list(sizes)}: too few for the reactants of {some_of(beyond)}; take more")


def run_calibration(
    scene: Scene,
    runs_folder: str | Path,
    *,
    sizes: Sequence[int] = (60,),
    runs: int = 20,
    duration: float = 1000.0,
    seed: int = 1,
    breaks: str = "auto",
    workers: int | Executor = 1,
    progress: bool | None = None,
) -> CalibrationStudy:
    """Make the missing calibration runs and read the others: `runs` assemblies from single cubes at each size.

    ValueError for a scene that does not pass `check_measurable`.
    """
    check_measurable(scene, sizes)
    outcome = made(assembly_specs(scene, sizes, runs, duration, seed), runs_folder, workers, progress)
    settings = {"cubes": list(dict.fromkeys(sizes)), "duration": duration, "seed": seed}
    return CalibrationStudy(scene, outcome, settings, breaks)


def run_planned_calibration(
    plan: StudyPlan,
    runs_folder: str | Path,
    *,
    breaks: str | None = None,
    workers: int | Executor = 1,
    progress: bool | None = None,
) -> CalibrationStudy:
    """Make the missing calibration runs of a plan and read the others.

    breaks : name of a break model in the place of the plan's, such as that of its control; the evidence says so
    """
    outcome = made(plan.specs(plan.calibration), runs_folder, workers, progress)
    settings = {"plan": plan.name, "plan_hash": plan.fingerprint, "seed": plan.calibration.seed}
    return CalibrationStudy(Scene.load(plan.scene), outcome, settings, breaks or plan.breaks)
