"""CPU time of a mechanics step, and what each part of it takes; median of several stretches of one run.

    python -m tests.benchmarks.bench_mechanics

The reference, measured in the same run, is the engine alone: the same cubes under `stepSimulation` with nothing set or
read. Compiling (or loading compiled code) is measured apart. Aim: at most 230 us a step at
60 cubes with everything on and 490 us at 120, less than 500 MiB.
"""

from __future__ import annotations

import resource
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

import numpy as np
import pybullet

from kinetics.support.tables import text_table
from mechsim.inspection.cost_profile import cost_profile
from mechsim.runs.record import book_of
from mechsim.scene import Scene
from mechsim.world.world import World

STRETCH, STRETCHES = 2000, 7  # steps
STARTS = {
    "60 single": {"monomer": 60},
    "60 half built": {"monomer": 19, "dimer": 7, "trimer": 5, "quadmer": 3},
    "60 as quadmers": {"quadmer": 15},
    "80 single": {"monomer": 80},
    "120 single": {"monomer": 120},
}


@contextmanager
def tank(start: dict[str, int]) -> Iterator[World]:
    """A populated world of the shipped scene, compiled code loaded, past its first step."""
    scene = Scene.load("line4")
    book, derivation = book_of(scene.rules)
    structures = [derivation.structures[name] for name, n in start.items() for _ in range(n)]
    with World(scene, book, sum(len(s) for s in structures), np.random.SeedSequence(1)) as world:
        world.populate(structures)
        world.step()
        yield world


def cost(step: Callable[[], None], n: int = STRETCH) -> float:
    """Median CPU time of a call, us."""
    seen = []
    for _ in range(STRETCHES):
        begin = time.process_time()
        for _ in range(n):
            step()
        seen.append((time.process_time() - begin) / n * 1e6)
    return float(np.median(seen))


def parts(world: World) -> dict[str, float]:
    """Share of a step's CPU time in each part."""
    told = cost_profile(world, "")
    return {item.name: item.cost / told.whole for item in told.items}


def main() -> None:
    """Print the tables."""
    begin = time.process_time()
    with tank({"monomer": 2}):
        print(f"first step, compiling or loading compiled code: {time.process_time() - begin:.2f} s CPU\n")
    rows = []
    shares: dict[str, dict[str, float]] = {}
    for name, start in STARTS.items():
        with tank(start) as world:
            whole = cost(world.step)
            shares[name] = parts(world)
        with tank(start) as world:
            client = world.engine.client
            alone = cost(lambda client=client: pybullet.stepSimulation(client))
        per_tu = whole / Scene.load("line4").numerics.step * 1e-6
        rows.append(
            (
                name,
                f"{whole:.0f}",
                f"{alone:.0f}",
                f"{whole / alone:.1f}",
                f"{1e3 * per_tu:.0f}",
                f"{2000 * per_tu:.0f}",
            )
        )
    titles = ("cubes", "step (us)", "engine alone (us)", "ratio", "1 tu (ms)", "2,000 tu (s)")
    print(text_table(titles, rows))
    print("\nshare of a step")
    names = list(shares["60 single"])
    print(text_table(("part", *shares), [(n, *(f"{s[n]:.0%}" for s in shares.values())) for n in names]))
    print(f"\nlargest resident size: {resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024:.0f} MiB")


if __name__ == "__main__":
    main()
