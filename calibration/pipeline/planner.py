"""From a scene and pilot rates to the plan of a study: tanks, runs, held-out runs, and what they will show."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import asdict, dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from calibration.estimating.joins_and_breaks import joins_and_breaks
from calibration.pipeline.plan import PlannedRuns, StudyPlan, Tanks, VerdictRules, in_tank
from calibration.pipeline.run_costs import Cost
from calibration.planning.allocation import affordable, allocate, events_for, half_width
from calibration.planning.candidates import Candidate, candidates, wanted_rates
from calibration.planning.forecast import Forecast
from calibration.planning.held_out import MOST_RUNS, group_powers, runs_for, widest_sd
from calibration.validating.power import GroupPower
from kinetics.network import Tank
from kinetics.rates import Rates
from kinetics.support.arrays import Floats, Ints
from mechsim.runs.preflight import check_starts
from mechsim.runs.record import RunSpec, book_of
from mechsim.runs.species import single_cubes, some_of
from mechsim.scene import Scene

if TYPE_CHECKING:
    from matplotlib.axes import Axes

FEWEST = 2  # held-out runs of a size: a scatter needs two


@dataclass(frozen=True)
class PlanRequest:
    """What a plan is to reach.

    width : relative 95 % half-width of every rate; cpu_hours : of all runs together, None: as many as it takes
    cubes : numbers of cubes of the calibration; along : times on the predicted path at which tanks are taken, tu
    duration, held_out_duration : of a run, tu; held_out : numbers of cubes of the held-out runs
    each_break : whether each break is to have that width, not only all breaks together
    power, shift : probability with which held-out runs are to show rates that are off by this share, at level 1 %
    tank : edges; None for the scene's own
    """

    name: str
    scene: str
    cubes: tuple[int, ...] = (60, 120)
    held_out: tuple[int, ...] = (40, 80, 160)
    width: float = 0.1
    cpu_hours: float | None = None
    along: tuple[float, ...] = (0.0, 50.0, 200.0, 800.0, 2000.0)
    duration: float = 500.0
    held_out_duration: float = 2000.0
    each_break: bool = False
    power: float = 0.9
    shift: float = 0.2
    tank: tuple[float, float, float] | None = None
    seed: int = 1

    def __post_init__(self) -> None:
        for name in ("width", "power", "shift"):
            if not 0 < getattr(self, name) < 1:
                raise ValueError(f"{name} = {getattr(self, name)}; expected a share between 0 and 1, such as 10%")
        for name in ("duration", "held_out_duration"):
            if not (math.isfinite(getattr(self, name)) and getattr(self, name) > 0):
                raise ValueError(f"{name} = {getattr(self, name)}; expected a finite number of tu above 0")
        if self.cpu_hours is not None and not (math.isfinite(self.cpu_hours) and self.cpu_hours > 0):
            raise ValueError(f"CPU hours = {self.cpu_hours}; expected a finite number above 0")
        if not self.cubes or not self.held_out or min(*self.cubes, *self.held_out) < 1:
            raise ValueError(f"cubes = {list(self.cubes)}, held out = {list(self.held_out)}; expected numbers above 0")
        if not self.along or min(self.along) < 0 or not np.isfinite(self.along).all():
            raise ValueError(f"along = {list(self.along)}; expected finite times of at least 0 tu")


@dataclass(frozen=True)
class HeldOutTest:
    """What held-out runs of one size can tell of one group of channels.

    needed : runs that reach the power; None where `held_out.MOST_RUNS` do not
    limit : power that no number of runs exceeds, because the calibration leaves its uncertainty
    """

    cubes: int
    power: GroupPower
    needed: int | None
    limit: float

    def to_dict(self, runs: int) -> dict[str, Any]:
        """With so many runs planned, ready for JSON."""
        return {
            "cubes": self.cubes,
            "group": self.power.group,
            "events_of_a_run": self.power.expected,
            "relative_sd_from_calibration": self.power.rates_sd,
            "runs_needed": self.needed,
            "runs": runs,
            "power": self.power.power(runs),
            "largest_power": self.limit,
        }


@dataclass(frozen=True, eq=False)
class PlannedStudy:
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

    @property
    def held_out_seconds(self) -> float:
        """CPU seconds of all held-out runs."""
        return spent(self.held_out_runs, self.held_out_costs)

    @property
    def shortfalls(self) -> list[str]:
        """What was asked for and is not reached, in sentences."""
        wanted, found = self.request, []
        if self.width > wanted.width * (1 + 1e-6):
            found.append(
                f"the budget of {wanted.cpu_hours:g} CPU hours reaches a half-width of {self.width:.1%}; "
                f"{wanted.width:.1%} would cost {self.wanted_seconds / 3600:.3g} hours of calibration runs"
            )
        return found + held_out_shortfalls(wanted, self.tests, self.held_out_runs, self.held_out_costs, self.width)

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

    def plot(self, ax: Axes) -> Axes:
        """Shares of the tanks in the events of each channel, and in the CPU time; returns `ax`."""
        from calibration import plots

        rows = self.tank_rows()
        shares = {name: [row["events"][name] for row in rows] for name in self.forecast.network.channels}
        names = [" ".join(f"{n} {name}" for name, n in row["composition"].items()) for row in rows]
        labels = [f"{row['runs']} x {name}" for row, name in zip(rows, names, strict=True)]
        return plots.planned_shares(ax, labels, shares | {"CPU minutes": [row["cpu_seconds"] / 60 for row in rows]})

    def to_dict(self) -> dict[str, Any]:
        """All of it, ready for JSON."""
        rates = [{"rate": name, "events": n, "half_width": float(half_width(n))} for name, n in self.events.items()]
        return {
            "request": asdict(self.request),
            "tanks": self.tank_rows(),
            "rates": rates,
            "half_width": self.width,
            "held_out": [test.to_dict(self.held_out_runs[test.cubes]) for test in self.tests],
            "calibration_cpu_seconds": self.calibration_seconds,
            "held_out_cpu_seconds": self.held_out_seconds,
            "wanted_calibration_cpu_seconds": self.wanted_seconds,
            "shortfalls": self.shortfalls,
        }


def make_plan(request: PlanRequest, rates: Rates, cost: Cost) -> PlannedStudy:
    """Plan a study on the path that pilot rates predict.

    cost : CPU seconds of a run; it need only be right in proportion for the shares of the tanks

    ValueError: a request that cannot be met at all.
    """
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
    runs = allocate(table, costs, events_for(request.width))
    wanted_seconds = float(runs @ costs)
    budget = math.inf if request.cpu_hours is None else 3600 * request.cpu_hours
    rest = budget - FEWEST * sum(sized.values())
    if wanted_seconds > rest:
        runs = affordable(table, costs, rest)
        if not runs.any():
            least = FEWEST * sum(sized.values()) + float(allocate(table, costs, 1e-6) @ costs)
            raise ValueError(
                f"{request.cpu_hours:g} CPU hours do not pay for a run that shows each rate and {FEWEST} held-out runs "
                f"of each size, {least / 3600:.3g} hours; give more --cpu-hours, or take fewer --cubes or --held-out"
            )
    seen = runs @ np.array([tank.events for tank in tanks])
    tests = held_out_tests(request, forecast, seen, sized)
    chosen = chosen_runs(tests, sized, budget - float(runs @ costs))
    return PlannedStudy(request, forecast, tuple(tanks), runs, costs, wanted_seconds, tests, chosen, sized)


def held_out_tests(
    request: PlanRequest, forecast: Forecast, events: Floats, sizes: Iterable[int]
) -> tuple[HeldOutTest, ...]:
    """What held-out runs of each size can tell after a calibration with these events (R,)."""
    derivation = book_of(Scene.load(request.scene).rules)[1]
    groups = joins_and_breaks(forecast.network)
    tests: list[HeldOutTest] = []
    for n in sizes:
        start = forecast.network.state(single_cubes(derivation, n))
        powers = group_powers(forecast, events, groups, start, request.held_out_duration, request.shift)
        tests += [HeldOutTest(n, power, runs_for(power, request.power), power.power(math.inf)) for power in powers]
    return tuple(tests)


def held_out_shortfalls(
    request: PlanRequest, tests: Iterable[HeldOutTest], runs: dict[int, int], costs: dict[int, float], width: float
) -> list[str]:
    """What so many held-out runs of each size do not show after a calibration to a half-width, in sentences."""
    found = []
    for test in tests:
        has = runs[test.cubes]
        what = f"{test.power.group} off by {request.shift:.0%} at {test.cubes} cubes"
        if test.limit < request.power:
            narrower = width * widest_sd(test.power, request.power) / test.power.rates_sd
            found.append(
                f"no number of held-out runs shows {what} with power {request.power:.0%}: the uncertainty of the "
                f"calibration allows {test.limit:.0%} at most; a width of {narrower:.1%} is needed"
            )
        elif test.needed is None:
            found.append(f"not even {MOST_RUNS} held-out runs show {what} with power {request.power:.0%}")
        elif has < test.needed:
            found.append(
                f"{test.needed} held-out runs would show {what}, for "
                f"{(test.needed - has) * costs[test.cubes] / 3600:.3g} CPU hours more; the plan has {has}, with power "
                f"{test.power.power(has):.0%}"
            )
    return found


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


def spent(runs: dict[int, int], costs: dict[int, float]) -> float:
    """CPU seconds of runs by number of cubes."""
    return sum(n * costs[cubes] for cubes, n in runs.items())


def rules_for(shift: float) -> VerdictRules:
    """Rules that rates off by a share break: seen / expected within three quarters of it, or half of it over all sizes.

    They count where the events' own scatter is smaller: two standard deviations of 6 / shift^2 events are 0.8 of it.
    """
    ratio, pooled = ((round(1 - part * shift, 4), round(1 + part * shift, 4)) for part in (0.75, 0.5))
    return VerdictRules(ratio=ratio, pooled_ratio=pooled, from_events=round(6 / shift**2, 1))
