"""Engines from the same state, step by step: what each makes of the same contacts.

    python -m tests.results.engine_shadow    # makes results/engines/shadow.csv; ten seconds of CPU time

PyBullet moves the crowded tank of `engine_trials`. In every step our own engine gets the poses and motions that
PyBullet gets, and makes the same step from them, once with its memory of contact points and once without; only what
PyBullet makes of it goes on. Pairs of bodies that push each other are sorted by whether they overlap, which is
measured by neither engine, and whether PyBullet had them pushing in the step before.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import ExitStack

import numpy as np
import pandas as pd

from mechsim.accuracy.trial import unbreakable
from mechsim.inspection.speeds import whole_holds
from mechsim.kernels.contact import cubes_overlap
from mechsim.runs.record import book_of
from mechsim.world.world import World
from tests.results.engine_runs import FOLDER
from tests.results.engine_trials import FORGETFUL, TANKS, forget

LENGTH, SEED = 30.0, 5  # tu
BEGUN, GOING_ON, APART = "overlaps that begin", "overlaps that go on", "no overlap"
ENGINES = ("pybullet", "own", FORGETFUL)
Pair = tuple[int, int]


def populated(engine: str) -> World:
    """The crowded tank by an engine."""
    tank = TANKS["crowded"]
    scene = unbreakable(tank.scene(engine))
    book, derivation = book_of(scene.rules)
    start = [derivation.structures[name] for name, n in tank.composition.items() for _ in range(n)]
    world = World(scene, book, sum(map(len, start)), np.random.SeedSequence(SEED))
    world.populate(start)
    return world


def pushes(world: World) -> dict[Pair, np.ndarray]:
    """Impulse between each two bodies (-1: a wall) in the last step, on the second."""
    total: dict[Pair, np.ndarray] = {}
    for touch in world.engine.touches():
        pair = (min(touch.a, touch.b), max(touch.a, touch.b))
        sign = -1.0 if touch.a == pair[0] else 1.0
        total[pair] = total.get(pair, np.zeros(3)) + sign * np.array(touch.impulse)
    return total


def overlap(world: World, pair: Pair, centre: np.ndarray, axes: np.ndarray) -> bool:
    """Do two bodies overlap, or a body (the second) and a wall, whose cubes lie there?"""
    edge, members = world.bodies.edge, world.bodies.members
    if pair[0] < 0:
        cubes = list(members[pair[1]])
        return bool((np.abs(centre[cubes]) + np.abs(axes[cubes]).sum(axis=2) * edge / 2 > world.half).any())
    return any(
        cubes_overlap(centre[i], axes[i], centre[j], axes[j], edge / 2, edge / 2)
        for i in members[pair[0]]
        for j in members[pair[1]]
    )


def steps(length: float) -> Iterator[tuple[World, tuple[np.ndarray, np.ndarray], list[dict[Pair, np.ndarray]]]]:
    """Of each step: PyBullet's world, where its cubes were, and what was pushed by each of ENGINES."""
    with ExitStack() as stack:
        first, *others = (
            stack.enter_context(populated("own" if engine == FORGETFUL else engine)) for engine in ENGINES
        )
        at = [name for name, _ in first.parts].index("motions into the engine")
        after = [name for name, _ in others[0].parts].index("motions into the engine")
        for _ in range(whole_holds(first.scene, length)):
            for _, part in first.parts[:at]:
                part()
            for other in others:
                for name in ("position", "orientation", "velocity", "spin"):
                    np.copyto(getattr(other.bodies, name), getattr(first.bodies, name))
            forget(others[ENGINES.index(FORGETFUL) - 1])
            place = first.bodies.centre.copy(), first.bodies.axes.copy()
            for _, part in first.parts[at:]:
                part()
            for other in others:
                for _, part in other.parts[after:]:
                    part()
            yield first, place, [pushes(world) for world in (first, *others)]


def compare(length: float) -> pd.DataFrame:
    """By kind of contact, a tu: pairs that PyBullet or our own engine lets push each other, the sum of their impulses
    by each engine, and that of the differences between the first two."""
    found = {kind: np.zeros(2 + len(ENGINES)) for kind in (BEGUN, GOING_ON, APART)}
    pushed: set[Pair] = set()
    time, nothing = 0.0, np.zeros(3)
    for first, place, by in steps(length):
        for pair in by[0].keys() | by[1].keys():
            kind = APART if not overlap(first, pair, *place) else GOING_ON if pair in pushed else BEGUN
            impulses = [one.get(pair, nothing) for one in by]
            found[kind] += (1, *map(np.linalg.norm, impulses), np.linalg.norm(impulses[1] - impulses[0]))
        pushed = set(by[0])
        time += first.step_size
    rows = [(kind, *(values / time)) for kind, values in found.items()]
    return pd.DataFrame(rows, columns=["contact", "pairs", *ENGINES, "difference"])


def main() -> None:
    """Write the table."""
    compare(LENGTH).to_csv(FOLDER / "shadow.csv", index=False, float_format="%.5g")


if __name__ == "__main__":
    main()
