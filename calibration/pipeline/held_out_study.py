"""The held-out study: assembly runs that the rates never saw, beside their prediction."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

import numpy as np

from calibration.estimating.diagnosing.diagnosis import Diagnosis
from calibration.pipeline.plan import StudyPlan
from calibration.pipeline.study_runs import assembly_specs, diagnosed, made, problems_of
from calibration.validating.crossvalidation import crossvalidate
from calibration.validating.over_sizes import ComparedSizes
from kinetics.network import Tank
from kinetics.rates import Rates
from kinetics.support.cli.progress import stage
from mechsim.runs.ensemble import Outcome
from mechsim.runs.executors import Executor
from mechsim.runs.record import RunSpec, book_of
from mechsim.runs.species import species_of
from mechsim.scene import Scene


@dataclass(frozen=True, eq=False)
class ValidationStudy(ComparedSizes):
    """Held-out runs beside their prediction, one comparison a system size."""

    rates: Rates
    outcome: Outcome

    @cached_property
    def diagnosis(self) -> Diagnosis:
        """Do the held-out runs of all sizes together behave as the chain of these rates would?"""
        return diagnosed([record for record in self.outcome.records if record.completed], self.rates)

    @property
    def problems(self) -> list[str]:
        """Runs that were stopped by the guard or given up, as sentences."""
        return problems_of(self.outcome)


def check_held_out(scene: Scene, rates: Rates, seed: int) -> None:
    """ValueError for rates of another network, or calibrated with the same seed: those runs would share their random
    numbers with the calibration."""
    rates.apply(book_of(scene.rules)[1].network)
    if rates.evidence.get("seed") == seed:
        raise ValueError(f"the rates were calibrated with seed {seed} too; held-out runs need another --seed")


def run_validation(
    scene: Scene,
    rates: Rates,
    runs_folder: str | Path,
    *,
    sizes: Sequence[int] = (60, 80, 120),
    runs: int = 10,
    duration: float = 2000.0,
    points: int = 41,
    seed: int = 2,
    workers: int | Executor = 1,
    progress: bool | None = None,
) -> ValidationStudy:
    """Make the missing held-out runs and compare them with the prediction at `points` times from 0 to `duration`.

    ValueError for rates that do not pass `check_held_out`.
    """
    if runs < 2:
        raise ValueError(f"runs = {runs}; a mean with an interval needs at least 2")
    check_held_out(scene, rates, seed)
    specs = assembly_specs(scene, sizes, runs, duration, seed)
    return _compared(scene, rates, specs, made(specs, runs_folder, workers, progress), points)


def run_planned_validation(
    plan: StudyPlan,
    rates: Rates,
    runs_folder: str | Path,
    *,
    points: int = 41,
    workers: int | Executor = 1,
    progress: bool | None = None,
) -> ValidationStudy:
    """Make the missing held-out runs of a plan and compare them with the prediction.

    ValueError for rates that do not pass `check_held_out`.
    """
    scene = Scene.load(plan.scene)
    check_held_out(scene, rates, plan.held_out.seed)
    specs = plan.specs(plan.held_out)
    return _compared(scene, rates, specs, made(specs, runs_folder, workers, progress), points)


def _compared(scene: Scene, rates: Rates, specs: Sequence[RunSpec], outcome: Outcome, points: int) -> ValidationStudy:
    """Each group of runs alike beside its prediction."""
    book, derivation = book_of(scene.rules)
    target = species_of(derivation, book.target)
    finished = {record.spec.key: record for record in outcome.records if record.completed}
    groups: dict[tuple[tuple[float, float, float], int], list[RunSpec]] = {}
    for spec in specs:
        groups.setdefault((spec.scene.tank.size, spec.n_cubes), []).append(spec)
    comparisons = []
    for number, ((size, n), alike) in enumerate(groups.items()):
        label = f"{n} cubes" if size == scene.tank.size else f"{n} cubes in {Tank(size)}"
        records = [finished[spec.key] for spec in alike if spec.key in finished]
        if len(records) < 2:
            raise ValueError(f"fewer than two of the runs with {label} reached their end: nothing to compare")
        stage(f"comparing the runs with {label} with their prediction")
        grid, seed = np.linspace(0.0, alike[0].duration, points), alike[0].seed
        found = crossvalidate(rates, [record.path for record in records], grid, target, seed=seed, number=number)
        cpu = float(sum(record.cost["cpu_seconds"] for record in records))
        comparisons.append(replace(found, label=label, mechanics_cpu=cpu))
    return ValidationStudy(tuple(comparisons), rates, outcome)
