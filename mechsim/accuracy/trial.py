"""Trial runs in which nothing joins and nothing breaks: of single cubes, and of structures whose bonds are hit."""

from __future__ import annotations

import math
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from kinetics.assembly import Derivation
from kinetics.support.settings import validated
from mechsim.accuracy.quantities import QUANTITIES, TAIL, Quantity
from mechsim.effects.base import Stopped
from mechsim.inspection.speeds import whole_holds
from mechsim.runs.record import COMPLETED, PROGRESS_STEPS, RunRecord, RunSpec, book_of
from mechsim.runs.species import single_cubes
from mechsim.scene import Scene
from mechsim.world.world import World

BLOCKS = 20  # of equal length a trial: their scatter gives the standard errors
WARM_UP = 1.0  # tu, many times the relaxation of a cube's speed
OUT_OF_REACH = sys.float_info.max  # a threshold that no load exceeds


@dataclass(frozen=True)
class AccuracyTrial(RunSpec):
    """A run whose bonds are neither made nor broken, from single cubes or from structures.

    Single cubes: speeds are averaged, and meetings of faces within the reach of the scene's bonding counted.
    Structures: hits on their bonds are logged. `scene` is the whole scene; `duration` comes after the warm-up, and is
    rounded so that a block is a whole number of holds of the fluid's velocity.
    """

    @property
    def has_structures(self) -> bool:
        """Does the tank hold bonds?"""
        return any(structure.bonds for structure in self.start)

    @property
    def in_tank(self) -> Scene:
        """The scene of the tank itself."""
        return unbreakable(self.scene) if self.has_structures else unbound(self.scene)

    @property
    def measured(self) -> tuple[Quantity, ...]:
        """The quantities that such a tank shows."""
        return tuple(q for q in QUANTITIES if q.of_structures == self.has_structures and q.is_of(self.scene))

    @property
    def inputs(self) -> dict[str, Any]:
        """The inputs that decide a trial: motion and what is measured. Bonds are no part of it, and with single cubes
        neither are the rules: scenes that differ in these alone share their trials. A trial's name differs from that of
        a run of the same scene.
        """
        inputs = super().inputs | {
            "scene": self.in_tank.as_dict(without={"name", "rules"}),
            "trial": {"blocks": BLOCKS, "of": "whole holds", "warm_up": WARM_UP},
        }
        if self.has_structures:
            return inputs
        bonding = self.scene.effect("bonding")
        del inputs["rules"]
        return inputs | {
            "composition": {"monomer": self.n_cubes},
            "meetings": None if bonding is None else bonding.as_dict(),
        }


def compositions(scene: Scene, cubes: int) -> tuple[dict[str, int], ...]:
    """Compositions of the tanks of trials: single cubes, and if bonds break also a mixture of all structures."""
    derivation = book_of(scene.rules)[1]
    found = [single_cubes(derivation, cubes)]
    if any(quantity.of_structures and quantity.is_of(scene) for quantity in QUANTITIES):
        mixed = mixture(derivation, cubes)
        if any(derivation.structures[name].bonds for name in mixed):
            found.append(mixed)
    return tuple(found)


def mixture(derivation: Derivation, cubes: int) -> dict[str, int]:
    """Every species in equal numbers as far as so many cubes go: dealt out in turns, from the largest to the smallest,
    passing over those for which too few cubes are left."""
    sizes = {name: len(structure) for name, structure in derivation.structures.items()}
    counts, left = dict.fromkeys(sizes, 0), cubes
    order = sorted(sizes, key=lambda name: -sizes[name])
    while left >= sizes[order[-1]]:
        for name in order:
            if sizes[name] <= left:
                counts[name] += 1
                left -= sizes[name]
    return {name: n for name, n in counts.items() if n}


def unbound(scene: Scene) -> Scene:
    """The scene without what makes or breaks bonds."""
    return scene.without(*scene.openers("join"), *scene.openers("break"))


def unbreakable(scene: Scene) -> Scene:
    """The scene without what makes bonds, with bonds that no hit breaks; hits above a share of its threshold are
    logged."""
    breaking = scene.effect("breaking")
    assert breaking is not None  # noqa: S101 - without it no trial has structures
    alone = scene.without(*scene.openers("join"))
    return alone.changed("breaking", threshold=OUT_OF_REACH, log_above=TAIL * breaking.threshold)


def with_numerics(scene: Scene, **numerics: float) -> Scene:
    """The scene with another step or number of solver iterations, validated anew: ValueError where it is refused."""
    data = scene.as_dict()
    data["numerics"].update(numerics)
    return validated(Scene, data, f"scene {scene.name}")


def execute_trial(spec: RunSpec, progress: Callable[[float], None] | None = None) -> RunRecord:
    """Carry out one trial. The record has no events; of every block it has, by the name of each quantity (B,), the
    count, or the mean over the steps.

    Its cost `cpu_per_tu` is the median over the blocks (over the steps, where it was stopped in its first block); the
    search for meetings is in it (bonding does the same), the averaging of speeds is not. A trial stopped by the guard
    keeps the blocks that it finished.
    """
    assert isinstance(spec, AccuracyTrial)  # noqa: S101 - run_all hands back what it was given
    book, _ = book_of(spec.scene.rules)
    step = spec.scene.numerics.step
    warm_up, length = math.ceil(WARM_UP / step - 1e-9), whole_holds(spec.scene, spec.duration / BLOCKS)
    totals: list[list[float]] = []  # of every quantity, after the warm-up and after each block
    cost: list[float] = []  # CPU s of every step
    outcome = COMPLETED
    began, wall = time.process_time(), time.perf_counter()
    with World(spec.in_tank, book, spec.n_cubes, spec.streams) as world:
        meters = [(quantity, quantity.attach(spec.scene, world)) for quantity in spec.measured]
        world.populate(spec.start)
        try:
            for steps in (warm_up, *[length] * BLOCKS):
                for _ in range(steps):
                    begin = time.process_time()
                    try:
                        world.step()
                        for quantity, meter in meters:
                            if quantity.is_in_runs:
                                meter.after_step()
                    finally:  # a step that is stopped has its cost, too
                        cost.append(time.process_time() - begin)
                    for quantity, meter in meters:
                        if not quantity.is_in_runs:
                            meter.after_step()
                    if progress is not None and world.step_count % PROGRESS_STEPS == 0:
                        progress(max(0.0, world.time - WARM_UP))
                totals.append([meter.total() for _, meter in meters])
        except Stopped as reason:
            outcome = f"stopped: {reason}"
        end, steps = world.time, world.step_count
    made = max(0, len(totals) - 1)
    arrays = {"times": np.zeros(0), "channels": np.zeros(0, np.int64)}
    gained = np.diff(np.array(totals, float).reshape(-1, len(meters)), axis=0).reshape(made, len(meters))
    for (quantity, _), column in zip(meters, gained.T, strict=True):
        arrays[quantity.name] = np.rint(column).astype(np.int64) if quantity.is_count else column / length
    facts = {"end": end, "steps": steps, "block": length * step, "channels": []}
    seconds = time.process_time() - began
    blocks = np.array(cost[warm_up:][: made * length]).reshape(made, length).mean(axis=1)
    # Stopped within its first block: the steps show no more than what one of them costs, once compiled code is loaded.
    per_tu = float(np.median(blocks if len(blocks) else cost)) / step
    return RunRecord(
        spec,
        outcome,
        arrays,
        facts,
        {"cpu_seconds": seconds, "wall_seconds": time.perf_counter() - wall, "cpu_per_tu": per_tu},
    )


def pilot(trial: AccuracyTrial, steps: int = 200) -> float:
    """CPU s of a step of this trial, from a short stretch. ValueError where the guard stops that."""
    book, _ = book_of(trial.scene.rules)
    with World(trial.in_tank, book, trial.n_cubes, trial.streams) as world:
        meters = [quantity.attach(trial.scene, world) for quantity in trial.measured]
        world.populate(trial.start)
        for step in range(steps + 20):
            if step == 20:  # compiled code is loaded by now
                begin = time.process_time()
            try:
                world.step()
            except Stopped as reason:
                raise ValueError(f"scene {trial.scene.name} was stopped in step {step + 1}: {reason}") from reason
            for meter in meters:
                meter.after_step()
        return (time.process_time() - begin) / steps
