"""Two engines from the same state, step by step: what each makes of the same contacts.

    python -m tests.results.engine_shadow    # makes results/engines/shadow.csv; ten seconds of CPU time

PyBullet moves the crowded tank of `engine_trials`. In every step our own engine gets the poses and motions that
PyBullet gets, and makes the same step from them; only what PyBullet makes of it goes on. Pairs of bodies that touch are
sorted by whether PyBullet had them touching in the step before, and whether our own engine sees them touch at all.
"""

from __future__ import annotations

import numpy as np
import pandas as pd

from mechsim.accuracy.trial import unbreakable
from mechsim.inspection.speeds import whole_holds
from mechsim.runs.record import book_of
from mechsim.world.world import World
from tests.results.engine_runs import FOLDER
from tests.results.engine_trials import TANKS

LENGTH, SEED = 30.0, 5  # tu
BEGUN, GOING_ON, REMEMBERED = "contacts that begin", "contacts that go on", "points without an overlap"
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


def pushes(world: World) -> dict[Pair, float]:
    """Impulse between each two bodies (-1: a wall) in the last step."""
    total: dict[Pair, np.ndarray] = {}
    for touch in world.engine.touches():
        pair = (min(touch.a, touch.b), max(touch.a, touch.b))
        sign = 1.0 if touch.a == pair[0] else -1.0
        total[pair] = total.get(pair, np.zeros(3)) + sign * np.array(touch.impulse)
    return {pair: float(np.linalg.norm(impulse)) for pair, impulse in total.items()}


def compare(length: float) -> pd.DataFrame:
    """By kind of contact: pairs that touch, a tu, and the sum of their impulses by each engine, a tu."""
    found = {kind: np.zeros(3) for kind in (BEGUN, GOING_ON, REMEMBERED)}
    touched: set[Pair] = set()
    with populated("pybullet") as first, populated("own") as other:
        at = [name for name, _ in first.parts].index("motions into the engine")
        after = [name for name, _ in other.parts].index("motions into the engine")
        steps = whole_holds(first.scene, length)
        for _ in range(steps):
            for _, part in first.parts[:at]:
                part()
            for name in ("position", "orientation", "velocity", "spin"):
                np.copyto(getattr(other.bodies, name), getattr(first.bodies, name))
            for _, part in first.parts[at:]:
                part()
            for _, part in other.parts[after:]:
                part()
            one, two = pushes(first), pushes(other)
            for pair in one.keys() | two.keys():
                kind = REMEMBERED if pair not in two else GOING_ON if pair in touched else BEGUN
                found[kind] += (1, one.get(pair, 0.0), two.get(pair, 0.0))
            touched = set(one)
        time = steps * first.step_size
    rows = [(kind, *(values / time)) for kind, values in found.items()]
    return pd.DataFrame(rows, columns=["contact", "pairs", "pybullet", "own"])


def main() -> None:
    """Write the table."""
    compare(LENGTH).to_csv(FOLDER / "shadow.csv", index=False, float_format="%.5g")


if __name__ == "__main__":
    main()
