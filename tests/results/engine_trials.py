"""What two engines make of the same tanks: speeds, meetings, impulses, loads and places, block by block.

Nothing joins and nothing breaks, so that both engines see the same bodies throughout. `measure` gives the total of each
quantity in each block of a trial; blocks are far longer than any memory of the motion, so their scatter gives the
standard errors.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from itertools import combinations_with_replacement, pairwise, product

import numpy as np

from kinetics.support.settings import validated
from mechsim.accuracy.trial import unbound, unbreakable
from mechsim.effects.faces import FacesWithinReach
from mechsim.effects.hits import Hit
from mechsim.effects.latches import Encounter
from mechsim.inspection.speeds import whole_holds
from mechsim.runs.load_log import LoadLog
from mechsim.runs.record import book_of
from mechsim.scene import Scene
from mechsim.world.world import World

WARM_UP = 2.0  # tu
LOOK_EVERY = 20  # steps between two looks at where all cubes are
SHARES = (0.25, 0.5, 1.0)  # of the threshold at which a bond breaks
WALL_BINS = (0.5, 0.75, 1.0, 1.5)  # distances of centres from the nearest wall, edges
PAIR_BINS = (0.9, 1.25, 1.5, 2.0)  # distances of two cubes' centres, edges
SINGLE = {"monomer": 120}
MIXED = {"monomer": 12, "dimer": 12, "trimer": 12, "quadmer": 12}


def by_engine(scene: Scene, engine: str) -> Scene:
    """The same scene, computed by another engine."""
    data = scene.as_dict()
    data["numerics"]["engine"] = engine
    return validated(Scene, data, f"scene {scene.name}")


class _Watch:
    """Counts and sums of one tank, by name."""

    def __init__(self, scene: Scene, world: World):
        self.world, self.seen, self.steps = world, Counter[str](), 0
        bonding = scene.effect("bonding")
        sideways = bonding.sideways * world.bodies.edge
        self.faces = FacesWithinReach(world, bonding.capture_distance, bonding.capture_angle, sideways, in_passing=True)
        self.meetings = Encounter(probability=1.0).attach(world, world.stream("meetings"))
        self.log, self.threshold = LoadLog(), scene.effect("breaking").threshold
        world.hit_listeners.append(self._note)

    def _note(self, hit: Hit) -> None:
        self.log.add(self.world.step_count, self.world.time, hit)

    def after_step(self) -> None:
        """Look at the step just made."""
        b, seen = self.world.bodies, self.seen
        sizes = np.array([len(members) for members in b.members])
        for name, motion in (("speed", b.velocity), ("spin", b.spin)):
            values = np.sqrt(np.einsum("ij,ij->i", motion, motion))
            for size in np.unique(sizes[b.live]):
                seen[f"{name} of {size}"] += values[b.live][sizes[b.live] == size].mean()
        for i, face, j, other in self.faces.within_reach().tolist():
            begun = self.meetings.begun
            self.meetings((i, face, j, other))
            if self.meetings.begun > begun:
                one, two = sorted((int(sizes[b.body[i]]), int(sizes[b.body[j]])))
                seen[f"meetings {one}-{two}"] += 1
        for touch in self.world.engine.touches():
            who = "walls" if min(touch.a, touch.b) < 0 else "cubes"
            seen[f"impulse on {who}"] += float(np.hypot.reduce(touch.impulse))
        self.steps += 1
        if self.steps % LOOK_EVERY == 0:
            self._look_at_places()

    def _look_at_places(self) -> None:
        b, half = self.world.bodies, self.world.half
        from_wall = (half - np.abs(b.centre)).min(axis=1) / b.edge
        for low, high in pairwise(WALL_BINS):
            self.seen[f"cubes {low}-{high} edges from a wall"] += int(((from_wall >= low) & (from_wall < high)).sum())
        apart = np.linalg.norm(b.centre[:, None] - b.centre[None], axis=2) / b.edge
        apart[b.body[:, None] == b.body[None]] = np.inf
        apart[np.tril_indices(len(apart))] = np.inf
        near = np.minimum(from_wall[:, None], from_wall[None]) < 1.0
        for (low, high), place in product(pairwise(PAIR_BINS), ("by a wall", "elsewhere")):
            within = (apart >= low) & (apart < high) & (near == (place == "by a wall"))
            self.seen[f"pairs {low}-{high} edges apart, {place}"] += int(within.sum())

    def totals(self) -> dict[str, float]:
        """All that it has seen so far."""
        found = Counter(self.seen)
        for row, share in product(self.log.rows, SHARES):
            if row.hit.load > share * self.threshold:
                found[f"hits above {share:g} of the threshold on {len(row.hit.struck)}"] += 1
        return dict(found)


def names(composition: dict[str, int]) -> list[str]:
    """What is measured in a tank of these bodies, in order."""
    sizes = [1] if composition == SINGLE else [1, 2, 3, 4]
    found = [f"{what} of {size}" for what, size in product(("speed", "spin"), sizes)]
    found += [f"meetings {one}-{two}" for one, two in combinations_with_replacement(sizes, 2)]
    found += ["impulse on walls", "impulse on cubes"]
    found += [f"cubes {a}-{b} edges from a wall" for a, b in pairwise(WALL_BINS)]
    places = ("by a wall", "elsewhere")
    found += [f"pairs {a}-{b} edges apart, {place}" for (a, b), place in product(pairwise(PAIR_BINS), places)]
    return found + [f"hits above {s:g} of the threshold on {n}" for n, s in product(sizes[1:], SHARES)]


def measure(
    scene: Scene, composition: dict[str, int], blocks: int, length: float, seed: int
) -> Iterator[dict[str, float]]:
    """Of each block of `length` tu, the total of each quantity a tu."""
    book, derivation = book_of(scene.rules)
    start = [derivation.structures[name] for name, n in composition.items() for _ in range(n)]
    tank = unbound(scene) if composition == SINGLE else unbreakable(scene)
    if composition != SINGLE:
        tank = tank.changed("breaking", log_above=min(SHARES) * scene.effect("breaking").threshold)
    n_cubes, steps = sum(map(len, start)), whole_holds(scene, length)
    with World(tank, book, n_cubes, np.random.SeedSequence(seed)) as world:
        watch = _Watch(scene, world)
        world.populate(start)
        for _ in range(whole_holds(scene, WARM_UP)):
            world.step()
        before: dict[str, float] = {}
        for _ in range(blocks):
            for _ in range(steps):
                world.step()
                watch.after_step()
            now = watch.totals()
            # Speeds are sums over steps, the rest are sums over time: both a tu.
            yield {name: (now.get(name, 0.0) - before.get(name, 0.0)) / (steps * world.step_size) for name in now}
            before = now
