"""Pilot runs: a few from single cubes, whose rough rates predict the path on which a study is planned."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from calibration.estimating.break_comparison import BreakComparison, rates_with_breaks
from calibration.estimating.estimate import estimate
from calibration.pipeline.run_costs import Cost
from kinetics.rates import Rates
from kinetics.runs import JumpPath
from mechsim.runs.ensemble import run_all
from mechsim.runs.executors import Executor
from mechsim.runs.preflight import check_starts
from mechsim.runs.record import RunSpec, book_of
from mechsim.runs.species import single_cubes, some_of
from mechsim.runs.store import RunStore
from mechsim.scene import Scene

RUNS = 4  # at each number of cubes


@dataclass(frozen=True)
class Pilot:
    """Four runs from single cubes at each number of cubes. duration : of a run, tu"""

    scene: Scene
    cubes: tuple[int, ...]
    duration: float
    seed: int

    @property
    def specs(self) -> list[RunSpec]:
        """The runs, numbered through."""
        derivation = book_of(self.scene.rules)[1]
        starts = [single_cubes(derivation, n) for n in dict.fromkeys(self.cubes) for _ in range(RUNS)]
        return [RunSpec(self.scene, start, self.duration, self.seed, i) for i, start in enumerate(starts)]

    def described(self, cost: Cost) -> str:
        """A sentence on the pilot runs and their cost."""
        specs = self.specs
        check_starts(specs)
        return f"{len(specs)} runs of {self.duration:g} tu, about {sum(map(cost, specs)) / 60:.1f} min of CPU time"

    def rates(self, folder: str | Path, *, workers: int | Executor = 1, progress: bool | None = None) -> Rates:
        """Make the missing runs and estimate rates from all of them.

        ValueError: no run reached its end, or the runs never held the reactants of some channel.
        """
        outcome = run_all(self.specs, RunStore(folder), workers=workers, progress=progress)
        paths = [record.path for record in outcome.records if record.completed]
        if not paths:
            raise ValueError("no pilot run reached its end; look at one by `wellmixed simulate`")
        return pilot_rates(paths)


def pilot_rates(paths: Sequence[JumpPath]) -> Rates:
    """Rates from a few runs, breaks by the model that they choose.

    ValueError: the runs never held the reactants of some channel.
    """
    calibration = estimate(paths)
    if calibration.not_measured:
        raise ValueError(
            f"the pilot runs never held the reactants of {some_of(calibration.not_measured)}; make them longer by "
            "--pilot-time, take more --cubes, or give pilot --rates"
        )
    return rates_with_breaks(calibration, BreakComparison.asked_for("auto", paths))
