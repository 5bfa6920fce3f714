"""Trial runs without bonds, in which speeds are averaged and encounters of faces counted."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from kinetics.support.config import validated
from mechsim.effects.faces import FINEST, FacesWithinReach
from mechsim.runs.record import COMPLETED, PROGRESS_STEPS, RunRecord, RunSpec, book_of
from mechsim.scene import Scene

if TYPE_CHECKING:
    from mechsim.world.world import World

BLOCKS = 20  # of equal length a trial: their scatter gives the standard errors
WARM_UP = 1.0  # tu, many times the relaxation of a cube's speed


@dataclass(frozen=True)
class AccuracyTrial(RunSpec):
    """A run whose bonds are not made: meetings of faces within the reach of the scene's bonding are counted instead.

    `scene` is the whole scene; what makes or breaks bonds is left out of the tank. `duration` comes after the warm-up.
    """

    @property
    def inputs(self) -> dict[str, Any]:
        """What moves and what is looked for. Rules, and what becomes of bonds, are no part of it: scenes that differ
        in these alone share their trials, and a trial is named apart from a run of the same scene.
        """
        bonding = self.scene.effect("bonding")
        inputs = super().inputs | {
            "scene": unbound(self.scene).model_dump(mode="json", exclude={"name", "rules"}),
            "composition": {"monomer": self.n_cubes},
            "trial": {"blocks": BLOCKS, "warm_up": WARM_UP},
            "meetings": None if bonding is None else bonding.model_dump(mode="json"),
        }
        del inputs["rules"]
        return inputs


def unbound(scene: Scene) -> Scene:
    """The scene without what makes or breaks bonds."""
    return scene.without(*scene.openers("join"), *scene.openers("break"))


def with_numerics(scene: Scene, **numerics: float) -> Scene:
    """The scene with another step or number of solver iterations, validated anew: ValueError where it is refused."""
    data = scene.model_dump(mode="json")
    data["numerics"].update(numerics)
    return validated(Scene, data, f"scene {scene.name}")


def counter(scene: Scene, world: World, in_passing: bool = True, finest: float = FINEST) -> Callable[[], int] | None:
    """A count of the meetings so far, to be asked after every step; None where the scene has no bonding.

    in_passing, finest : meetings that begin and end between two calls count, too; see `FacesWithinReach`

    A meeting is what the latch `encounter` takes for one: two faces come within the bonding's reach after they were out
    of it for the refractory time. Any two faces count, whatever the rules: a free cube moves alike whichever way it is
    turned, so the rate of those that may bond is a fixed share of it, and more meetings mean less scatter.
    """
    bonding = scene.effect("bonding")
    if bonding is None:
        return None
    from mechsim.effects.latches import Encounter

    latch = bonding.latch if isinstance(bonding.latch, Encounter) else Encounter(probability=1.0)
    meetings = latch.attach(world, world.stream("bonding"))
    sideways = bonding.sideways * world.bodies.edge
    faces = FacesWithinReach(world, bonding.capture_distance, bonding.capture_angle, sideways, in_passing, finest)

    def count() -> int:
        for i, face, j, other in faces.within_reach().tolist():
            meetings((i, face, j, other))
        return meetings.begun

    return count


def execute_trial(spec: RunSpec, progress: Callable[[float], None] | None = None) -> RunRecord:
    """Carry out one trial. The record has no events; of every block it has `speed` (B,), the mean over cubes and steps,
    length / tu, and, where the scene has bonding, `meetings` (B,).

    Its cost `cpu_per_tu` is the median over the blocks (over the steps, where it was stopped in its first block); the
    search for meetings is in it (bonding does the same), the averaging of speeds is not. A trial stopped by the guard
    keeps the blocks that it finished.
    """
    from mechsim.world.world import Stopped, World

    book, _ = book_of(spec.scene.rules)
    step = spec.scene.numerics.step
    warm_up, length = math.ceil(WARM_UP / step - 1e-9), max(1, round(spec.duration / BLOCKS / step))
    speed, met = [], []
    cost: list[float] = []  # CPU s of every step
    outcome = COMPLETED
    began, wall = time.process_time(), time.perf_counter()
    with World(unbound(spec.scene), book, spec.n_cubes, spec.streams) as world:
        count = counter(spec.scene, world)
        world.populate(spec.start)

        def advance(steps: int) -> tuple[float, int]:
            """Mean speed of these steps, and meetings so far."""
            total, seen = 0.0, 0
            for _ in range(steps):
                begin = time.process_time()
                try:
                    world.step()
                    seen = count() if count is not None else 0
                finally:  # a step that is stopped has its cost, too
                    cost.append(time.process_time() - begin)
                velocity = world.bodies.velocity[world.bodies.live]
                total += float(np.sqrt(np.einsum("ij,ij->i", velocity, velocity)).mean())
                if progress is not None and world.step_count % PROGRESS_STEPS == 0:
                    progress(max(0.0, world.time - WARM_UP))
            return total / steps, seen

        try:
            _, before = advance(warm_up)
            for _ in range(BLOCKS):
                mean, seen = advance(length)
                speed.append(mean)
                met.append(seen - before)
                before = seen
        except Stopped as reason:
            outcome = f"stopped: {reason}"
        end, steps = world.time, world.step_count
    arrays = {"times": np.zeros(0), "channels": np.zeros(0, np.int64), "speed": np.array(speed)}
    if count is not None:
        arrays["meetings"] = np.array(met, np.int64)
    facts = {"end": end, "steps": steps, "block": length * step, "channels": []}
    seconds = time.process_time() - began
    blocks = np.array(cost[warm_up:][: len(speed) * length]).reshape(len(speed), length).mean(axis=1)
    # Stopped within its first block: the steps show no more than what one of them costs, once compiled code is loaded.
    per_tu = float(np.median(blocks if len(blocks) else cost)) / step
    return RunRecord(
        spec,
        outcome,
        arrays,
        facts,
        {"cpu_seconds": seconds, "wall_seconds": time.perf_counter() - wall, "cpu_per_tu": per_tu},
    )
