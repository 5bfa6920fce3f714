"""What a log of hits adds to a mechanics step: CPU time with the log over that without, two tanks step by step alike.

    python -m tests.benchmarks.bench_load_log

The log changes nothing that happens, so both tanks stay equal to the last bit and are timed in turns, stretch by
stretch; the ratio is the geometric mean of pairs, with a 95 % interval. Aim: at most 2 % with .6 of the threshold.
"""

from __future__ import annotations

import time

import numpy as np
from scipy.stats import t as student

from mechsim.runs.record import book_of
from mechsim.scene import Scene
from mechsim.world.world import World

STRETCH, PAIRS = 400, 150  # steps
START = {"monomer": 6, "dimer": 9, "trimer": 12, "quadmer": 15}
SHARE = 0.6  # of the threshold, above which hits are logged


def tank(scene: Scene) -> World:
    """A tank of 120 cubes, compiled code loaded, past its first steps."""
    book, derivation = book_of(scene.rules)
    structures = [derivation.structures[name] for name, n in START.items() for _ in range(n)]
    world = World(scene, book, sum(map(len, structures)), np.random.SeedSequence(1))
    world.populate(structures)
    cost(world)
    return world


def cost(world: World) -> float:
    """CPU time of a step over a stretch, us."""
    begin = time.process_time()
    for _ in range(STRETCH):
        world.step()
    return (time.process_time() - begin) / STRETCH * 1e6


def main() -> None:
    """Print the ratio."""
    scene = Scene.load("line4")
    logged = scene.changed("breaking", log_above=SHARE * scene.effect("breaking").threshold)
    with tank(scene) as plain, tank(logged) as logging:
        turns = [(plain, logging), (logging, plain)]
        seen = [{id(world): cost(world) for world in turns[pair % 2]} for pair in range(PAIRS)]
        if not np.array_equal(plain.bodies.position, logging.bodies.position):
            raise AssertionError("the log changed the run")
        times = np.array([[row[id(plain)], row[id(logging)]] for row in seen])
    gap = np.log(times[:, 1] / times[:, 0])
    half = student.ppf(0.975, PAIRS - 1) * gap.std(ddof=1) / np.sqrt(PAIRS)
    print(f"a step: {np.median(times[:, 0]):.0f} us without a log, {np.median(times[:, 1]):.0f} us with it")
    print(f"with the log {np.expm1(gap.mean()):+.1%} ({np.expm1(gap.mean() - half):+.1%} to "
          f"{np.expm1(gap.mean() + half):+.1%}), median {np.expm1(np.median(gap)):+.1%}, of {PAIRS} pairs")  # fmt: skip


if __name__ == "__main__":
    main()
