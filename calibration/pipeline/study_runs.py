"""The mechanics runs of a study: assembly from single cubes, made or found, and what the runs say together."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from calibration.estimating.diagnosing.diagnosis import Diagnosis, diagnose
from calibration.estimating.rate_fit import RateFit
from kinetics.rates import Rates
from mechsim.runs.ensemble import Outcome, run_all
from mechsim.runs.executors import Executor
from mechsim.runs.preflight import check_starts
from mechsim.runs.record import RunRecord, RunSpec, book_of
from mechsim.runs.species import single_cubes
from mechsim.runs.store import RunStore
from mechsim.scene import Scene


def assembly_specs(scene: Scene, sizes: Sequence[int], runs: int, duration: float, seed: int) -> list[RunSpec]:
    """Assembly from single cubes: `runs` runs of `duration` tu at each number of cubes, of which none is restarted."""
    if runs < 1:
        raise ValueError(f"runs = {runs}; expected at least 1")
    if not sizes or min(sizes) < 1:
        raise ValueError(f"cubes = {list(sizes)}; expected one or more sizes of at least 1")
    derivation = book_of(scene.rules)[1]
    starts = [single_cubes(derivation, n) for n in dict.fromkeys(sizes)]
    return [RunSpec(scene, start, duration, seed, run) for start in starts for run in range(runs)]


def made(
    specs: Sequence[RunSpec], runs_folder: str | Path, workers: int | Executor = 1, progress: bool | None = None
) -> Outcome:
    """Make what is missing and read the others; a mistake in the specs is found before the folder is made."""
    check_starts(specs)
    return run_all(specs, RunStore(runs_folder), workers=workers, progress=progress)


def pictured_run(scene: Scene, runs_folder: str | Path, *, cubes: int = 60, duration: float, seed: int) -> RunRecord:
    """One run from single cubes with its first and last poses, for a picture."""
    (spec,) = assembly_specs(scene, [cubes], 1, duration, seed)
    outcome = made([replace(spec, poses=duration)], runs_folder, progress=False)
    if not outcome.records:
        raise ValueError(problems_of(outcome)[0])
    return outcome.records[0]


def problems_of(outcome: Outcome) -> list[str]:
    """Runs that were stopped by the guard or given up, as sentences."""
    stopped = [f"{r.spec.title}: {r.outcome}" for r in outcome.records if not r.completed]
    return stopped + [f"{q.spec.title}: given up: {q.reasons[-1]}" for q in outcome.quarantined]


def diagnosed(records: Sequence[RunRecord], fit: RateFit | Rates | None) -> Diagnosis:
    """The diagnosis of runs; rebinding is also tested by cubes, if all records know those of their events."""
    bonds = [record.arrays["bonds"] for record in records if "bonds" in record.arrays]
    return diagnose([record.path for record in records], fit, bonds if len(bonds) == len(records) else None)


def sound_of(outcome: Outcome) -> list[RunRecord]:
    """Calibration runs that reached their end; ValueError, with the first problem, where none did."""
    sound = [record for record in outcome.records if record.completed]
    if not sound:
        raise ValueError(f"no calibration run reached its end; the first of them: {problems_of(outcome)[0]}")
    return sound
