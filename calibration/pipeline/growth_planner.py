"""From a scene of seeds to the plan of a study by rate class: growth that calibrates, and growth that is held out.

Which classes the runs tell apart is not known beforehand, so the width is that of all joins together. In books that
`new` compiles for a seed bonds hold: no breaks are planned for.
"""

from __future__ import annotations

import math
from collections.abc import Iterable

import numpy as np

from calibration.pipeline.plan import VerdictRules
from calibration.pipeline.planned import HeldOutTest, PlannedStudy, PlanRequest
from calibration.pipeline.planner import planned_study
from calibration.pipeline.run_costs import Cost
from calibration.planning.candidates import Candidate
from calibration.planning.held_out import runs_for
from calibration.validating.power import GroupPower
from kinetics.assembly import Derivation
from kinetics.networkfree import grow
from kinetics.rates import ClassRates
from kinetics.support.arrays import Floats
from mechsim.runs.preflight import check_starts
from mechsim.runs.record import RunSpec, book_of
from mechsim.runs.species import species_of
from mechsim.scene import Scene

GROWTHS = 20  # network-free runs behind a mean number of events
SPARE = 2  # cubes in a tank for each that its seeds take up


def make_growth_plan(request: PlanRequest, join: float, cost: Cost) -> PlannedStudy:
    """Plan a study of growth from seeds, whose joins network-free runs under a guessed rate foretell.

    join : one rate constant for every class of joins, 1/tu

    A tank holds twice the cubes that its seeds can take up. Times along the path are not used: growth is watched from
    its beginning, because the structures in between are too many to be put into tanks.
    ValueError: a budget that does not pay for the least plan.
    """
    scene = Scene.load(request.scene).by(request.engine)
    book, derivation = book_of(scene.rules)
    target = len(derivation.structures) if book.target is None else len(book.target)
    starts = {n: with_seeds(derivation, n, target) for n in (*request.cubes, *request.held_out)}
    check_starts([RunSpec(scene, start, request.duration, request.seed, 0) for start in starts.values()])

    def joins(cubes: int, duration: float, factor: float = 1.0) -> float:
        """Mean number of joins in a run."""
        start = {derivation.structures[name]: n for name, n in starts[cubes].items()}
        grown = grow(book, ClassRates.uniform(factor * join), start, duration, GROWTHS, request.seed)
        if grown.interrupted:  # fewer runs make no plan
            raise KeyboardInterrupt
        return float(np.mean([run.times.size for run in grown.runs]))

    def tests_of(seen: Floats, sizes: Iterable[int]) -> tuple[HeldOutTest, ...]:
        found, duration = [], request.held_out_duration
        for n in sizes:
            shifted = tuple((f, joins(n, duration, f)) for f in (1 - request.shift, 1 + request.shift))
            power = GroupPower("joins", joins(n, duration), float(seen.sum() + 0.5) ** -0.5, shifted)
            found.append(HeldOutTest(n, power, runs_for(power, request.power), power.power(math.inf)))
        return tuple(found)

    tanks = [Candidate(starts[n], None, np.array([joins(n, request.duration)])) for n in dict.fromkeys(request.cubes)]
    if not any(tank.events.any() for tank in tanks):
        raise ValueError(f"no join is expected within {request.duration:g} tu; make the runs longer by --duration")
    return planned_study(
        request,
        scene,
        ("joins",),
        {"joins": np.array([True])},
        tanks,
        starts,
        cost,
        tests_of,
        f"Growth from seeds, by rate class: a half-width of {{width}} for all joins together; held-out growth that "
        f"shows joins off by {request.shift:.0%}. It holds if no check of `validate` is out of the ordinary at 1 %, "
        "Holm's correction included.",
        VerdictRules(),
    )


def with_seeds(derivation: Derivation, cubes: int, target: int) -> dict[str, int]:
    """Single cubes and as many seeds as leave `SPARE` cubes for each place of their targets, at least one."""
    seeds = max(1, cubes // (SPARE * target))
    free, seed = (species_of(derivation, cube) for cube in (derivation.book.monomer(), derivation.book.seed()))
    return {str(free): cubes - seeds, str(seed): seeds}
