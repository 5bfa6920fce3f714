"""The mechanics runs of a study: those of a plan, or assembly from single cubes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Literal

from calibration.pipeline.plan import StudyPlan, is_plan
from kinetics.support.arrays import Ints
from mechsim.runs.ensemble import Outcome, run_all
from mechsim.runs.executors import Executor
from mechsim.runs.preflight import check_starts
from mechsim.runs.record import RunRecord, RunSpec, book_of
from mechsim.runs.species import single_cubes
from mechsim.runs.store import RunStore
from mechsim.scene import Scene


@dataclass(frozen=True, eq=False)
class StudyRuns:
    """Runs that calibrate, or that are held out; none of an assembly is restarted.

    scene : theirs; a plan may put runs into other tanks
    seed : of all of them
    plan : the plan whose runs they are; None: assembly from single cubes
    """

    scene: Scene
    specs: Sequence[RunSpec]
    seed: int
    plan: StudyPlan | None = None

    @classmethod
    def planned(cls, plan: StudyPlan, part: Literal["calibration", "held_out"]) -> StudyRuns:
        """The runs of one part of a plan."""
        runs = plan.calibration if part == "calibration" else plan.held_out
        return cls(Scene.load(plan.scene), plan.specs(runs), runs.seed, plan)

    @classmethod
    def assembly(cls, scene: Scene, sizes: Sequence[int], runs: int, duration: float, seed: int) -> StudyRuns:
        """Assembly from single cubes: `runs` runs of `duration` tu at each number of cubes."""
        if runs < 1:
            raise ValueError(f"runs = {runs}; expected at least 1")
        if not sizes or min(sizes) < 1:
            raise ValueError(f"cubes = {list(sizes)}; expected one or more sizes of at least 1")
        derivation = book_of(scene.rules)[1]
        starts = [single_cubes(derivation, n) for n in dict.fromkeys(sizes)]
        return cls(scene, [RunSpec(scene, start, duration, seed, run) for start in starts for run in range(runs)], seed)

    @classmethod
    def asked_for(
        cls, source: str, part: Literal["calibration", "held_out"], engine: str | None = None, **assembly: Any
    ) -> StudyRuns:
        """The runs of a plan, if `source` is the file of one, or else assembly in a scene; see `assembly`.

        engine : in the place of the scene's; a plan names its own
        """
        if is_plan(source):
            return cls.planned(StudyPlan.load(source), part)
        return cls.assembly(Scene.load(source).by(engine), **assembly)

    @property
    def sizes(self) -> list[int]:
        """Numbers of cubes, each once."""
        return list(dict.fromkeys(spec.n_cubes for spec in self.specs))

    def make(self, folder: str | Path, workers: int | Executor = 1, progress: bool | None = None) -> Outcome:
        """Make what is missing and read the others."""
        return made(self.specs, folder, workers, progress)


def made(
    specs: Sequence[RunSpec], runs_folder: str | Path, workers: int | Executor = 1, progress: bool | None = None
) -> Outcome:
    """Make what is missing and read the others; a mistake in the specs is found before the folder is made."""
    check_starts(specs)
    return run_all(specs, RunStore(runs_folder), workers=workers, progress=progress)


def pictured_run(scene: Scene, runs_folder: str | Path, *, cubes: int = 60, duration: float, seed: int) -> RunRecord:
    """One run from single cubes with its first and last poses, for a picture."""
    (spec,) = StudyRuns.assembly(scene, [cubes], 1, duration, seed).specs
    outcome = made([replace(spec, poses=duration)], runs_folder, progress=False)
    if not outcome.records:
        raise ValueError(outcome.problems[0])
    return outcome.records[0]


def bonds_of(records: Sequence[RunRecord]) -> list[Ints] | None:
    """The two cubes of each event, run by run; None unless all records know them."""
    bonds = [record.arrays["bonds"] for record in records if "bonds" in record.arrays]
    return bonds if len(bonds) == len(records) else None
