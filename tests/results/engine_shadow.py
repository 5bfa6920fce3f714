"""Engines from the same state, step by step: what each makes of the same contacts.

    python -m tests.results.engine_shadow    # makes results/engines/shadow*.csv; a minute and a half of CPU time

PyBullet moves the crowded tank of `engine_trials`. In every step our own engine gets the poses and motions that
PyBullet gets, and makes the same step from them, once with its memory of contact points and once without; only what
PyBullet makes of it goes on. Pairs of bodies that push each other are sorted by whether they overlap, which is
measured by neither engine, and whether PyBullet had them pushing in the step before. Hits are those of one step, too.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import ExitStack
from typing import NamedTuple

import numpy as np
import pandas as pd

from mechsim.accuracy.trial import unbreakable
from mechsim.effects.hits import Hit
from mechsim.inspection.speeds import whole_holds
from mechsim.kernels.contact import cubes_overlap
from mechsim.runs.record import book_of
from mechsim.world.world import World
from tests.results.engine_runs import FOLDER
from tests.results.engine_trials import FORGETFUL, TANKS, forget

LENGTH, SEED = 200.0, 5  # tu
SHARES = (0.25, 0.5)  # of the load that breaks
BEGUN, GOING_ON, APART = "overlaps that begin", "overlaps that go on", "no overlap"
ENGINES = ("pybullet", "own", FORGETFUL)
Pair = tuple[int, int]


def populated(engine: str) -> World:
    """The crowded tank by an engine, in which hits are told from the lowest of SHARES on."""
    tank = TANKS["crowded"]
    scene = tank.scene("own" if engine == FORGETFUL else engine)
    scene = unbreakable(scene).changed("breaking", log_above=min(SHARES) * scene.effect("breaking").threshold)
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


class Step(NamedTuple):
    """Of a step: where PyBullet's cubes were before (centres and axes), what was pushed, and the loads of bodies that
    were hit, by slot, by each of ENGINES."""

    world: World
    place: tuple[np.ndarray, np.ndarray]
    pushed: list[dict[Pair, np.ndarray]]
    loads: list[dict[int, float]]


def steps(length: float) -> Iterator[Step]:
    """PyBullet's steps, and beside each what our own engine makes of the same state."""
    with ExitStack() as stack:
        first, *others = worlds = [stack.enter_context(populated(engine)) for engine in ENGINES]
        hits: list[list[Hit]] = [[] for _ in worlds]
        for world, seen in zip(worlds, hits, strict=True):
            world.hit_listeners.append(seen.append)
        at = [name for name, _ in first.parts].index("motions into the engine")
        after = [name for name, _ in others[0].parts].index("motions into the engine")
        for _ in range(whole_holds(first.scene, length)):
            for _, part in first.parts[:at]:
                part()
            for other in others:
                for name in ("position", "orientation", "velocity", "spin"):
                    np.copyto(getattr(other.bodies, name), getattr(first.bodies, name))
            forget(worlds[ENGINES.index(FORGETFUL)])
            place = first.bodies.centre.copy(), first.bodies.axes.copy()
            for _, part in first.parts[at:]:
                part()
            for other in others:
                for _, part in other.parts[after:]:
                    part()
            loads = [{hit.slot: hit.load for hit in seen} for seen in hits]
            for seen in hits:
                seen.clear()
            yield Step(first, place, [pushes(world) for world in worlds], loads)


def compare(length: float) -> tuple[pd.DataFrame, pd.DataFrame]:
    """What the engines make of the same states.

    By kind of contact, a tu: pairs that PyBullet or our own engine lets push each other, the sum of their impulses by
    each engine, and that of the differences between the first two. By size and share of the load that breaks: hits
    above it by each engine, and those above it by one of the first two alone.
    """
    found = {kind: np.zeros(2 + len(ENGINES)) for kind in (BEGUN, GOING_ON, APART)}
    begun: set[Pair] = set()
    time, nothing = 0.0, np.zeros(3)
    tank = TANKS["crowded"]
    threshold = tank.scene("pybullet").effect("breaking").threshold  # that of the study, not the worlds', which is none
    hits = {(size, share): np.zeros(1 + len(ENGINES), int) for size in tank.sizes[1:] for share in SHARES}
    for step in steps(length):
        for pair in step.pushed[0].keys() | step.pushed[1].keys():
            kind = APART if not overlap(step.world, pair, *step.place) else GOING_ON if pair in begun else BEGUN
            impulses = [one.get(pair, nothing) for one in step.pushed]
            found[kind] += (1, *map(np.linalg.norm, impulses), np.linalg.norm(impulses[1] - impulses[0]))
        begun = set(step.pushed[0])
        time += step.world.step_size
        for slot in set().union(*step.loads):
            size = len(step.world.bodies.members[slot])
            for share in SHARES:
                above = [loads.get(slot, 0.0) > share * threshold for loads in step.loads]
                hits[size, share] += (*above, above[0] != above[1])
    kinds = [(kind, *(values / time)) for kind, values in found.items()]
    loads = [(*which, *values) for which, values in hits.items()]
    return (
        pd.DataFrame(kinds, columns=["contact", "pairs", *ENGINES, "difference"]),
        pd.DataFrame(loads, columns=["size", "share", *ENGINES, "one alone"]),
    )


def main() -> None:
    """Write the tables."""
    for name, table in zip(("shadow", "shadow_loads"), compare(LENGTH), strict=True):
        table.to_csv(FOLDER / f"{name}.csv", index=False, float_format="%.5g")


if __name__ == "__main__":
    main()
