"""CPU time of a whole mechanics step through each engine, in turns, and what each part of it takes.

    python -m tests.benchmarks.bench_engines

The same tanks of line4 with everything on, one world an engine; stretches of steps alternate between them, so that both
see the same machine. Aim: by the own engine at most a third, with single cubes and in an assembled tank of 120; by
PyBullet with the bodies near a contact alone 1.5 times less, at 60 and 120 single cubes.
"""

from __future__ import annotations

import time
from contextlib import ExitStack

import numpy as np

from kinetics.support.tables import text_table
from mechsim.runs.record import book_of
from mechsim.scene import Scene
from mechsim.world.engines import ENGINES
from mechsim.world.world import World
from tests.results.engine_trials import by_engine

STRETCH, STRETCHES, WARM_UP = 300, 15, 300  # steps
STARTS = {
    "60 single": {"monomer": 60},
    "120 single": {"monomer": 120},
    "240 single": {"monomer": 240},
    # what 120 cubes have become after 200 tu
    "120 assembled": {"monomer": 9, "dimer": 16, "trimer": 9, "quadmer": 13},
    "30 lines of four": {"quadmer": 30},
}


def tank(engine: str, start: dict[str, int]) -> World:
    """A populated world of the shipped scene, past its first steps."""
    scene = by_engine(Scene.load("line4"), engine)
    book, derivation = book_of(scene.rules)
    structures = [derivation.structures[name] for name, n in start.items() for _ in range(n)]
    world = World(scene, book, sum(len(s) for s in structures), np.random.SeedSequence(1))
    world.populate(structures)
    for _ in range(WARM_UP):
        world.step()
    return world


def costs(worlds: dict[str, World]) -> dict[str, float]:
    """Median CPU time of a step of each, us."""
    seen: dict[str, list[float]] = {name: [] for name in worlds}
    for _ in range(STRETCHES):
        for name, world in worlds.items():
            begin = time.process_time()
            for _ in range(STRETCH):
                world.step()
            seen[name].append((time.process_time() - begin) / STRETCH * 1e6)
    return {name: float(np.median(values)) for name, values in seen.items()}


def parts(world: World) -> dict[str, float]:
    """CPU time of each part of a step, us: means over a thousand steps, the slowest twentieth left out, in which others
    had the core."""
    seen: list[list[int]] = [[] for _ in world.parts]
    for _ in range(1000):
        for taken, (_, part) in zip(seen, world.parts, strict=True):
            begin = time.perf_counter_ns()
            part()
            taken.append(time.perf_counter_ns() - begin)
    found: dict[str, float] = {}
    for taken, (name, _) in zip(seen, world.parts, strict=True):
        found[name] = found.get(name, 0.0) + float(np.mean(sorted(taken)[:950])) / 1e3
    return found


def main() -> None:
    """Print the tables."""
    names = [entry.name for entry in ENGINES]
    rows, shares = [], {}
    for title, start in STARTS.items():
        with ExitStack() as stack:
            worlds = {name: stack.enter_context(tank(name, start)) for name in names}
            cost = costs(worlds)
            for name, world in worlds.items():
                shares[f"{title}, {name}"] = parts(world)
        first = cost[names[0]]
        rows.append((title, *(f"{cost[n]:.0f}" for n in names), *(f"{first / cost[n]:.2f}" for n in names[1:])))
    print(text_table(("tank", *(f"{n} (us)" for n in names), *(f"{names[0]} / {n}" for n in names[1:])), rows))
    print("\nof a step, us")
    which = dict.fromkeys(part for share in shares.values() for part in share)
    print(text_table(("tank", *which), [(t, *(f"{share[p]:.1f}" for p in which)) for t, share in shares.items()]))


if __name__ == "__main__":
    main()
