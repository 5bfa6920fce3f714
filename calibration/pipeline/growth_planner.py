"""From a scene of seeds to the plan of a study by rate class: growth that calibrates, and growth that is held out."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from calibration.pipeline.plan import PlannedRuns, StudyPlan, Tanks
from calibration.pipeline.planned import HeldOutTest, Planned, PlanRequest, spent
from calibration.pipeline.planner import FEWEST, chosen_runs
from calibration.pipeline.run_costs import Cost
from calibration.planning.allocation import affordable, allocate, events_for, half_width
from calibration.planning.held_out import runs_for
from calibration.validating.power import GroupPower
from kinetics.assembly import Derivation
from kinetics.networkfree import grow
from kinetics.rates import ClassRates
from kinetics.support.tables import figure, text_table
from mechsim.runs.preflight import check_starts
from mechsim.runs.record import RunSpec, book_of
from mechsim.runs.species import species_of
from mechsim.scene import Scene

GROWTHS = 20  # network-free runs behind a mean number of events
SPARE = 2  # cubes in a tank for each that its seeds take up


@dataclass(frozen=True, eq=False)
class PlannedGrowth(Planned):
    """A plan of growth from seeds, and what it will show at which cost.

    Rates are by class, and which classes the runs tell apart is not known beforehand: the width is that of all joins
    together. In books that `new` compiles for a seed bonds hold, so that no breaks are planned for.

    compositions : number of cubes -> species -> copies
    events : number of cubes of the calibration -> joins expected in a run
    runs, costs : of the calibration, by number of cubes; CPU seconds of a run
    held_out_runs, held_out_costs : likewise of the held-out runs
    """

    request: PlanRequest
    compositions: Mapping[int, dict[str, int]]
    events: dict[int, float]
    runs: dict[int, int]
    costs: dict[int, float]
    wanted_seconds: float
    tests: tuple[HeldOutTest, ...]
    held_out_runs: dict[int, int]
    held_out_costs: dict[int, float]

    @property
    def joins(self) -> float:
        """Joins expected in the calibration."""
        return sum(runs * self.events[cubes] for cubes, runs in self.runs.items())

    @property
    def width(self) -> float:
        """The half-width expected."""
        return float(half_width(self.joins))

    @property
    def calibration_seconds(self) -> float:
        """CPU seconds of all calibration runs."""
        return spent(self.runs, self.costs)

    @cached_property
    def plan(self) -> StudyPlan:
        """The plan itself."""
        request = self.request
        parts = [
            PlannedRuns(
                seed=seed,
                tanks=tuple(
                    Tanks(composition=self.compositions[n], runs=k, duration=duration) for n, k in runs.items() if k
                ),
            )
            for seed, runs, duration in (
                (request.seed, self.runs, request.duration),
                (request.seed + 1, self.held_out_runs, request.held_out_duration),
            )
        ]
        return StudyPlan(
            name=request.name,
            purpose=f"Growth from seeds, by rate class: a half-width of {self.width:.1%} for all joins together; held-"
            f"out growth that shows joins off by {request.shift:.0%}. It holds if no check of `validate` is out of the "
            "ordinary at 1 %, Holm's correction included.",
            scene=request.scene,
            calibration=parts[0],
            held_out=parts[1],
        )

    def tank_rows(self) -> list[dict[str, Any]]:
        """One row a tank of the calibration: composition, runs, CPU seconds, and joins expected in all of its runs."""
        return [
            {
                "composition": self.compositions[n],
                "runs": runs,
                "cpu_seconds": runs * self.costs[n],
                "joins": runs * self.events[n],
            }
            for n, runs in self.runs.items()
            if runs
        ]

    def tables(self) -> str:
        """The plan for people."""
        rows = [
            (
                " ".join(f"{n} {name}" for name, n in self.compositions[cubes].items()),
                kind,
                str(runs),
                f"{runs * events:.0f}",
                f"{runs * cost / 60:.1f}",
            )
            for kind, many, costs, each in (
                ("calibration", self.runs, self.costs, self.events),
                ("held out", self.held_out_runs, self.held_out_costs, self.held_out_events),
            )
            for cubes, runs, cost, events in ((n, k, costs[n], each[n]) for n, k in many.items() if k)
        ]
        return (
            f"{text_table(('tank', 'for', 'runs', 'joins expected', 'CPU (min)'), rows)}\n\n"
            f"half-width of all joins together {figure(self.width, '.1%')}\n{self.cost}"
        )

    @property
    def held_out_events(self) -> dict[int, float]:
        """Joins expected in a held-out run, by number of cubes."""
        return {test.cubes: test.power.expected for test in self.tests}


def make_growth_plan(request: PlanRequest, join: float, cost: Cost) -> PlannedGrowth:
    """Plan a study of growth from seeds, whose joins network-free runs under a guessed rate foretell.

    join : one rate constant for every class of joins, 1/tu

    A tank holds twice the cubes that its seeds can take up. Times along the path are not used: growth is watched from
    its beginning, because the structures in between are too many to be put into tanks.
    ValueError: a budget that does not pay for the least plan.
    """
    scene = Scene.load(request.scene)
    book, derivation = book_of(scene.rules)
    target = len(derivation.structures) if book.target is None else len(book.target)
    compositions = {n: with_seeds(derivation, n, target) for n in (*request.cubes, *request.held_out)}
    check_starts([RunSpec(scene, start, request.duration, request.seed, 0) for start in compositions.values()])

    def joins(cubes: int, duration: float, factor: float = 1.0) -> float:
        """Mean number of joins in a run."""
        start = {derivation.structures[name]: n for name, n in compositions[cubes].items()}
        grown = grow(book, ClassRates.uniform(factor * join), start, duration, GROWTHS, request.seed)
        if grown.interrupted:  # fewer runs make no plan
            raise KeyboardInterrupt
        return float(np.mean([run.times.size for run in grown.runs]))

    def seconds(cubes: int, duration: float) -> float:
        return cost(RunSpec(scene, compositions[cubes], duration, request.seed, 0))

    sizes, held = dict.fromkeys(request.cubes), dict.fromkeys(request.held_out)
    events = {n: joins(n, request.duration) for n in sizes}
    costs = {n: seconds(n, request.duration) for n in sizes}
    held_costs = {n: seconds(n, request.held_out_duration) for n in held}
    table, prices = np.array([[events[n]] for n in sizes]), np.array(list(costs.values()))
    if not table.any():
        raise ValueError(f"no join is expected within {request.duration:g} tu; make the runs longer by --duration")
    found = allocate(table, prices, events_for(request.width))
    wanted = float(found @ prices)
    budget = math.inf if request.cpu_hours is None else 3600 * request.cpu_hours
    least = FEWEST * sum(held_costs.values())
    if wanted > budget - least:
        found = affordable(table, prices, budget - least)
        if not found.any():
            raise ValueError(
                f"{request.cpu_hours:g} CPU hours are not enough for a run of growth and {FEWEST} held-out runs of "
                f"each "
                f"size, {(least + float(prices.min())) / 3600:.3g} hours; give more --cpu-hours, or take fewer --cubes "
                "or --held-out"
            )
    runs = dict(zip(sizes, found.tolist(), strict=True))
    seen = sum(k * events[n] for n, k in runs.items())
    tests = []
    for n in held:
        shifted = tuple((f, joins(n, request.held_out_duration, f)) for f in (1 - request.shift, 1 + request.shift))
        power = GroupPower("joins", joins(n, request.held_out_duration), (seen + 0.5) ** -0.5, shifted)
        tests.append(HeldOutTest(n, power, runs_for(power, request.power), power.power(math.inf)))
    chosen = chosen_runs(tests, held_costs, budget - spent(runs, costs))
    return PlannedGrowth(request, compositions, events, runs, costs, wanted, tuple(tests), chosen, held_costs)


def with_seeds(derivation: Derivation, cubes: int, target: int) -> dict[str, int]:
    """Single cubes and as many seeds as leave `SPARE` cubes for each place of their targets, at least one."""
    seeds = max(1, cubes // (SPARE * target))
    free, seed = (species_of(derivation, cube) for cube in (derivation.book.monomer(), derivation.book.seed()))
    return {str(free): cubes - seeds, str(seed): seeds}
