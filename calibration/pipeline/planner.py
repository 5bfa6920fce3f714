"""From a scene and pilot rates to the plan of a study: tanks, runs, held-out runs, and what they will show."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from calibration import plots
from calibration.estimating.joins_and_breaks import joins_and_breaks
from calibration.pipeline.plan import PlannedRuns, StudyPlan, Tanks, VerdictRules, in_tank
from calibration.pipeline.planned import HeldOutTest, Planned, PlanRequest, spent
from calibration.pipeline.run_costs import Cost
from calibration.planning.allocation import affordable, allocate, events_for, half_width
from calibration.planning.candidates import Candidate, candidates, wanted_rates
from calibration.planning.forecast import Forecast
from calibration.planning.held_out import MOST_RUNS, group_powers, runs_for
from kinetics.network import Tank
from kinetics.rates import Rates
from kinetics.support.arrays import Floats, Ints
from kinetics.support.cli.progress import stage
from kinetics.support.shown import on_axes
from kinetics.support.tables import figure, text_table
from mechsim.runs.preflight import check_starts
from mechsim.runs.record import RunSpec, book_of
from mechsim.runs.species import single_cubes, some_of
from mechsim.scene import Scene

if TYPE_CHECKING:
    from matplotlib.axes import Axes

FEWEST = 2  # held-out runs of a size: a scatter needs two


@dataclass(frozen=True, eq=False)
class PlannedStudy(Planned):
    """A plan, and what it will show at which cost.

    tanks, runs, costs : candidate tanks, runs of each (K,), and CPU seconds of a run of each (K,)
    held_out_runs, held_out_costs : by number of cubes
    """

    request: PlanRequest
    forecast: Forecast
    tanks: tuple[Candidate, ...]
    runs: Ints
    costs: Floats
    wanted_seconds: float
    tests: tuple[HeldOutTest, ...]
    held_out_runs: dict[int, int]
    held_out_costs: dict[int, float]

    @cached_property
    def events(self) -> dict[str, float]:
        """Events expected in the calibration of each thing to be measured."""
        total = self.runs @ np.array([tank.events for tank in self.tanks])
        wanted = wanted_rates(self.forecast.network, self.request.each_break)
        return {name: float(total[members].sum()) for name, members in wanted.items()}

    @property
    def width(self) -> float:
        """The largest half-width expected."""
        return float(max(half_width(list(self.events.values()))))

    @property
    def calibration_seconds(self) -> float:
        """CPU seconds of all calibration runs."""
        return float(self.runs @ self.costs)

    @cached_property
    def plan(self) -> StudyPlan:
        """The plan itself."""
        request = self.request
        planned = [
            Tanks(
                composition=tank.composition,
                tank=request.tank,
                runs=int(runs),
                duration=request.duration,
                along=tank.along,
            )
            for tank, runs in zip(self.tanks, self.runs, strict=True)
            if runs
        ]
        derivation = book_of(Scene.load(request.scene).rules)[1]
        held_out = [
            Tanks(
                composition=single_cubes(derivation, cubes),
                tank=request.tank,
                runs=runs,
                duration=request.held_out_duration,
            )
            for cubes, runs in self.held_out_runs.items()
        ]
        return StudyPlan(
            name=request.name,
            purpose=f"Half-widths of {self.width:.1%} or less for every join and "
            f"{'each break' if request.each_break else 'all breaks together'}, in tanks on the predicted path; "
            f"held-out runs that show rates off by {request.shift:.0%}.",
            scene=request.scene,
            calibration=PlannedRuns(seed=request.seed, tanks=tuple(planned)),
            held_out=PlannedRuns(seed=request.seed + 1, tanks=tuple(held_out)),
            verdict=rules_for(request.shift),
        )

    def tank_rows(self) -> list[dict[str, Any]]:
        """One row a tank of the plan: composition, runs, CPU seconds, and events expected in all of its runs."""
        return [
            {
                "composition": tank.composition,
                "along": tank.along,
                "runs": int(runs),
                "cpu_seconds": float(runs * cost),
                "events": dict(zip(self.forecast.network.channels, (runs * tank.events).tolist(), strict=True)),
            }
            for tank, runs, cost in zip(self.tanks, self.runs, self.costs, strict=True)
            if runs
        ]

    @on_axes
    def plot(self, ax: Axes) -> Axes:
        """Shares of the tanks in the events of each channel, and in the CPU time; returns `ax`."""
        rows = self.tank_rows()
        shares = {name: [row["events"][name] for row in rows] for name in self.forecast.network.channels}
        names = [" ".join(f"{n} {name}" for name, n in row["composition"].items()) for row in rows]
        labels = [f"{row['runs']} x {name}" for row, name in zip(rows, names, strict=True)]
        return plots.planned_shares(ax, labels, shares | {"CPU minutes": [row["cpu_seconds"] / 60 for row in rows]})

    def to_dict(self) -> dict[str, Any]:
        """The plan as a dictionary, ready for JSON."""
        rates = [{"rate": name, "events": n, "half_width": float(half_width(n))} for name, n in self.events.items()]
        return super().to_dict() | {"rates": rates}

    def tables(self) -> str:
        """The plan in three tables, for people."""
        found = self.to_dict()
        channels = self.forecast.network.channels
        tanks = text_table(
            ("tank", "at (tu)", "runs", *channels, "CPU (min)"),
            [
                (
                    " ".join(f"{n} {name}" for name, n in row["composition"].items()),
                    f"{row['along']:g}",
                    str(row["runs"]),
                    *(f"{row['events'][name]:.0f}" for name in channels),
                    f"{row['cpu_seconds'] / 60:.1f}",
                )
                for row in found["tanks"]
            ],
        )
        rates = text_table(
            ("rate", "events", "half-width"),
            [(row["rate"], f"{row['events']:.0f}", figure(row["half_width"], ".1%")) for row in found["rates"]],
        )
        tests = text_table(
            ("cubes", "rates", "events of a run", "from the calibration", "runs needed", "runs", "power", "at most"),
            [
                (
                    str(row["cubes"]),
                    row["group"],
                    f"{row['events_of_a_run']:.1f}",
                    f"± {row['relative_sd_from_calibration']:.1%}",
                    "-" if row["runs_needed"] is None else str(row["runs_needed"]),
                    str(row["runs"]),
                    f"{row['power']:.0%}",
                    f"{row['largest_power']:.0%}",
                )
                for row in found["held_out"]
            ],
        )
        return f"calibration, events expected\n{tanks}\n\n{rates}\n\nheld-out runs\n{tests}\n\n{self.cost}"


def make_plan(request: PlanRequest, rates: Rates, cost: Cost) -> PlannedStudy:
    """Plan a study on the path that pilot rates predict.

    cost : CPU seconds of a run; it need only be right in proportion for the shares of the tanks

    ValueError: a request that cannot be met at all.
    """
    needed = events_for(request.width)  # first, because it may be refused
    scene = in_tank(Scene.load(request.scene), request.tank)
    derivation = book_of(scene.rules)[1]
    network = derivation.network
    if derivation.book.seed() is not None:
        raise ValueError(
            f"book {scene.rules} grows from a seed: a tank holds one growing structure; simulate its growth"
        )
    starts = {n: single_cubes(derivation, n) for n in (*request.cubes, *request.held_out)}
    check_starts([RunSpec(scene, start, request.duration, request.seed, 0) for start in starts.values()])
    place = None if rates.tank is None and request.tank is None else Tank(scene.tank.size)
    forecast = Forecast.of(rates, network, place, seed=request.seed)
    sizes = [len(derivation.structures[name]) for name in network.species]
    first = [starts[n] for n in dict.fromkeys(request.cubes)]
    tanks = candidates(forecast, first, sizes, sorted(set(request.along)), request.duration)
    costs = np.array([cost(RunSpec(scene, tank.composition, request.duration, request.seed, 0)) for tank in tanks])
    wanted = wanted_rates(network, request.each_break)
    table = np.array([[tank.events[members].sum() for members in wanted.values()] for tank in tanks])
    never = [name for name, best in zip(wanted, table.max(axis=0), strict=True) if best <= 0]
    if never:
        raise ValueError(f"no tank on the path shows {some_of(never)}; take more --cubes, or later times --along")
    whole = {n: RunSpec(scene, starts[n], request.held_out_duration, request.seed, 0) for n in request.held_out}
    sized = {n: cost(spec) for n, spec in whole.items()}
    runs = allocate(table, costs, needed)
    wanted_seconds = float(runs @ costs)
    budget = math.inf if request.cpu_hours is None else 3600 * request.cpu_hours
    rest = budget - FEWEST * sum(sized.values())
    if wanted_seconds > rest:
        runs = affordable(table, costs, rest)
        if not runs.any():
            least = FEWEST * sum(sized.values()) + float(allocate(table, costs, 1e-6) @ costs)
            raise ValueError(
                f"{request.cpu_hours:g} CPU hours are not enough for a run that shows each rate and {FEWEST} "
                f"held-out runs "
                f"of each size, {least / 3600:.3g} hours; give more --cpu-hours, or take fewer --cubes or --held-out"
            )
    seen = runs @ np.array([tank.events for tank in tanks])
    tests = held_out_tests(request, forecast, seen, sized)
    chosen = chosen_runs(tests, sized, budget - float(runs @ costs))
    return PlannedStudy(request, forecast, tuple(tanks), runs, costs, wanted_seconds, tests, chosen, sized)


def held_out_tests(
    request: PlanRequest, forecast: Forecast, events: Floats, sizes: Iterable[int]
) -> tuple[HeldOutTest, ...]:
    """The power of held-out runs of each size after a calibration with these events (R,)."""
    derivation = book_of(Scene.load(request.scene).rules)[1]
    groups = joins_and_breaks(forecast.network)
    tests: list[HeldOutTest] = []
    for n in sizes:
        start = forecast.network.state(single_cubes(derivation, n))
        stage(f"power of held-out runs with {n} cubes")
        powers = group_powers(forecast, events, groups, start, request.held_out_duration, request.shift)
        tests += [HeldOutTest(n, power, runs_for(power, request.power), power.power(math.inf)) for power in powers]
    return tuple(tests)


def chosen_runs(tests: Sequence[HeldOutTest], costs: dict[int, float], budget: float) -> dict[int, int]:
    """Held-out runs of each number of cubes within a budget, CPU seconds: two at least, then the cheapest tests.

    What is left of a finite budget goes in equal shares to the sizes that still fall short.
    """
    chosen = dict.fromkeys(costs, FEWEST)
    possible = [(test.needed, test) for test in tests if test.needed is not None]
    for needed, test in sorted(possible, key=lambda item: item[0] * costs[item[1].cubes]):
        raised = chosen | {test.cubes: max(needed, chosen[test.cubes])}
        if spent(raised, costs) <= budget:
            chosen = raised
    most = {n: max(test.needed or MOST_RUNS for test in tests if test.cubes == n) for n in costs}
    while math.isfinite(budget):
        able = [n for n in costs if chosen[n] < most[n] and spent(chosen, costs) + costs[n] <= budget]
        if not able:
            break
        chosen[min(able, key=lambda n: chosen[n] * costs[n])] += 1
    return chosen


def rules_for(shift: float) -> VerdictRules:
    """Rules that rates off by a share break: seen / expected within three quarters of it, or half of it over all sizes.

    They count where the events' own scatter is smaller: two standard deviations of 6 / shift^2 events are 0.8 of it.
    """
    ratio, pooled = ((round(1 - part * shift, 4), round(1 + part * shift, 4)) for part in (0.75, 0.5))
    return VerdictRules(ratio=ratio, pooled_ratio=pooled, from_events=round(6 / shift**2, 1))
