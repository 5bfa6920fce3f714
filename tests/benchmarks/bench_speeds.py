"""Mean speeds of the cubes beside the paper's, and what they must not depend on: step, number of cubes.

All are means over the phase of the agitation's hold, within which the speed swings.

    python -m tests.benchmarks.bench_speeds

Accuracy beside its cost: the error of the speed at each step, and the CPU time of a simulated tu.
"""

from __future__ import annotations

import time

import numpy as np

from kinetics.support.tables import text_table
from mechsim.inspection.speeds import mean_speed as mean_of_bodies
from mechsim.inspection.speeds import whole_holds
from mechsim.runs.record import book_of
from mechsim.scene import Scene
from mechsim.world.world import World

PAPER = {3.0: 0.8, 3.5: 1.0, 4.0: 1.2, 4.5: 1.35, 5.0: 1.5}  # section V-A
STRETCHES = 20
FREE = Scene.load("line4").without("bonding", "breaking")


def mean_speed(scene: Scene, cubes: int, duration: float) -> tuple[float, float, float]:
    """Average of the mean speed over whole holds, its standard error (from 20 stretches), CPU ms a tu."""
    book = book_of(scene.rules)[0]
    seen = []
    with World(scene, book, cubes, np.random.SeedSequence(11)) as world:
        world.populate([book.monomer()] * cubes)
        while world.time < 1:
            world.step()
        begin = time.process_time()
        for _ in range(STRETCHES * whole_holds(scene, duration / STRETCHES)):
            world.step()
            seen.append(mean_of_bodies(world.bodies, world.bodies.live))
        spent = time.process_time() - begin
    stretches = np.reshape(seen, (STRETCHES, -1)).mean(axis=1)
    return float(np.mean(seen)), float(np.std(stretches, ddof=1) / STRETCHES**0.5), 1e3 * spent / duration


def with_step(scene: Scene, step: float) -> Scene:
    """The scene with another step."""
    return scene.replace(numerics=scene.numerics.replace(step=step))


def main() -> None:
    """Print the tables."""
    rows = []
    for points in ("sub-cubes", "sub-faces"):
        hold = 0.0105 if points == "sub-cubes" else 0.021
        scene = FREE.changed("drag", points=points).changed("agitation", hold=hold)
        for sigma, paper in PAPER.items():
            speed, error, spent = mean_speed(scene.changed("agitation", sigma=sigma), 60, 40)
            rows.append(
                (points, f"{hold:g}", f"{sigma:g}", f"{speed:.4f} ± {2 * error:.4f}", f"{paper:g}",
                 f"{speed / paper - 1:+.1%}", f"{spent:.0f}")
            )  # fmt: skip
    print(text_table(("drag points", "hold (tu)", "sigma", "speed (1/tu)", "paper", "error", "CPU (ms/tu)"), rows))

    print("\nstep at fixed hold 0.0105, sigma 4 (finest: reference)")
    steps = [0.0105 / n for n in (2, 4, 8)]
    found = [mean_speed(with_step(FREE, step), 60, 60) for step in steps]
    reference = found[-1][0]
    print(
        text_table(
            ("step (tu)", "speed (1/tu)", "against the finest", "CPU (ms/tu)"),
            [
                (f"{step:.6g}", f"{v:.4f} ± {2 * e:.4f}", f"{v / reference - 1:+.2%}", f"{spent:.0f}")
                for step, (v, e, spent) in zip(steps, found, strict=True)
            ],
        )
    )
    print("\nnumber of cubes, sigma 4")
    rows = []
    for n in (1, 20, 60, 120):
        speed, error, spent = mean_speed(FREE, n, 60 * 60 / n if n > 1 else 900)
        rows.append((str(n), f"{speed:.4f} ± {2 * error:.4f}", f"{spent:.0f}"))
    print(text_table(("cubes", "speed (1/tu)", "CPU (ms/tu)"), rows))


if __name__ == "__main__":
    main()
