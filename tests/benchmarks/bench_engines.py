"""CPU time of a whole mechanics step through each engine, in turns, and what each part of it takes.

    python -m tests.benchmarks.bench_engines
    git worktree add --detach FOLDER f501cb9  # release 0.1.0, which needs pydantic
    python -m tests.benchmarks.bench_engines --against FOLDER

The same tanks of line4 with everything on, one world an engine; stretches of steps alternate between them, so that both
see the same machine. Aim: by the own engine at most a third of what 0.1.0's step takes, with single cubes and in an
assembled tank of 120.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import time
from collections.abc import Callable
from contextlib import ExitStack
from functools import partial
from pathlib import Path

import numpy as np

import mechsim.scene
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


class Earlier:
    """The step of another tree, of release 0.1.0, in a child process; PyBullet was its only engine."""

    def __init__(self, folder: str):
        scene = Path(mechsim.scene.__file__).parent / "scenes" / "line4.toml"
        child = [sys.executable, str(Path(__file__).parent / "earlier_step.py"), folder, str(scene)]
        self.child = subprocess.Popen(child, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)

    def ask(self, what: object) -> float:
        """CPU time of a step, us, of a new tank or of so many steps."""
        assert self.child.stdin is not None
        assert self.child.stdout is not None
        self.child.stdin.write(json.dumps(what) + "\n")
        self.child.stdin.flush()
        return float(self.child.stdout.readline())


def of_world(world: World) -> float:
    """CPU time of a step, us, over a stretch."""
    begin = time.process_time()
    for _ in range(STRETCH):
        world.step()
    return (time.process_time() - begin) / STRETCH * 1e6


def costs(stretches: dict[str, Callable[[], float]]) -> dict[str, float]:
    """Median CPU time of a step of each, us."""
    seen: dict[str, list[float]] = {name: [] for name in stretches}
    for _ in range(STRETCHES):
        for name, stretch in stretches.items():
            seen[name].append(stretch())
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
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("--against", metavar="FOLDER", help="a tree of release 0.1.0, which is timed as well")
    folder = options.parse_args().against
    earlier = Earlier(folder) if folder else None
    engines = [entry.name for entry in ENGINES]
    names = (["0.1.0"] if earlier else []) + engines
    rows, shares = [], {}
    for title, start in STARTS.items():
        with ExitStack() as stack:
            worlds = {name: stack.enter_context(tank(name, start)) for name in engines}
            stretches = {name: partial(of_world, world) for name, world in worlds.items()}
            if earlier:
                earlier.ask(start)
                stretches["0.1.0"] = partial(earlier.ask, STRETCH)
            cost = costs(stretches)
            for name, world in worlds.items():
                shares[f"{title}, {name}"] = parts(world)
        ratios = [f"{cost[one] / cost[n]:.2f}" for one, n in ratios_of(names)]
        rows.append((title, *(f"{cost[n]:.0f}" for n in names), *ratios))
    print(text_table(("tank", *(f"{n} (us)" for n in names), *(f"{one} / {n}" for one, n in ratios_of(names))), rows))
    print("\nof a step, us")
    which = dict.fromkeys(part for share in shares.values() for part in share)
    print(text_table(("tank", *which), [(t, *(f"{share[p]:.1f}" for p in which)) for t, share in shares.items()]))


def ratios_of(names: list[str]) -> list[tuple[str, str]]:
    """Which two are compared: those before our own engine with it."""
    return [(one, "own") for one in names if one != "own"]


if __name__ == "__main__":
    main()
