"""Cost of a step of a scene, effect by effect, and the settings in force in the engine."""

from __future__ import annotations

import resource
import time
from collections.abc import Callable, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

from kinetics.assembly import Structure
from kinetics.support.tables import text_table
from mechsim.runs.record import RunSpec, book_of
from mechsim.scene import Scene
from mechsim.world.bodies import Bodies
from mechsim.world.world import World

WARM_UP = 200  # steps: code compiled or loaded, caches filled, cubes moving
# Steps at a time, with clocks and without in random order, so that both see the same bodies, the same machine, and as
# often the steps that redraw the fluid or read back all bodies.
BLOCK = 7
BLOCKS = 600
TRIES = 20  # blocks for one that no other process has broken into
# Where effects without a hook of their own cost something: bodies that touch what they add are read back, too.
INSIDE = ("engine", "reading back")

BY_PAIRS = "effect, by pairs"
PAIRS = (
    "by pairs: how much less the engine and reading back take in the same tank without it; "
    "subtracted from their lines\n\n"
)

Parts = Sequence[tuple[str, Callable[[], object]]]
Clock = Callable[[], int]


@dataclass(frozen=True)
class CostLine:
    """CPU time of one part of a step, us, and its standard error.

    kind : "effect", "effect, by pairs" (see `cost_profile`), "engine" or "bookkeeping"
    """

    name: str
    kind: str
    cost: float
    error: float


@dataclass(frozen=True)
class CostProfile:
    """Cost profile of a step.

    items : the effects in the scene's order, the engine, the bookkeeping; in us a step
    whole, whole_error : of a step without clocks in it, and its standard error, us; the items and `rest` add up to it
    rest, rest_error : what no part accounts for, and its standard error, us: the loop over the parts, and chance
    in_force : settings of the engine, damping measured
    """

    title: str
    steps: int
    items: tuple[CostLine, ...]
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
        pairs = "" if not any(item.kind == BY_PAIRS for item in self.items) else PAIRS
        return f"{title}\n{table}\n{pairs}in force in the engine\n{force}"


def profile_run(spec: RunSpec) -> CostProfile:
    """The cost profile of a run's first steps; see `cost_profile`."""
    book, _ = book_of(spec.scene.rules)
    with World(spec.scene, book, spec.n_cubes, spec.streams) as world:
        world.populate(spec.start)
        what = ", ".join(f"{n} {name}" for name, n in spec.composition.items() if n)
        return cost_profile(world, f"{spec.scene.name}, {what}")


def cost_profile(
    world: World,
    title: str,
    blocks: int = BLOCKS,
    warm_up: int = WARM_UP,
    clock: Clock = time.perf_counter_ns,
) -> CostProfile:
    """Measure what each part of a populated world's step costs; the world moves on by these steps.

    clock : ns. What a look at it takes is measured, too, and taken off. It shows the wall's time, for a look at the
        CPU's slows down what comes after it; blocks in which another process had the core are left out, so that both
        are the same.
    An effect without a hook (walls, contact) acts within the engine. It costs what the engine takes less without it:
    the difference between two worlds of their own, side by side, from which all that needs it is left out on both
    sides. It is taken off the lines of the engine and of reading back. An effect that is not listed has no line.
    RuntimeError: the machine is too busy for even a few steps without a break.
    """
    for _ in range(warm_up):
        world.step()
    look = _look(clock)

    def plain() -> float:
        begin = clock()
        for _ in range(BLOCK):
            world.step()
        return (clock() - begin - look) / BLOCK / 1e3

    whole, parted = _in_turns([plain, lambda: _parted(world.parts, clock, look)], blocks)
    inside = _inside(world, blocks, warm_up, clock, look)
    cost, error = _mean(whole)
    parts, parts_error = _mean(parted.sum(axis=1))
    rest = cost - parts, float(np.hypot(error, parts_error))
    force = world.engine.in_force() | _damping(world)
    steps = BLOCK * (len(whole) + len(parted))
    return CostProfile(title, steps, tuple(_items(world, parted, inside)), cost, error, *rest, force)


def _in_turns(measures: Sequence[Callable[[], Any]], blocks: int) -> list[np.ndarray]:
    """Make `blocks` measurements in random order, each kind often; leave out those that another process broke into."""
    order = np.random.default_rng(0)
    seen: list[list[Any]] = [[] for _ in measures]
    for _ in range(blocks * TRIES):
        which, breaks = int(order.integers(len(measures))), _breaks()
        found = measures[which]()
        if _breaks() == breaks:
            seen[which].append(found)
        if sum(map(len, seen)) >= blocks and min(map(len, seen)) > blocks // (2 * len(measures)):
            return [np.array(values) for values in seen]
    raise RuntimeError(
        f"other processes interrupted most of {TRIES * blocks} times {BLOCK} steps: try again on an idle machine"
    )


def _parted(parts: Parts, clock: Clock, look: float) -> np.ndarray:
    """CPU time of each part of a step, us; the mean of a block of steps."""
    stamps = [_stamps(parts, clock) for _ in range(BLOCK)]
    mean: np.ndarray = (np.diff(stamps).sum(axis=0) / BLOCK - look) / 1e3
    return mean


def _inside(world: World, blocks: int, warm_up: int, clock: Clock, look: float) -> dict[str, np.ndarray]:
    """Cost in the parts INSIDE of each effect that acts within the engine, with its standard error (2, I), us."""
    hooks = {name for name, _ in world.parts}
    hidden = [effect.effect for effect in world.scene.effects if effect.effect not in hooks]
    if not hidden:
        return {}
    dependent = {name for effect in hidden for name in _dependents(world.scene, effect)} - set(hidden)
    scenes = [world.scene.without(*dependent)]
    # The last one listed goes first; what needs it has gone already.
    for name in reversed(hidden):
        scenes.append(scenes[-1].without(name))
    with ExitStack() as stack:
        twins = [stack.enter_context(_twin(world, scene)) for scene in scenes]
        for twin in twins:
            twin.populate([world.bodies.held(slot) for slot in world.bodies.live])
            for _ in range(warm_up):
                twin.step()
        seen = _in_turns([partial(_parted, twin.parts, clock, look) for twin in twins], blocks)
    of = [[next(k for k, (name, _) in enumerate(twin.parts) if name == part) for part in INSIDE] for twin in twins]
    each = [np.array([_mean(values[:, k]) for k in columns]).T for values, columns in zip(seen, of, strict=True)]
    return {
        name: np.array([with_it[0] - without[0], np.hypot(with_it[1], without[1])])
        for name, with_it, without in zip(reversed(hidden), each, each[1:], strict=False)
    }


def _dependents(scene: Scene, name: str) -> set[str]:
    """Listed effects that need this one, and those that need them."""
    given = next({effect.effect, effect.provides} for effect in scene.effects if effect.effect == name)
    direct = {effect.effect for effect in scene.effects if given & set(effect.needs)}
    return direct.union(*(_dependents(scene, other) for other in direct))


def _twin(world: World, scene: Scene) -> World:
    """Another world of this scene, for as many cubes and by the same rules."""
    return World(scene, world.book, world.bodies.n_cubes, np.random.SeedSequence(0))


def _items(world: World, parted: np.ndarray, inside: dict[str, np.ndarray]) -> Sequence[CostLine]:
    """One item an effect, both its hooks together, then the engine and the bookkeeping in the order of the step."""
    names = [name for name, _ in world.parts]
    effects = [effect.effect for effect in world.scene.effects]
    taken = sum((cost for cost, _ in inside.values()), np.zeros(len(INSIDE)))
    items = []
    for name in (*effects, *(n for n in dict.fromkeys(names) if n not in effects)):
        kind = "effect" if name in effects else "engine" if name == "engine" else "bookkeeping"
        if name in inside:
            cost, errors = inside[name]
            items.append(CostLine(name, BY_PAIRS, float(cost.sum()), float(np.hypot(*errors))))
            continue
        cost, error = _mean(parted[:, [n == name for n in names]].sum(axis=1))
        if name in INSIDE:
            k = INSIDE.index(name)
            cost -= float(taken[k])
            error = float(np.sqrt(error**2 + sum(e[k] ** 2 for _, e in inside.values())))
        items.append(CostLine(name, kind, cost, error))
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
    """Time that a look at the clock after a part takes, ns: the median over many parts that do nothing."""
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
    engine = type(world.engine)(bodies, world.step_size, world.scene.numerics.solver_iterations)
    try:
        engine.create(0)
        bodies.velocity[0] = bodies.spin[0] = [1.0, 0.0, 0.0]
        engine.put(0)
        engine.step()
        engine.read([0])
    finally:
        engine.close()
    return {"linear_damping": 1 - bodies.velocity[0, 0], "angular_damping": 1 - bodies.spin[0, 0]}
