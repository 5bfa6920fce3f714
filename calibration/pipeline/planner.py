"""From a scene and pilot rates to the plan of a study: tanks, runs, held-out runs, and what they will show."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from calibration.estimating.joins_and_breaks import joins_and_breaks
from calibration.pipeline.plan import VerdictRules, in_tank
from calibration.pipeline.planned import HeldOutTest, PlannedStudy, PlanRequest, spent
from calibration.pipeline.run_costs import Cost
from calibration.planning.allocation import affordable, allocate, events_for
from calibration.planning.candidates import Candidate, candidates, wanted_rates
from calibration.planning.forecast import Forecast
from calibration.planning.held_out import MOST_RUNS, group_powers, runs_for
from kinetics.network import Tank
from kinetics.rates import Rates
from kinetics.support.arrays import Floats
from kinetics.support.cli.progress import stage
from mechsim.runs.preflight import check_starts
from mechsim.runs.record import RunSpec, book_of
from mechsim.runs.species import single_cubes, some_of
from mechsim.scene import Scene
from mechsim.world.engines import ENGINES

FEWEST = 2  # held-out runs of a size: a scatter needs two
LEAST_GAIN = 1.2  # that another engine is worth a word; trials are off by a tenth


def make_plan(request: PlanRequest, rates: Rates, cost: Cost) -> PlannedStudy:
    """Plan a study on the path that pilot rates predict.

    cost : CPU seconds of a run; it need only be right in proportion for the shares of the tanks

    ValueError: a request that cannot be met at all.
    """
    events_for(request.width)  # first, because it may be refused
    scene = in_tank(Scene.load(request.scene), request.tank).by(request.engine)
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
    wanted = wanted_rates(network, request.each_break)
    table = np.array([[tank.events[members].sum() for members in wanted.values()] for tank in tanks])
    never = [name for name, best in zip(wanted, table.max(axis=0), strict=True) if best <= 0]
    if never:
        raise ValueError(f"no tank on the path shows {some_of(never)}; take more --cubes, or later times --along")
    return planned_study(
        request,
        scene,
        network.channels,
        wanted,
        tanks,
        starts,
        cost,
        lambda seen, sizes: held_out_tests(request, forecast, seen, sizes),
        f"Half-widths of {{width}} for every join and "
        f"{'each break' if request.each_break else 'all breaks together'}, in tanks on the predicted path; "
        f"held-out runs that show rates off by {request.shift:.0%}.",
        rules_for(request.shift),
    )


def planned_study(
    request: PlanRequest,
    scene: Scene,
    happening: Sequence[str],
    wanted: Mapping[str, NDArray[np.bool_]],
    tanks: Sequence[Candidate],
    starts: Mapping[int, dict[str, int]],
    cost: Cost,
    tests_of: Callable[[Floats, Iterable[int]], tuple[HeldOutTest, ...]],
    purpose: str,
    verdict: VerdictRules,
) -> PlannedStudy:
    """The runs of least cost that reach what is asked for, or what a budget pays for; see `PlannedStudy`.

    tests_of : what held-out runs of some sizes can tell after a calibration that saw so many events (R,)

    ValueError: a budget that does not pay for the least plan.
    """

    def seconds(start: dict[str, int], duration: float) -> float:
        return cost(RunSpec(scene, start, duration, request.seed, 0))

    needed = events_for(request.width)
    events = np.array([tank.events for tank in tanks])
    table = np.array([events[:, members].sum(axis=1) for members in wanted.values()]).T
    costs = np.array([seconds(tank.composition, request.duration) for tank in tanks])
    sized = {n: seconds(starts[n], request.held_out_duration) for n in request.held_out}
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
                f"held-out runs of each size, {least / 3600:.3g} hours; give more --cpu-hours, or take fewer "
                "--cubes or --held-out"
            )
    tests = tests_of(runs @ events, sized)
    most_expensive = tanks[int((runs * costs).argmax())].composition
    return PlannedStudy(
        request=request,
        happening=tuple(happening),
        wanted=wanted,
        tanks=tuple(tanks),
        runs=runs,
        costs=costs,
        starts=starts,
        purpose=purpose,
        wanted_seconds=wanted_seconds,
        tests=tests,
        held_out_runs=chosen_runs(tests, sized, budget - float(runs @ costs)),
        held_out_costs=sized,
        verdict=verdict,
        gains=gains_of_engines(RunSpec(scene, most_expensive, request.duration, request.seed, 0), cost),
    )


def gains_of_engines(spec: RunSpec, cost: Cost) -> dict[str, float]:
    """Other engines by which a run would be quicker, and how many times; none if the engine was chosen on purpose."""
    usual, *others = ENGINES
    if spec.scene.numerics.engine != usual.name:
        return {}
    stage(f"what the run would cost by another engine: {spec.title}")
    gains = {}
    for engine in others:
        with suppress(ValueError, ModuleNotFoundError):  # it lacks an effect, or a package is not installed
            gains[engine.name] = cost(spec) / cost(replace(spec, scene=spec.scene.by(engine.name)))
    return {name: gain for name, gain in gains.items() if gain > LEAST_GAIN}


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
