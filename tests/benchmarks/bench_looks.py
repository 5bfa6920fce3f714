"""Encounters that are missed because contacts are looked for at steps alone: one fine motion of line4's cubes.

    python -m tests.benchmarks.bench_looks [--duration 40] [--seed 1]

An encounter that begins and ends between two looks is not seen. The motion is the same in every row, so that the rows
differ in how often one looks; in a run, a longer step changes the motion too.
"""

from __future__ import annotations

import click
import numpy as np

from kinetics.assembly import RuleBook
from mechsim.accuracy.diagram import change_of
from mechsim.accuracy.trial import WARM_UP, counter, unbound, with_numerics
from mechsim.scene import Scene
from mechsim.world.world import World

CUBES = 120
FINEST = 8  # steps of the motion in one of the scene
EVERY = (1, 2, 4, 8, 16)
BLOCK = 2.5  # tu


@click.command()
@click.option("--duration", type=click.FloatRange(min=3 * BLOCK), default=40.0, show_default=True, help="tu")
@click.option("--seed", type=int, default=1, show_default=True)
def main(duration: float, seed: int) -> None:
    """Print the table."""
    scene = Scene.load("line4")
    step = scene.numerics.step / FINEST
    fine = with_numerics(scene, step=step)
    book = RuleBook.load(scene.rules)
    seen: list[list[int]] = []
    with World(unbound(fine), book, CUBES, np.random.SeedSequence(seed)) as world:
        counts = {every: counter(fine, world) for every in EVERY}
        totals = dict.fromkeys(EVERY, 0)
        world.populate([book.monomer()] * CUBES)
        while world.time < WARM_UP + duration:
            for _ in range(round((BLOCK if seen else WARM_UP) / step)):
                world.step()
                for every, count in counts.items():
                    if count is not None and world.step_count % every == 0:
                        totals[every] = count()
            seen.append(list(totals.values()))
    blocks = np.diff(seen, axis=0)
    click.echo(f"{blocks[:, 0].sum()} meetings in {len(blocks) * BLOCK:g} tu, seed {seed}, by a look every {step:g} tu")
    for every, column in zip(EVERY[1:], blocks.T[1:], strict=True):
        change = change_of(column, blocks[:, 0])
        click.echo(f"every {every * step:10.6f} tu: {100 * change.value:+.1f} ± {100 * change.half_width:.1f} %")


if __name__ == "__main__":
    main()
