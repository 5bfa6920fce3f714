"""Meetings that are missed between two looks, with and without following the cubes from one to the next.

    python -m tests.benchmarks.bench_looks [--duration 40] [--seed 1]

A meeting that begins and ends between two looks is not seen by a look at poses alone. The first table is of one motion
of line4's cubes at the scene's own step, looked at after every step, as bonding does: what is missed is told against
following in sixteen times finer looks. The second is of one motion at an eighth of that step, and its rows differ in
how often one looks; compared with following through every fine step, it shows what a straight line over a longer time
leaves out of a path that bends and bounces in it. Within a step of a run no path does. All rows of a table are of one
motion; in a run a longer step changes the motion, too, which is another error.
"""

from __future__ import annotations

from dataclasses import dataclass

import click
import numpy as np

from kinetics.assembly import RuleBook
from mechsim.accuracy.changes import change_of
from mechsim.accuracy.quantities import counter
from mechsim.accuracy.trial import WARM_UP, unbound, with_numerics
from mechsim.effects.faces import FINEST
from mechsim.scene import Scene
from mechsim.world.world import World

CUBES = 120
FINER = 8  # steps of the fine motion in one of the scene
BLOCK = 2.5  # tu


@dataclass(frozen=True)
class Way:
    """A way to look: every so many steps, at poses alone or following the cubes."""

    every: int
    in_passing: bool
    finest: float = FINEST


@click.command()
@click.option("--duration", type=click.FloatRange(min=3 * BLOCK), default=40.0, show_default=True, help="tu")
@click.option("--seed", type=int, default=1, show_default=True)
def main(duration: float, seed: int) -> None:
    """Print both tables."""
    scene = Scene.load("line4")
    step = scene.numerics.step
    click.echo(f"a motion at the scene's step, {step:g} tu")
    show(scene, [Way(1, True, FINEST / 16), Way(1, False), Way(1, True)], duration, seed)
    click.echo(f"a motion at {step / FINER:g} tu")
    ways = [Way(every, in_passing) for every in (1, 2, 4, 8, 16) for in_passing in (False, True)]
    show(with_numerics(scene, step=step / FINER), [Way(1, True), *ways], duration, seed)


def show(scene: Scene, ways: list[Way], duration: float, seed: int) -> None:
    """Count the meetings of one motion in all these ways and print each against the first."""
    book, step = RuleBook.load(scene.rules), scene.numerics.step
    seen: list[list[int]] = []
    with World(unbound(scene), book, CUBES, np.random.SeedSequence(seed)) as world:
        counts = [counter(scene, world, way.in_passing, way.finest) for way in ways]
        totals = [0] * len(ways)
        world.populate([book.monomer()] * CUBES)
        while world.time < WARM_UP + duration:
            for _ in range(round((BLOCK if seen else WARM_UP) / step)):
                world.step()
                for k, (way, count) in enumerate(zip(ways, counts, strict=True)):
                    if world.step_count % way.every == 0:
                        totals[k] = count()
            seen.append(list(totals))
    blocks = np.diff(seen, axis=0).T
    click.echo(f"  {blocks[0].sum()} meetings in {blocks.shape[1] * BLOCK:g} tu, seed {seed}; by a look")
    for way, counted in zip(ways[1:], blocks[1:], strict=True):
        change = change_of(counted, blocks[0])
        how = "following" if way.in_passing else "poses alone"
        error = f"{100 * change.value:+6.2f} ± {100 * change.half_width:.2f} %"
        click.echo(f"  every {way.every * step:9.6f} tu, {how:<11}: {error}")


if __name__ == "__main__":
    main()
