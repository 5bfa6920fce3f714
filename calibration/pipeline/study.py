"""The calibration study: planned mechanics runs, the rates they give, and the held-out runs that test these rates."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np

from calibration.estimating.break_comparison import BreakComparison, rates_with_breaks
from calibration.estimating.diagnosing.diagnosis import Diagnosis, diagnose
from calibration.estimating.estimate import Calibration, estimate
from calibration.estimating.paper import paper_estimate
from calibration.estimating.rate_fit import RateFit
from calibration.pipeline.plan import StudyPlan
from calibration.validating.crossvalidation import crossvalidate
from calibration.validating.over_sizes import ComparedSizes
from kinetics.assembly import Derivation
from kinetics.network import Tank
from kinetics.rates import Rates
from mechsim.effects import EFFECTS
from mechsim.runs.ensemble import Outcome, run_all
from mechsim.runs.executors import Executor
from mechsim.runs.preflight import check_starts
from mechsim.runs.record import RunRecord, RunSpec, book_of, kinds, open_channels
from mechsim.runs.species import single_cubes, some_of, species_of
from mechsim.runs.store import RunStore
from mechsim.scene import Scene

LONGEST = 500.0  # tu; longer experiments are cut into runs of equal length, so that workers share them


@dataclass(frozen=True)
class Experiment:
    """Calibration runs of one kind: restarted after every event, from one composition.

    composition : species -> copies
    joins : False takes what makes joins out of the scene; then only breaks can happen, and nothing else uses up the
        time
    """

    composition: dict[str, int]
    joins: bool


def experiments(derivation: Derivation, n_cubes: int) -> list[Experiment]:
    """What to run so that every channel of a network is seen at `n_cubes` cubes.

    A tank of all species in equal shares of cubes, and for each join one of its reactants. Breaks are rare, so for each
    species that breaks there is a tank without joins, half of it that species and half the same mixed crowd:
    collisions break bonds, and a tank of few large structures has fewer of them than the assembly passes through.
    """
    network = derivation.network
    sizes = {name: len(structure) for name, structure in derivation.structures.items()}
    free = str(species_of(derivation, derivation.book.monomer()))
    crowd = dict.fromkeys(network.species, 1.0)

    def mixture(shares: dict[str, float]) -> dict[str, int]:
        """Cubes in these shares among the species; what is left over becomes free cubes."""
        whole = sum(shares.values())
        counts = {name: int(n_cubes * share / whole / sizes[name]) for name, share in shares.items()}
        counts[free] = counts.get(free, 0) + n_cubes - sum(sizes[name] * n for name, n in counts.items())
        return {name: n for name, n in counts.items() if n}

    wanted = [Experiment(mixture(crowd), True)]
    for reactants, kind in zip(network.reactants, kinds(derivation), strict=True):
        before = [network.species[s] for s in np.flatnonzero(reactants)]
        if kind == "join":
            wanted.append(Experiment(mixture(dict.fromkeys(before, 1.0)), True))
        else:
            source = {before[0]: 1.0 + len(crowd)}
            wanted.append(Experiment(mixture(crowd | source), False))
    return list({repr(experiment): experiment for experiment in wanted}.values())


def calibration_specs(scene: Scene, n_cubes: int, join_time: float, break_time: float, seed: int) -> list[RunSpec]:
    """Runs of all experiments: `join_time` tu for each with joins, `break_time` tu for each without."""
    for name, value in (("join time", join_time), ("break time", break_time)):
        if not (math.isfinite(value) and value > 0):
            raise ValueError(f"{name} = {value}; expected a finite number of tu above 0")
    book, derivation = book_of(scene.rules)
    network = derivation.network
    if book.seed() is not None:
        raise ValueError(
            f"book {scene.rules} grows from a seed: a tank holds one growing structure, so its {len(network.channels)} "
            "channels are not measured one by one; simulate its growth instead"
        )
    for kind in dict.fromkeys(kinds(derivation)):
        if not scene.openers(kind):
            able = [effect.model_fields["effect"].default for effect in EFFECTS if kind in effect.opens]
            raise ValueError(
                f"scene {scene.name} lists no effect that makes {kind}s happen ({', '.join(able)}); calibration "
                f"measures every channel of book {scene.rules}"
            )
    planned = [
        (e, scene if e.joins else scene.without(*scene.openers("join"))) for e in experiments(derivation, n_cubes)
    ]
    measured = np.zeros(len(network.channels), bool)
    for experiment, setting in planned:
        at_start = network.combinations_of(network.state(experiment.composition)) > 0
        measured |= at_start & open_channels(setting, derivation)
    if not measured.all():
        names = [name for name, seen in zip(network.channels, measured, strict=True) if not seen]
        raise ValueError(f"cubes = {n_cubes}: too few to start runs from the reactants of {some_of(names)}; take more")
    specs = []
    for experiment, setting in planned:
        total = join_time if experiment.joins else break_time
        runs = math.ceil(total / LONGEST)
        specs += [
            RunSpec(setting, experiment.composition, total / runs, seed, run, restart=True) for run in range(runs)
        ]
    return specs


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
        """Of the scene."""
        return self.scene.name

    @property
    def source(self) -> str:
        """Where the rates come from, in words."""
        cubes = ", ".join(map(str, sorted({record.spec.n_cubes for record in self.sound})))
        return f"{len(self.sound)} mechanics runs with {cubes} cubes, {self.cpu_seconds:.0f} s CPU"

    @property
    def made(self) -> str:
        """How the runs were made, in a sentence."""
        if "plan" in self.settings:
            return f"Tanks, runs and lengths are those of the plan {self.settings['plan']}."
        return (
            "Runs were put back to their start after every event; breaks, being rare, were watched in tanks without "
            "bonding."
        )

    @cached_property
    def sound(self) -> list[RunRecord]:
        """Runs that reached their end; ValueError where none did."""
        sound = [record for record in self.outcome.records if record.completed]
        if not sound:
            raise ValueError(f"no calibration run reached its end; the first of them: {self.problems[0]}")
        return sound

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
        return _diagnosed(self.sound, None if self.break_models is None else self.break_models.chosen)

    @cached_property
    def paper_rates(self) -> dict[str, float]:
        """The paper's own estimator on the same runs."""
        return paper_estimate([record.path for record in self.sound])

    @property
    def cpu_seconds(self) -> float:
        """Of all runs."""
        return sum(record.cost["cpu_seconds"] for record in self.outcome.records)

    @property
    def problems(self) -> list[str]:
        """Runs that were stopped by the guard or given up, in words."""
        stopped = [f"{r.spec.title}: {r.outcome}" for r in self.outcome.records if not r.completed]
        return stopped + [f"{q.spec.title}: given up: {q.reasons[-1]}" for q in self.outcome.quarantined]

    @cached_property
    def rates(self) -> Rates:
        """The estimates with their evidence, ready to be saved."""
        paper = {name: rate for name, rate in self.paper_rates.items() if math.isfinite(rate)}
        evidence = {
            "scene": self.scene.name,
            "scene_hash": self.scene.fingerprint,
            "rules": self.scene.rules,
            "rules_hash": book_of(self.scene.rules)[0].fingerprint,
            **self.settings,
            "runs": len(self.sound),
            "runs_left_out": len(self.problems),
            "runs_digest": self.outcome.digest,
            "cpu_seconds": round(self.cpu_seconds, 1),
            "versions": {name: version(name) for name in ("wellmixed", "pybullet", "numpy")},
            "doubtful_tests": self.diagnosis.doubtful,
            "paper_estimator": paper,
        }
        return rates_with_breaks(self.calibration, self.break_models, evidence)


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
    outcome = _run(plan.specs(plan.calibration), runs_folder, workers, progress)
    settings = {"plan": plan.name, "plan_hash": plan.fingerprint, "seed": plan.calibration.seed}
    return CalibrationStudy(Scene.load(plan.scene), outcome, settings, breaks or plan.breaks)


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
    return _compared(scene, rates, specs, _run(specs, runs_folder, workers, progress), points)


def run_calibration(
    scene: Scene,
    runs_folder: str | Path,
    *,
    cubes: int = 60,
    join_time: float = 1000.0,
    break_time: float = 4000.0,
    seed: int = 1,
    breaks: str = "auto",
    workers: int | Executor = 1,
    progress: bool | None = None,
) -> CalibrationStudy:
    """Make the missing calibration runs and read the others. Times are tu per experiment (see
    `calibration_specs`)."""
    specs = calibration_specs(scene, cubes, join_time, break_time, seed)
    settings = {"cubes": cubes, "join_time": join_time, "break_time": break_time, "seed": seed}
    return CalibrationStudy(scene, _run(specs, runs_folder, workers, progress), settings, breaks)


def check_held_out(scene: Scene, rates: Rates, seed: int) -> None:
    """ValueError for rates of another network, or calibrated with the same seed: those runs would share their random
    numbers with the calibration."""
    rates.apply(book_of(scene.rules)[1].network)
    if rates.evidence.get("seed") == seed:
        raise ValueError(f"the rates were calibrated with seed {seed} too; held-out runs need another --seed")


@dataclass(frozen=True, eq=False)
class ValidationStudy(ComparedSizes):
    """Held-out runs beside their prediction, one comparison a system size."""

    rates: Rates
    outcome: Outcome

    @cached_property
    def diagnosis(self) -> Diagnosis:
        """Do the held-out runs of all sizes together behave as the chain of these rates would?"""
        return _diagnosed([record for record in self.outcome.records if record.completed], self.rates)

    @property
    def problems(self) -> list[str]:
        """Runs that were stopped by the guard or given up, in words."""
        stopped = [f"{r.spec.title}: {r.outcome}" for r in self.outcome.records if not r.completed]
        return stopped + [f"{q.spec.title}: given up: {q.reasons[-1]}" for q in self.outcome.quarantined]


def validation_specs(scene: Scene, sizes: Sequence[int], runs: int, duration: float, seed: int) -> list[RunSpec]:
    """Assembly from single cubes, `runs` runs at each size."""
    if runs < 2:
        raise ValueError(f"runs = {runs}; a mean with an interval needs at least 2")
    if not sizes or min(sizes) < 1:
        raise ValueError(f"cubes = {list(sizes)}; expected one or more sizes of at least 1")
    derivation = book_of(scene.rules)[1]
    starts = [single_cubes(derivation, n) for n in dict.fromkeys(sizes)]
    return [RunSpec(scene, start, duration, seed, run) for start in starts for run in range(runs)]


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
    check_held_out(scene, rates, seed)
    specs = validation_specs(scene, sizes, runs, duration, seed)
    return _compared(scene, rates, specs, _run(specs, runs_folder, workers, progress), points)


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
        comparisons.append(
            crossvalidate(
                derivation.network,
                rates,
                [record.path for record in records],
                np.linspace(0.0, alike[0].duration, points),
                target=target,
                label=label,
                seed=alike[0].seed,
                mechanics_cpu=sum(record.cost["cpu_seconds"] for record in records),
                number=number,
            )
        )
    return ValidationStudy(tuple(comparisons), rates, outcome)


def watched_run(scene: Scene, runs_folder: str | Path, *, cubes: int = 60, duration: float, seed: int) -> RunRecord:
    """One run from single cubes with its first and last poses, for a picture."""
    (spec,) = validation_specs(scene, [cubes], 2, duration, seed)[:1]
    outcome = _run([replace(spec, poses=duration)], runs_folder, workers=1, progress=False)
    if not outcome.records:
        raise ValueError(f"{spec.title}: given up: {outcome.quarantined[0].reasons[-1]}")
    return outcome.records[0]


def _diagnosed(records: Sequence[RunRecord], fit: RateFit | Rates | None) -> Diagnosis:
    """By pieces too, where all records know the cubes of their events."""
    bonds = [record.arrays["bonds"] for record in records if "bonds" in record.arrays]
    return diagnose([record.path for record in records], fit, bonds if len(bonds) == len(records) else None)


def _run(specs: list[RunSpec], runs_folder: str | Path, workers: int | Executor, progress: bool | None) -> Outcome:
    """Make what is missing and read the others; a mistake in the specs is found before the folder is made."""
    check_starts(specs)
    return run_all(specs, RunStore(runs_folder), workers=workers, progress=progress)
