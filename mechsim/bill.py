"""What a step of a scene costs, part by part, and what the engine has in force while it runs."""

from __future__ import annotations

import resource
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from kinetics.assembly import Structure
from kinetics.network import text_table
from mechsim.bodies import Bodies
from mechsim.engine import Engine
from mechsim.record import RunSpec, book_of
from mechsim.world import World

WARM_UP = 200  # steps: code compiled or loaded, caches filled, cubes moving
# Steps at a time, with clocks and without in random order, so that both see the same bodies, the same machine, and as
# often the steps that redraw the fluid or read back all bodies.
BLOCK = 7
BLOCKS = 600
TRIES = 20  # blocks for one that no other process has broken into

Parts = Sequence[tuple[str, Callable[[], object]]]


@dataclass(frozen=True)
class Item:
    """CPU time of one part of a step, us, and its standard error. kind : "effect", "engine" or "bookkeeping"."""

    name: str
    kind: str
    cost: float
    error: float


@dataclass(frozen=True)
class Bill:
    """What a step costs.

    items : the effects in the scene's order, the engine, the bookkeeping; in us a step
    whole, whole_error : of a step without clocks in it, and its standard error, us; the items and `rest` add up to it
    rest, rest_error : what no part accounts for, and its standard error, us: the loop over the parts, and chance
    in_force : settings of the engine, damping measured
    """

    title: str
    steps: int
    items: tuple[Item, ...]
    whole: float
    whole_error: float
    rest: float
    rest_error: float
    in_force: dict[str, float]

    def as_dict(self) -> dict[str, Any]:
        """For programs."""
        return {
            "scene": self.title,
            "steps": self.steps,
            "unit": "us of CPU time a step",
            "items": [
                {"name": i.name, "kind": i.kind, "cost": i.cost, "error": i.error, "share": i.cost / self.whole}
                for i in self.items
            ],
            "rest": {"cost": self.rest, "error": self.rest_error},
            "whole": {"cost": self.whole, "error": self.whole_error},
            "engine": self.in_force,
        }

    def __str__(self) -> str:
        rows = [(item.name, item.kind, item.cost, item.error) for item in self.items]
        rows += [("between the parts", "", self.rest, self.rest_error), ("a step", "", self.whole, self.whole_error)]
        table = text_table(
            ("part", "what it is", "CPU (us)", "+-", "share"),
            [(name, kind, f"{cost:.1f}", f"{e:.1f}", f"{cost / self.whole:.0%}") for name, kind, cost, e in rows],
        )
        force = "\n".join(f"  {name.replace('_', ' ')}: {value:g}" for name, value in sorted(self.in_force.items()))
        title = f"{self.title}, a step (+- one standard error, {self.steps} steps)"
        return f"{title}\n{table}\nin force in the engine\n{force}"


def bill_of(spec: RunSpec) -> Bill:
    """The bill of a run's first steps; see `bill`."""
    book, _ = book_of(spec.scene.rules)
    with World(spec.scene, book, spec.n_cubes, spec.streams) as world:
        world.populate(spec.start)
        what = ", ".join(f"{n} {name}" for name, n in spec.composition.items() if n)
        return bill(world, f"{spec.scene.name}, {what}")


def bill(
    world: World,
    title: str,
    blocks: int = BLOCKS,
    warm_up: int = WARM_UP,
    clock: Callable[[], int] = time.perf_counter_ns,
) -> Bill:
    """Measure what each part of a populated world's step costs; the world moves on by these steps.

    clock : ns. What a look at it takes is measured, too, and taken off. It shows the wall's time, for a look at the
        CPU's slows down what comes after it; blocks in which another process had the core are left out, so that both
        are the same.
    An effect without a hook acts inside the engine and has no cost of its own; one that is not listed has no line.
    RuntimeError: the machine is too busy for even a few steps without a break.
    """
    for _ in range(warm_up):
        world.step()
    look = _look(clock)
    plain: list[float] = []
    parted: list[np.ndarray] = []
    order = np.random.default_rng(0)
    for _ in range(blocks * TRIES):
        with_clocks, breaks = bool(order.integers(2)), _breaks()
        if with_clocks:
            stamps = [_stamps(world.parts, clock) for _ in range(BLOCK)]
        else:
            begin = clock()
            for _ in range(BLOCK):
                world.step()
            spent = clock() - begin - look
        if _breaks() != breaks:
            continue
        if with_clocks:
            parted.append(np.diff(stamps).sum(axis=0) - BLOCK * look)
        else:
            plain.append(spent)
        if len(plain) + len(parted) >= blocks and min(len(plain), len(parted)) > blocks // 4:
            break
    else:
        raise RuntimeError(
            f"other processes broke into most of {TRIES * blocks} times {BLOCK} steps: try when it is calm"
        )
    each = np.array(parted) / BLOCK / 1e3
    whole, error = _mean(np.array(plain) / BLOCK / 1e3)
    parts, parts_error = _mean(each.sum(axis=1))
    rest = whole - parts, float(np.hypot(error, parts_error))
    force = world.engine.in_force() | _damping(world)
    return Bill(title, BLOCK * (len(plain) + len(parted)), tuple(_items(world, each)), whole, error, *rest, force)


def _items(world: World, parted: np.ndarray) -> Sequence[Item]:
    """One item an effect, both its hooks together, then the engine and the bookkeeping in the order of the step."""
    names = [name for name, _ in world.parts]
    effects = [effect.effect for effect in world.scene.effects]
    items = []
    for name in (*effects, *(n for n in dict.fromkeys(names) if n not in effects)):
        kind = "effect" if name in effects else "engine" if name == "engine" else "bookkeeping"
        own = parted[:, [n == name for n in names]].sum(axis=1)
        if name in effects and name not in names:
            kind = "effect, in the engine"
        items.append(Item(name, kind, *_mean(own)))
    return items


def _mean(values: np.ndarray) -> tuple[float, float]:
    """Mean and its standard error."""
    return float(values.mean()), float(values.std(ddof=1) / np.sqrt(len(values)))


def _breaks() -> int:
    """How often this process has lost the core so far."""
    use = resource.getrusage(resource.RUSAGE_SELF)
    return use.ru_nivcsw + use.ru_nvcsw


def _stamps(parts: Parts, clock: Callable[[], int]) -> list[int]:
    """One step with a look at the clock before and after each part; their times."""
    stamps = [clock()]
    for _, part in parts:
        part()
        stamps.append(clock())
    return stamps


def _look(clock: Callable[[], int]) -> float:
    """What it takes to look at the clock after a part, ns: the median over many parts that do nothing."""
    nothing: Parts = [("", int)] * 20
    looks, calls = [], []
    for _ in range(200):
        stamps = _stamps(nothing, clock)
        begin = clock()
        for _, part in nothing:
            part()
        calls.append(clock() - begin)
        looks.append(stamps[-1] - stamps[0])
    return float(np.median(looks) - np.median(calls)) / (len(nothing) - 1)  # the calls were timed by one look


def _damping(world: World) -> dict[str, float]:
    """Share of speed and of spin that a free cube loses in a step: the engine's damping cannot be read back."""
    bodies = Bodies(1, world.bodies.edge, world.bodies.cube_mass)
    cube: Structure = world.book.monomer()
    bodies.fill(0, cube, (0,))
    bodies.index()
    engine = Engine(bodies, world.step_size, world.scene.numerics.solver_iterations)
    try:
        engine.create(0)
        bodies.velocity[0] = bodies.spin[0] = [1.0, 0.0, 0.0]
        engine.put(0)
        engine.step()
        engine.read([0])
    finally:
        engine.close()
    return {"linear_damping": 1 - bodies.velocity[0, 0], "angular_damping": 1 - bodies.spin[0, 0]}
