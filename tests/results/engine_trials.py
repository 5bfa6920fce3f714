"""What two engines make of the same tanks: speeds, meetings, impulses, loads and places, run by run.

Nothing joins and nothing breaks, so that both engines see the same bodies throughout. A run is made by both engines
from one seed: the same places at its start and the same noise. The two stay alike for some time (of the meetings in a
crowded tank, 2 tu on, the correlation is .7), so that the difference is known better than either; a run lasts about as
long as that, and their scatter gives the standard error of the difference.

The plan, made before its runs: TANKS, below. `crowded` gives meetings by pair of sizes and the spectrum of loads
(three times as dense as the study's calibration tanks of 120 cubes: pairs grow with the square, costs do not); `shaken`
the rate of hits that break, which the study's own shaking gives a structure once in hundreds of tu: three times its
agitation, steps a third as long, the same threshold; `single` what slow drifts apart would show, in longer runs.

The first plan had 500, 50 and 50 runs. With our own engine's second version its rows were made anew, and the plan grew
before any further run: `crowded` to 1,500, which should give hits above half of the threshold to 1 % of each size; and
`unlimited`, which is `shaken` by PyBullet without its limit on spins, 100 runs.
"""

from __future__ import annotations

from collections import Counter
from itertools import combinations_with_replacement, pairwise, product
from typing import NamedTuple

import numpy as np

from kinetics.support.settings import validated
from mechsim.accuracy.trial import unbound, unbreakable
from mechsim.effects.faces import FacesWithinReach
from mechsim.effects.hits import Hit
from mechsim.effects.latches import Encounter
from mechsim.inspection.speeds import whole_holds
from mechsim.runs.record import book_of
from mechsim.scene import Scene
from mechsim.world.world import World

WARM_UP = 1.0  # tu, many times the relaxation of a speed
LOOK_EVERY = 20  # steps between two looks at where all cubes are
WALL_BINS = (0.5, 0.75, 1.0, 1.5)  # distances of centres from the nearest wall, edges
PAIR_BINS = (0.9, 1.25, 1.5, 2.0)  # distances of two cubes' centres, edges
LINES = ("monomer", "dimer", "trimer", "quadmer")


class Tank(NamedTuple):
    """A tank of the plan.

    title : on the page; composition : bodies by name; runs, length : how many runs are planned, tu of each
    shaking : times the scene's agitation, its step being divided by as much
    shares : of the threshold at which a bond breaks, above which hits are counted
    is_limited : PyBullet cuts each component of a spin at 100 / tu once its body has touched something, as it does
        unless told otherwise
    """

    title: str
    composition: dict[str, int]
    runs: int
    length: float
    shaking: int = 1
    shares: tuple[float, ...] = (0.25, 0.5, 1.0)
    is_limited: bool = True

    @property
    def sizes(self) -> list[int]:
        """Of its bodies, in cubes."""
        return [LINES.index(name) + 1 for name in self.composition]

    def scene(self, engine: str) -> Scene:
        """Line4 as this tank has it, by this engine."""
        scene = by_engine(Scene.load("line4"), engine)
        sigma, step = scene.effect("agitation").sigma, scene.numerics.step
        data = scene.changed("agitation", sigma=sigma * self.shaking).as_dict()
        data["numerics"]["step"] = step / self.shaking
        return validated(Scene, data, f"scene {scene.name}")


TANKS = {
    "crowded": Tank("36 bodies of each size", dict.fromkeys(LINES, 36), runs=1500, length=5.0),
    "shaken": Tank("the same, shaken", dict.fromkeys(LINES, 36), runs=50, length=3.0, shaking=3, shares=(1.0, 1.5)),
    "single": Tank("120 single cubes", {"monomer": 120}, runs=50, length=20.0),
}
TANKS["unlimited"] = TANKS["shaken"]._replace(title="shaken, no limit on spins", runs=100, is_limited=False)


def by_engine(scene: Scene, engine: str) -> Scene:
    """The same scene, computed by another engine."""
    data = scene.as_dict()
    data["numerics"]["engine"] = engine
    return validated(Scene, data, f"scene {scene.name}")


def lift_limit(world: World) -> None:
    """Let PyBullet leave spins of the bodies that are there as they are, however fast."""
    import pybullet  # an extra, which our own engine does without

    from mechsim.world.engines.pybullet_engine import PyBulletEngine

    assert isinstance(world.engine, PyBulletEngine)
    client = world.engine.client
    for k in range(pybullet.getNumBodies(physicsClientId=client)):
        pybullet.changeDynamics(pybullet.getBodyUniqueId(k, client), -1, maxJointVelocity=1e9, physicsClientId=client)


class _Watch:
    """Counts and sums of one tank, by name."""

    def __init__(self, scene: Scene, world: World, shares: tuple[float, ...]):
        self.world, self.shares, self.seen, self.steps, self.looks = world, shares, Counter[str](), 0, 0
        bonding = scene.effect("bonding")
        sideways = bonding.sideways * world.bodies.edge
        self.faces = FacesWithinReach(world, bonding.capture_distance, bonding.capture_angle, sideways, in_passing=True)
        self.meetings = Encounter(probability=1.0).attach(world, world.stream("meetings"))
        self.threshold = scene.effect("breaking").threshold
        world.hit_listeners.append(self._note)

    def _note(self, hit: Hit) -> None:
        for share in self.shares:
            if hit.load > share * self.threshold:
                self.seen[f"hits above {share:g} of the threshold on {len(hit.struck)}"] += 1

    def begin(self) -> None:
        """Forget what was seen of the warm-up, but for meetings under way."""
        self.seen.clear()
        self.steps = self.looks = 0

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
            self.looks += 1
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

    def found(self) -> dict[str, float]:
        """Means over the steps or looks, and counts and impulses a tu, since `begin`."""
        time = self.steps * self.world.step_size
        per = {"speed": self.steps, "spin": self.steps, "cubes": self.looks, "pairs": self.looks}
        return {name: float(total / per.get(name.split()[0], time)) for name, total in self.seen.items()}


def names(tank: Tank) -> list[str]:
    """What is measured in a tank, in order."""
    sizes, places = tank.sizes, ("by a wall", "elsewhere")
    found = [f"{what} of {size}" for what, size in product(("speed", "spin"), sizes)]
    found += [f"meetings {one}-{two}" for one, two in combinations_with_replacement(sizes, 2)]
    found += ["impulse on walls", "impulse on cubes"]
    found += [f"cubes {a}-{b} edges from a wall" for a, b in pairwise(WALL_BINS)]
    found += [f"pairs {a}-{b} edges apart, {place}" for (a, b), place in product(pairwise(PAIR_BINS), places)]
    return found + [f"hits above {s:g} of the threshold on {n}" for n, s in product(sizes[1:], tank.shares)]


def measure(tank: Tank, engine: str, seed: int) -> dict[str, float]:
    """One run of a tank by an engine: each quantity of `names`."""
    scene = tank.scene(engine)
    book, derivation = book_of(scene.rules)
    start = [derivation.structures[name] for name, n in tank.composition.items() for _ in range(n)]
    if len(tank.sizes) == 1:
        made = unbound(scene)
    else:
        made = unbreakable(scene).changed("breaking", log_above=min(tank.shares) * scene.effect("breaking").threshold)
    with World(made, book, sum(map(len, start)), np.random.SeedSequence(seed)) as world:
        watch = _Watch(scene, world, tank.shares)
        world.populate(start)
        if engine == "pybullet" and not tank.is_limited:
            lift_limit(world)
        for length in (WARM_UP, tank.length):
            watch.begin()
            for _ in range(whole_holds(scene, length)):
                world.step()
                watch.after_step()
        seen = watch.found()
    return {name: seen.get(name, 0.0) for name in names(tank)}
