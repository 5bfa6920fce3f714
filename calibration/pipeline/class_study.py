"""Studies by rate class: runs of any scenes calibrate the classes, and held-out growth is compared with them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np

from calibration.estimating.class_calibration import BookRuns, ClassCalibration, calibrate_classes
from calibration.estimating.class_spread import ClassSpread, class_spreads
from calibration.pipeline.study_runs import made, problems_of, sound_of
from calibration.validating.growth_curves import GROUPS, MOST_GROUPS, GrowthComparison, compare_growth
from kinetics.networkfree import growth_of
from kinetics.rates import ClassRates
from mechsim.runs.ensemble import Outcome
from mechsim.runs.executors import Executor
from mechsim.runs.record import RunRecord, RunSpec, book_of

POINTS = 41  # times of a comparison


@dataclass(frozen=True, eq=False)
class ClassStudy:
    """Runs of one or several books and the class rates that they give. Runs that the guard stopped are left out.

    breaks : name of a break model, or `auto` for the one that the runs choose
    share : what the classes of one constant have in common, or `auto`
    """

    outcome: Outcome
    settings: dict[str, Any]
    breaks: str = "auto"
    share: str = "auto"

    @cached_property
    def sound(self) -> list[RunRecord]:
        """Runs that reached their end; ValueError if none did."""
        return sound_of(self.outcome)

    @cached_property
    def calibration(self) -> ClassCalibration:
        """Pooled over all books."""
        return calibrate_classes(self._books, self.breaks, self.share)

    @cached_property
    def spreads(self) -> tuple[ClassSpread, ...]:
        """The tests of each constant: does it fit all the channels pooled in it?"""
        return class_spreads(self._books, self.calibration)

    @cached_property
    def _books(self) -> list[BookRuns]:
        books: dict[str, list[RunRecord]] = {}
        for record in self.sound:
            books.setdefault(record.spec.scene.rules, []).append(record)
        return [BookRuns(book_of(rules)[1], tuple(r.path for r in records)) for rules, records in books.items()]

    @property
    def problems(self) -> list[str]:
        """Runs that were stopped by the guard or given up, as sentences."""
        return problems_of(self.outcome)

    @property
    def source(self) -> str:
        """A sentence on the source of the rates."""
        scenes = ", ".join(dict.fromkeys(record.spec.scene.name for record in self.sound))
        return f"{len(self.sound)} mechanics runs of {scenes}, {self._cpu_seconds:.0f} s CPU"

    @property
    def _cpu_seconds(self) -> float:
        return sum(record.cost["cpu_seconds"] for record in self.outcome.records)

    @cached_property
    def rates(self) -> ClassRates:
        """The class rates with their evidence, ready to be saved."""
        scenes = {record.spec.scene.name: record.spec.scene for record in self.sound}
        packages = dict.fromkeys(name for scene in scenes.values() for name in scene.packages)
        evidence = {
            "scenes": list(scenes),
            "scene_hashes": [scene.fingerprint for scene in scenes.values()],
            "rules": list(dict.fromkeys(scene.rules for scene in scenes.values())),
            **self.settings,
            "runs": len(self.sound),
            "runs_left_out": len(self.problems),
            "runs_digest": self.outcome.digest,
            "cpu_seconds": round(self._cpu_seconds, 1),
            "versions": {name: version(name) for name in ("wellmixed", *packages)},
        }
        return self.calibration.rates(evidence)


@dataclass(frozen=True, eq=False)
class GrowthStudy:
    """Held-out runs beside their prediction by class rates, one comparison an initial state."""

    comparisons: tuple[GrowthComparison, ...]
    rates: ClassRates
    outcome: Outcome

    @property
    def is_consistent(self) -> bool:
        """True if every comparison is consistent."""
        return all(comparison.is_consistent for comparison in self.comparisons)

    @property
    def problems(self) -> list[str]:
        """Runs that were stopped by the guard or given up, as sentences."""
        return problems_of(self.outcome)


def run_class_calibration(
    specs: Sequence[RunSpec],
    settings: dict[str, Any],
    runs_folder: str | Path,
    *,
    breaks: str = "auto",
    share: str = "auto",
    workers: int | Executor = 1,
    progress: bool | None = None,
) -> ClassStudy:
    """Make the missing runs and read the others; they may be of several scenes and books.

    settings : what the evidence says of them
    """
    return ClassStudy(made(specs, runs_folder, workers, progress), settings, breaks, share)


def run_growth_validation(
    specs: Sequence[RunSpec],
    rates: ClassRates,
    runs_folder: str | Path,
    *,
    groups: int = GROUPS,
    most_groups: int = MOST_GROUPS,
    points: int = POINTS,
    workers: int | Executor = 1,
    progress: bool | None = None,
) -> GrowthStudy:
    """Make the missing held-out runs and compare them with growth under draws of class rates.

    ValueError: rates measured with the same seed, or in another tank; bonds break in a scene and the rates of breaks
    are missing.
    """
    for spec in specs:
        check_held_out_of(spec, rates)
    outcome = made(specs, runs_folder, workers, progress)
    alike: dict[tuple[Any, ...], list[RunRecord]] = {}
    for record in outcome.records:
        if record.completed:
            spec = record.spec
            alike.setdefault((spec.scene.fingerprint, *spec.composition.items(), spec.duration), []).append(record)
    comparisons = []
    for records in alike.values():
        spec = records[0].spec
        contents = ", ".join(_copies(n, name) for name, n in spec.composition.items())
        growths = [growth_of(record.path, book_of(spec.scene.rules)[1]) for record in records]
        grid = np.linspace(0.0, spec.duration, points)
        label = f"from {contents}"
        comparisons.append(
            compare_growth(rates, growths, np.minimum(grid, growths[0].end), label, groups, most_groups, spec.seed)
        )
    if not comparisons:
        raise ValueError("no held-out run reached its end: nothing to compare")
    return GrowthStudy(tuple(comparisons), rates, outcome)


def _copies(n: int, species: str) -> str:
    """`4 seeds`; a name that is no word, as `trimer.b`, stays as it is."""
    return f"{n} {species}{'s' if n != 1 and species.isalpha() else ''}"


def check_held_out_of(spec: RunSpec, rates: ClassRates) -> None:
    """ValueError if class rates cannot predict these runs, or saw them."""
    if spec.seed in rates.evidence.get("seeds", []):
        raise ValueError(f"the rates were calibrated with seed {spec.seed} too; held-out runs need another --seed")
    if rates.tank is not None and rates.tank != spec.scene.tank.size:
        raise ValueError(
            f"the rates were measured in a tank of {rates.tank}; scene {spec.scene.name} has {spec.scene.tank.size}: "
            "calibrate in that one"
        )
    for rate_class in book_of(spec.scene.rules)[1].rate_classes:
        rates.key(rate_class)
