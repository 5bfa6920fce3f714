"""Held-out mechanics runs, which the rates never saw, beside their prediction: by channel, and by class in growth."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from calibration.estimating.diagnosing.diagnosis import Diagnosis, diagnose
from calibration.pipeline.study_runs import StudyRuns, bonds_of
from calibration.validating.crossvalidation import crossvalidate
from calibration.validating.growth_curves import GROUPS, MOST_GROUPS, GrowthComparison, compare_growth
from calibration.validating.over_sizes import ComparedSizes
from kinetics.network import Tank
from kinetics.networkfree import growth_of
from kinetics.rates import ClassRates, Rates
from kinetics.support import plots
from kinetics.support.cli.progress import stage
from kinetics.support.packages import pd
from kinetics.support.shown import Tabular
from mechsim.runs.ensemble import Outcome
from mechsim.runs.executors import Executor
from mechsim.runs.record import RunRecord, RunSpec, book_of
from mechsim.runs.species import species_of

POINTS = 41  # times of a comparison


@dataclass(frozen=True, eq=False)
class ValidationStudy(ComparedSizes, Tabular):
    """Held-out runs beside their prediction, one comparison a system size."""

    rates: Rates
    outcome: Outcome

    @cached_property
    def diagnosis(self) -> Diagnosis:
        """Do the held-out runs of all sizes together behave as the chain of these rates would?"""
        sound = self.outcome.sound
        return diagnose([record.path for record in sound], self.rates, bonds_of(sound))

    def to_dataframe(self) -> pd.DataFrame:
        """Events seen and expected, one row a size and group of channels."""
        return pd.DataFrame([row.to_dict() for row in self.events])

    def to_dict(self) -> dict[str, Any]:
        """Verdict, events, comparisons and diagnostics, ready for JSON."""
        return {
            "is_consistent": self.is_consistent,
            "verdict": self.verdict.sentence,
            "events": [row.to_dict() for row in self.events],
            "comparisons": [comparison.to_dict() for comparison in self.comparisons],
            "diagnostics": self.diagnosis.to_dict(),
            "digest": self.outcome.digest,
            "problems": self.outcome.problems,
        }


@dataclass(frozen=True, eq=False)
class GrowthStudy(Tabular):
    """Held-out runs beside their prediction by class rates, one comparison an initial state."""

    comparisons: tuple[GrowthComparison, ...]
    rates: ClassRates
    outcome: Outcome

    @property
    def is_consistent(self) -> bool:
        """True if every comparison is consistent."""
        return all(comparison.is_consistent for comparison in self.comparisons)

    def to_dataframe(self) -> pd.DataFrame:
        """All curves, one row a time and curve of each comparison."""
        return pd.concat([comparison.to_dataframe() for comparison in self.comparisons])

    def save_plot(self, file: str) -> None:
        """One figure of all comparisons, above each other."""

        def draw(figure: Any) -> None:
            figure.get_layout_engine().set(w_pad=0.1, h_pad=0.1)  # inches; titles keep off the frame
            parts = figure.subfigures(len(self.comparisons), 1, squeeze=False)
            for part, comparison in zip(parts.flat, self.comparisons, strict=True):
                comparison.plot(part)

        rows = sum(-(-len(comparison.curves) // 3) for comparison in self.comparisons)
        plots.save_figure(file, draw, (9.0, 0.6 + 2.1 * rows))

    def to_dict(self) -> dict[str, Any]:
        """All comparisons, ready for JSON."""
        return {
            "is_consistent": self.is_consistent,
            "comparisons": [comparison.to_dict() for comparison in self.comparisons],
            "digest": self.outcome.digest,
            "problems": self.outcome.problems,
        }


def check_held_out(runs: StudyRuns, rates: Rates | ClassRates) -> None:
    """ValueError where rates cannot predict these runs, or saw them.

    They are those of another network or tank, or lack a class; or they were measured with the same seed, so that
    calibration and test would share their random numbers.
    """
    seen = rates.evidence.get("seeds", [rates.evidence.get("seed")])
    if runs.seed in seen:
        raise ValueError(f"the rates were calibrated with seed {runs.seed} too; held-out runs need another --seed")
    physics = runs.specs[0].physics
    if rates.evidence.get("physics", physics) != physics:
        raise ValueError(
            f"the rates come from version {rates.evidence['physics']} of the mechanics, and held-out runs are of "
            f"version {physics}, in which the same inputs give other runs; calibrate again"
        )
    if isinstance(rates, Rates):
        rates.apply(book_of(runs.scene.rules)[1].network)
        return
    for scene in {spec.scene.fingerprint: spec.scene for spec in runs.specs}.values():
        if rates.tank is not None and rates.tank != scene.tank.size:
            raise ValueError(
                f"the rates were measured in a tank of {rates.tank}; scene {scene.name} has {scene.tank.size}: "
                "calibrate in that one"
            )
        for rate_class in book_of(scene.rules)[1].rate_classes:
            rates.key(rate_class)


def run_validation(
    runs: StudyRuns,
    rates: Rates,
    folder: str | Path,
    *,
    workers: int | Executor = 1,
    progress: bool | None = None,
) -> ValidationStudy:
    """Make the missing held-out runs and compare them with the prediction, by tank, size and engine.

    ValueError: rates that do not pass `check_held_out`; a single run of some size.
    """
    groups: dict[tuple[tuple[float, float, float], int, str], list[RunSpec]] = {}
    for spec in runs.specs:
        groups.setdefault((spec.scene.tank.size, spec.n_cubes, spec.scene.numerics.engine), []).append(spec)
    if (fewest := min(map(len, groups.values()))) < 2:
        raise ValueError(f"runs = {fewest}; a mean with an interval needs at least 2")
    check_held_out(runs, rates)
    outcome = runs.make(folder, workers, progress)
    book, derivation = book_of(runs.scene.rules)
    target = species_of(derivation, book.target)
    finished = {record.spec.key: record for record in outcome.sound}
    comparisons = []
    tank, usual = runs.scene.tank.size, runs.scene.numerics.engine
    for number, ((size, n, engine), alike) in enumerate(groups.items()):
        label = f"{n} cubes{'' if size == tank else f' in {Tank(size)}'}{'' if engine == usual else f' ({engine})'}"
        records = [finished[spec.key] for spec in alike if spec.key in finished]
        if len(records) < 2:
            raise ValueError(f"fewer than two of the runs with {label} reached their end: nothing to compare")
        stage(f"comparing the runs with {label} with their prediction")
        grid = np.linspace(0.0, alike[0].duration, POINTS)
        paths = [record.path for record in records]
        found = crossvalidate(rates, paths, grid, target, seed=runs.seed, number=number)
        cpu = float(sum(record.cost["cpu_seconds"] for record in records))
        comparisons.append(replace(found, label=label, engine=engine, mechanics_cpu=cpu))
    return ValidationStudy(tuple(comparisons), rates, outcome)


def run_growth_validation(
    runs: StudyRuns,
    rates: ClassRates,
    folder: str | Path,
    *,
    most_groups: int | None = None,
    workers: int | Executor = 1,
    progress: bool | None = None,
) -> GrowthStudy:
    """Make the missing held-out runs and compare them with growth under draws of class rates.

    most_groups : predicted groups that decide where a p-value is small; None: `MOST_GROUPS`

    ValueError: rates that do not pass `check_held_out`; no run reached its end.
    """
    check_held_out(runs, rates)
    outcome = runs.make(folder, workers, progress)
    alike: dict[tuple[Any, ...], list[RunRecord]] = {}
    for record in outcome.sound:
        spec = record.spec
        alike.setdefault((spec.scene.fingerprint, *spec.composition.items(), spec.duration), []).append(record)
    if not alike:
        raise ValueError("no held-out run reached its end: nothing to compare")
    most = MOST_GROUPS if most_groups is None else most_groups
    return GrowthStudy(tuple(_grown(rates, records, most) for records in alike.values()), rates, outcome)


def _grown(rates: ClassRates, records: Sequence[RunRecord], most: int) -> GrowthComparison:
    """Runs of one initial state beside their prediction."""
    spec = records[0].spec
    contents = ", ".join(_copies(n, name) for name, n in spec.composition.items())
    growths = [growth_of(record.path, book_of(spec.scene.rules)[1]) for record in records]
    times = np.minimum(np.linspace(0.0, spec.duration, POINTS), growths[0].end)
    return compare_growth(rates, growths, times, f"from {contents}", min(GROUPS, most), most, spec.seed)


def _copies(n: int, species: str) -> str:
    """`4 seeds`; a name that is no word, as `trimer.b`, stays as it is."""
    return f"{n} {species}{'s' if n != 1 and species.isalpha() else ''}"
