"""CPU time of a mechanics step, and what each part of it takes; median of several stretches of one run.

    python -m tests.benchmarks.bench_mechanics

The reference, measured in the same run, is the engine alone: the same cubes under `stepSimulation` with nothing set or
read. "Near" is the engine that holds bodies near a contact alone; the three are timed in turns. Compiling (or loading
compiled code) is measured apart. Aim: at most 230 us a step at 60 cubes with everything on and 490 us at 120, 1.5 times
less with bodies near a contact alone, less than 500 MiB.
"""

from __future__ import annotations

import resource
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial

import numpy as np
import pybullet

from kinetics.support.tables import text_table
from mechsim.inspection.bill import bill
from mechsim.runs.record import book_of
from mechsim.scene import Scene
from mechsim.world.engine import Engine
from mechsim.world.near_engine import NearEngine
from mechsim.world.world import World

STRETCH, STRETCHES = 200, 60  # steps
STARTS = {
    "60 single": {"monomer": 60},
    "60 half built": {"monomer": 19, "dimer": 7, "trimer": 5, "quadmer": 3},
    "60 as quadmers": {"quadmer": 15},
    "80 single": {"monomer": 80},
    "120 single": {"monomer": 120},
    "120 as quadmers": {"quadmer": 30},
    "240 single": {"monomer": 240},
}


@contextmanager
def tank(start: dict[str, int], engine: type[Engine] = Engine) -> Iterator[World]:
    """A populated world of the shipped scene, compiled code loaded, past its first step."""
    scene = Scene.load("line4")
    book, derivation = book_of(scene.rules)
    structures = [derivation.structures[name] for name, n in start.items() for _ in range(n)]
    with World(scene, book, sum(len(s) for s in structures), np.random.SeedSequence(1), engine) as world:
        world.populate(structures)
        world.step()
        yield world


def costs(*steps: Callable[[], object], n: int = STRETCH) -> list[float]:
    """Median CPU time of a call of each, us; made in turns, for the machine is not the same all the time."""
    seen = np.empty((STRETCHES, len(steps)))
    for row in seen:
        for k, step in enumerate(steps):
            begin = time.process_time()
            for _ in range(n):
                step()
            row[k] = (time.process_time() - begin) / n * 1e6
    return np.median(seen, axis=0).tolist()


def parts(world: World) -> dict[str, float]:
    """Share of a step's CPU time in each part."""
    told = bill(world, "")
    return {item.name: item.cost / told.whole for item in told.items}


def main() -> None:
    """Print the tables."""
    begin = time.process_time()
    with tank({"monomer": 2}):
        print(f"first step, compiling or loading compiled code: {time.process_time() - begin:.2f} s CPU\n")
    rows = []
    shares: dict[str, dict[str, float]] = {}
    for name, start in STARTS.items():
        with tank(start) as world, tank(start, NearEngine) as near, tank(start) as still:
            engine_alone = partial(pybullet.stepSimulation, still.engine.client)
            whole, fewer, alone = costs(world.step, near.step, engine_alone)
            shares[name] = parts(world)
        per_tu = whole / Scene.load("line4").numerics.step * 1e-6
        rows.append(
            (
                name,
                f"{whole:.0f}",
                f"{fewer:.0f}",
                f"{whole / fewer:.2f}",
                f"{alone:.0f}",
                f"{whole / alone:.1f}",
                f"{1e3 * per_tu:.0f}",
                f"{2000 * per_tu:.0f}",
            )
        )
    titles = ("cubes", "step (us)", "near (us)", "less", "engine alone (us)", "more", "1 tu (ms)", "2,000 tu (s)")
    print(text_table(titles, rows))
    print("\nshare of a step")
    names = list(shares["60 single"])
    print(text_table(("part", *shares), [(n, *(f"{s[n]:.0%}" for s in shares.values())) for n in names]))
    print(f"\nlargest resident size: {resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024:.0f} MiB")


if __name__ == "__main__":
    main()
