"""Predicted cost of a study, from a short timed trial of each point that also measures the cubes' speed."""

from __future__ import annotations

import math
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from kinetics.support.tables import text_table
from mechsim.inspection.speeds import mean_speed, whole_holds
from mechsim.runs.record import RunSpec, book_of
from mechsim.runs.store import RunStore
from mechsim.studies.study import Study, StudyPoint

WARM_UP = 0.5  # tu; cubes start at rest, and drag brings them to the fluid's pace within 0.02
TRIAL = 5.0  # tu
BATCHES = 10  # of the trial, for the standard error of its mean


@dataclass(frozen=True)
class PointTrial:
    """A point tried for 5 tu.

    speed, speed_error : mean speed of free cubes over the phase of the agitation's hold, with its standard error,
        length / tu; nan where none stayed free
    cpu_per_tu, cpu_start : CPU seconds of this machine a tu, and to build the tank
    """

    speed: float
    speed_error: float
    cpu_per_tu: float
    cpu_start: float


def trial(point: StudyPoint, seed: int) -> PointTrial:
    """Try a point. The speeds depend on the seed alone, the times on the machine."""
    return timed(point.specs(WARM_UP + TRIAL, 1, seed)[0])


def timed(spec: RunSpec) -> PointTrial:
    """Try the first 5 tu of a run, after a short warm-up, whatever its length."""
    from mechsim.world.world import World

    book, _ = book_of(spec.scene.rules)
    began = time.process_time()
    with World(spec.scene, book, spec.n_cubes, spec.streams) as world:
        world.populate(spec.start)
        ready = time.process_time()
        for _ in range(math.ceil(WARM_UP / world.step_size)):
            world.step()
        steps = BATCHES * whole_holds(spec.scene, TRIAL / BATCHES)
        speeds, cpu = np.full(steps, np.nan), np.zeros(steps)
        for step in range(steps):
            before = time.process_time()
            world.step()
            cpu[step] = time.process_time() - before
            bodies = world.bodies
            free = [slot for slot in bodies.live if len(bodies.members[slot]) == 1]
            if free:
                speeds[step] = mean_speed(bodies, free)
    batches = [part[~np.isnan(part)] for part in np.array_split(speeds, BATCHES)]
    means = np.array([part.mean() for part in batches if part.size])
    error = float(means.std(ddof=1) / math.sqrt(means.size)) if means.size > 1 else math.nan
    speed = float(means.mean()) if means.size else math.nan
    # The median of the batches: in one of them a kernel may have been compiled.
    per_step = float(np.median([part.mean() for part in np.array_split(cpu, BATCHES)]))
    return PointTrial(speed, error, per_step / world.step_size, ready - began)


@dataclass(frozen=True)
class PointCost:
    """Cost of one point. missing : runs not in the store; expected : first time, tu; cpu, most : seconds for them"""

    point: StudyPoint
    missing: int
    expected: float
    cpu: float
    most: float


@dataclass(frozen=True)
class CostPrediction:
    """Runs still to be made, and their cost; `most` is the cost if every run goes to the cap."""

    points: tuple[PointCost, ...]

    @property
    def missing(self) -> int:
        """Runs to be made."""
        return sum(point.missing for point in self.points)

    @property
    def cpu(self) -> float:
        """CPU seconds expected."""
        return sum(point.cpu for point in self.points)

    @property
    def most(self) -> float:
        """CPU seconds at most."""
        return sum(point.most for point in self.points)

    def __str__(self) -> str:
        titles = ("point", "runs to make", "expected (tu)", "CPU (s)", "at most (s)")
        rows = [
            (p.point.title, str(p.missing), f"{p.expected:.3g}", f"{p.cpu:.0f}", f"{p.most:.0f}") for p in self.points
        ]
        total = f"{self.missing} runs to make: about {duration(self.cpu)} of CPU time, at most {duration(self.most)}"
        return f"{text_table(titles, rows)}\n{total}"


def predict(
    study: Study,
    points: Sequence[StudyPoint],
    trials: Mapping[StudyPoint, PointTrial],
    runs: int,
    seed: int,
    store: RunStore,
) -> CostPrediction:
    """The cost of the runs that the store lacks.

    A first time is guessed as `typical` times the ratio of collision rates, N edge^2 speed / volume: good within a
    factor of about two, which is all that a decision to start needs.
    """
    base = StudyPoint((), "base", study.base, study.cubes)
    known = {(p.scene.fingerprint, p.cubes): t.speed for p, t in trials.items()}
    reference = _pace(base, known.get((base.scene.fingerprint, base.cubes)) or trial(base, seed).speed)
    found = []
    for point in points:
        missing = sum(not store.path(spec).exists() for spec in point.specs(study.cap, runs, seed))
        pace = _pace(point, trials[point].speed)
        expected = min(study.typical * reference / pace, study.cap) if pace > 0 and reference > 0 else study.cap
        each = trials[point]
        cpu, most = (each.cpu_start + tu * each.cpu_per_tu for tu in (expected, study.cap))
        found.append(PointCost(point, missing, expected, missing * cpu, missing * most))
    return CostPrediction(tuple(found))


def duration(seconds: float) -> str:
    """For people: 45 s, 12 min, 3.4 h."""
    if seconds < 90:
        return f"{seconds:.0f} s"
    return f"{seconds / 60:.0f} min" if seconds < 90 * 60 else f"{seconds / 3600:.1f} h"


def _pace(point: StudyPoint, speed: float) -> float:
    """Collision rate of one cube up to a factor; 0 where the speed is not known."""
    pace = point.cubes * point.scene.cubes.edge**2 * speed / math.prod(point.scene.tank.size)
    return 0.0 if math.isnan(pace) else pace
