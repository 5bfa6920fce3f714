"""The simulated tank: bodies, engine and effects, advanced one step at a time."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import chain
from typing import Any

import numpy as np

from kinetics.assembly import RuleBook, Structure, placements
from kinetics.support.stream_keys import words_of
from mechsim.effects.base import Action, Effect, FlowSource, Stopped
from mechsim.effects.hits import Hit
from mechsim.kernels.contact import blocked
from mechsim.kernels.motion import TROUBLES, coast, not_finite, trouble
from mechsim.scene import Scene
from mechsim.world.bodies import Bodies
from mechsim.world.engines import Engine, engine_named
from mechsim.world.free_spin import FreeSpin
from mechsim.world.placement import scatter

# Steps after which every body is read back: rounding between our free flight and the engine's cannot build up.
RESYNC = 100


@dataclass(frozen=True, eq=False)
class BondEvent:
    """A join or a break.

    before, after : the structures that it turned into each other
    cubes : numbers of the two cubes whose bond was made or broken; the first pair where a join made several bonds
    hit : the collision that broke it
    """

    before: tuple[Structure, ...]
    after: tuple[Structure, ...]
    cubes: tuple[int, int]
    hit: Hit | None = None


class World:
    """Cubes in a tank under the effects of a scene.

    scene, book : what is simulated, and the rules its cubes follow
    seed : of all streams of this world; each part draws from its own, so leaving one out does not change the others

    Effects see of it what `effects.view.ViewOfWorld` names. `fluid` (C, P, 3) is the velocity of the fluid at the drag
    points, the sum of what the sources of flow keep each for itself; it is renewed in every step, after the last of
    them has acted.
    `parts` : what a step does, in order, each with the name of the effect, or of the work, that it is
    """

    def __init__(self, scene: Scene, book: RuleBook, n_cubes: int, seed: np.random.SeedSequence):
        self.scene, self.book, self._seed = scene, book, seed
        self.step_size = scene.numerics.step
        self.step_count = 0
        self.time = 0.0
        self.half = np.asarray(scene.tank.size) / 2
        self.limit = np.full(3, np.inf)  # beyond it a body has escaped; walls set it
        self.bodies = Bodies(n_cubes, scene.cubes.edge, scene.cubes.density * scene.cubes.edge**3)
        engine = engine_named(scene.numerics.engine).load()
        self.engine: Engine = engine(self.bodies, self.step_size, scene.numerics.solver_iterations)
        self.set_drag_points(np.zeros((0, 3)))
        self.listeners: list[Callable[[BondEvent], None]] = []
        self.hit_listeners: list[Callable[[Hit], None]] = []
        self._changed: list[Callable[[int], None]] = []
        self._placing = self.stream("placement")
        effects: tuple[Effect, ...] = scene.effects
        actions = {effect.effect: effect.attach(self) for effect in effects}
        self.sources = {name: a for name, a in actions.items() if isinstance(a, FlowSource)}
        for source in self.sources.values():
            source.flow = np.zeros_like(self.fluid)
        self.before = {name: a.before_step for name, a in actions.items() if _overrides(a, "before_step")}
        # A join makes a new body, of whose collisions in this step nothing is known: breaks are judged first.
        joiners = scene.openers("join")
        ordered = sorted(actions.items(), key=lambda item: item[0] in joiners)
        self.after = {name: a.after_step for name, a in ordered if _overrides(a, "after_step")}
        self.parts = self._parts()

    def __enter__(self) -> World:
        return self

    def __exit__(self, *_: object) -> None:
        self.engine.close()

    def stream(self, name: str) -> np.random.Generator:
        """The random stream of one named part of this world."""
        key = (*self._seed.spawn_key, *words_of(name))
        return np.random.Generator(np.random.PCG64(np.random.SeedSequence(self._seed.entropy, spawn_key=key)))

    def on_change(self, hook: Callable[[int], None]) -> None:
        """Call `hook(slot)` whenever a slot has got a new structure."""
        self._changed.append(hook)

    def set_drag_points(self, points: np.ndarray) -> None:
        """Let the fluid act on every cube at these points (P, 3), from its centre along its own axes."""
        self.drag_points, self.fluid = points, np.zeros((self.bodies.n_cubes, len(points), 3))

    def confine(self) -> None:
        """From now on a body outside the tank is an escape."""
        self.limit = self.half

    # -- what is in the tank
    # ------------------------------------------------------------------------------------------------------

    def populate(self, structures: Sequence[Structure]) -> None:
        """Place these structures at random, at rest; what still stands as it should is moved, not rebuilt.

        Raises ValueError when they do not fit.
        """
        b = self.bodies
        wanted = list(structures)
        for slot in b.live:
            held = b.held(slot)
            if held in wanted:
                wanted.remove(held)
            else:
                self._remove(slot)
        free_cubes = sorted(set(range(b.n_cubes)) - {cube for members in b.members for cube in members})
        free_slots = [slot for slot in range(b.n_cubes) if not b.members[slot]]
        for structure in wanted:
            members, free_cubes = tuple(free_cubes[: len(structure)]), free_cubes[len(structure) :]
            self._create(free_slots.pop(0), structure, members)
        self._settle()
        scatter(b, -self.half, self.half, self._placing)
        for slot in b.live:
            self.engine.put(slot)
            b.born[slot] = self.time
        b.locate()

    def docking(self, i: int, face: int, j: int, other_face: int) -> tuple[int, int, Structure] | None:
        """How the bodies of cubes i and j would join by these faces: keeper, other, joined structure.

        The heavier body keeps its orientation, the other takes the nearest of the four twists. None where the rules
        or the lattice refuse.
        """
        b = self.bodies
        if b.mass[b.body[i]] < b.mass[b.body[j]]:
            i, face, j, other_face = j, other_face, i, face
        keeper, other = int(b.body[i]), int(b.body[j])
        a, c = b.held(keeper), b.held(other)
        at, to = b.members[keeper].index(i), b.members[other].index(j)
        twist = b.nearest(keeper, other, placements(a, at, face, c, to, other_face))
        joined = self.book.join(a, at, c, to, twist)
        return None if joined is None else (keeper, other, joined)

    def fits(self, keeper: int, other: int, joined: Structure) -> bool:
        """Is there room for the joined structure, clear of third bodies and walls?"""
        b = self.bodies
        position, orientation, _, _ = b.joined_motion(keeper, other, joined)
        centre, axes = b.cubes_at(position, orientation, joined)
        skip = (b.body == keeper) | (b.body == other)
        # A touch is no overlap: the cubes are tested 2 % smaller than they are.
        return not blocked(centre, axes, b.centre, b.axes, skip, b.edge / 2, 0.98, -self.limit, self.limit)

    def join(self, keeper: int, other: int, joined: Structure) -> None:
        """Make one body of two: the keeper's cubes come first in `joined`, in its lattice frame. Momenta are kept
        exactly."""
        b = self.bodies
        before = b.held(keeper), b.held(other)
        motion = b.joined_motion(keeper, other, joined)
        members = b.members[keeper] + b.members[other]
        self._remove(keeper)
        self._remove(other)
        self._create(keeper, joined, members, motion)
        self._settle()
        self._tell(BondEvent(before, (joined,), _bond_between(joined, members, members[: len(before[0])])))

    def part(self, slot: int, fragments: Sequence[tuple[Sequence[int], Structure]], hit: Hit | None = None) -> None:
        """Split a body into fragments (indices of its cubes, structure); each goes on as it moved. Momenta are kept
        exactly. hit : the collision that did it."""
        b = self.bodies
        before = b.held(slot)
        motions = [b.fragment_motion(slot, structure) for _, structure in fragments]
        cubes_before = b.members[slot]
        members = [tuple(cubes_before[i] for i in part) for part, _ in fragments]
        self._remove(slot)
        free = [s for s in range(b.n_cubes) if not b.members[s]]
        for (_, structure), cubes, motion in zip(fragments, members, motions, strict=True):
            self._create(free.pop(0), structure, cubes, motion)
        self._settle()
        bond = _bond_between(before, cubes_before, members[0])
        self._tell(BondEvent((before,), tuple(structure for _, structure in fragments), bond, hit))

    def log_hit(self, hit: Hit) -> None:
        """Hand a hit to those who log them."""
        for hook in self.hit_listeners:
            hook(hit)

    def snapshot(self) -> tuple[float, np.ndarray, np.ndarray, np.ndarray]:
        """Time, and of all cubes the centres (C, 3), axes (C, 3, 3) and body slots (C,)."""
        return self.time, self.bodies.centre.copy(), self.bodies.axes.copy(), self.bodies.body.copy()

    # -- one step --------------------------------------------------------------------------------

    def step(self) -> None:
        """One step with all effects; raises Stopped when the guard finds that the state cannot be trusted."""
        for _, part in self.parts:
            part()

    def _parts(self) -> list[tuple[str, Callable[[], None]]]:
        hooks = [[(name, hook), ("guard", self._checking(name))] for name, hook in self.before.items()]
        flowing = [place for place, name in enumerate(self.before) if name in self.sources]
        if flowing:
            hooks[flowing[-1]].append(("fluid", self.superpose))
        spin = FreeSpin(self.bodies, self.step_size)
        is_free = self.scene.provider("drag") is None
        return [
            *chain.from_iterable(hooks),
            *([("free spin", spin.begin)] if is_free else []),
            ("motions into the engine", self.engine.set_motions),
            ("engine", self.engine.step),
            ("free flight", self._coast),
            ("reading back", self._read),
            *([("free spin", spin.end)] if is_free else []),
            ("guard", self._guard),
            ("places of cubes", self.bodies.locate),
            *self.after.items(),
        ]

    def superpose(self) -> None:
        """Renew the field of flow: the first source's copied, the others' added, so that one alone keeps every bit."""
        first, *others = self.sources.values()
        np.copyto(self.fluid, first.flow)
        for source in others:
            self.fluid += source.flow

    def _coast(self) -> None:
        """Free flight of all bodies; those that touched something are read back after it."""
        b = self.bodies
        coast(b.live, b.position, b.orientation, b.velocity, b.spin, b.inertia, self.step_size)
        self.step_count += 1
        self.time = self.step_count * self.step_size

    def _read(self) -> None:
        if self.step_count % RESYNC == 0:
            self.engine.read(self.bodies.live.tolist())
        else:
            self.engine.read(self.engine.near_contacts())

    def _checking(self, effect: str) -> Callable[[], None]:
        """Names the effect that makes a motion infinite or not a number."""
        b = self.bodies

        def check() -> None:
            slot = not_finite(b.live, b.velocity, b.spin)
            if slot >= 0:
                raise Stopped(
                    f"effect {effect!r} produced a motion that is not a number: {b.title(slot)} at {self.time:.4f} tu, "
                    f"mass {b.mass[slot]:.3g}, velocity {b.velocity[slot]}, spin {b.spin[slot]}"
                )

        return check

    def _guard(self) -> None:
        b, limits = self.bodies, self.scene.guard
        code, slot = trouble(
            b.live, b.position, b.velocity, b.spin, -self.limit, self.limit, b.edge, self.step_size,
            limits.max_speed, limits.max_turn,
        )  # fmt: skip
        if code:
            speed, spin = np.linalg.norm(b.velocity[slot]), np.linalg.norm(b.spin[slot])
            b.locate()
            raise Stopped(
                f"{TROUBLES[code]}: {b.title(slot)} at {self.time:.4f} tu, speed {speed:.3g}, spin {spin:.3g}"
            )

    def _create(
        self, slot: int, structure: Structure, members: tuple[int, ...], motion: tuple[Any, ...] | None = None
    ) -> None:
        b = self.bodies
        b.fill(slot, structure, members, self.time)
        self.engine.create(slot)
        if motion is not None:
            b.position[slot], b.orientation[slot], b.velocity[slot], b.spin[slot] = motion
            self.engine.put(slot)
        for hook in self._changed:
            hook(slot)

    def _remove(self, slot: int) -> None:
        self.engine.remove(slot)
        self.bodies.clear(slot)

    def _settle(self) -> None:
        """Bring the lists of bodies up to date after slots were filled or freed."""
        self.bodies.index()
        self.bodies.locate()

    def _tell(self, event: BondEvent) -> None:
        for hook in self.listeners:
            hook(event)


def _bond_between(whole: Structure, members: tuple[int, ...], part: tuple[int, ...]) -> tuple[int, int]:
    """The cubes of the first bond of `whole` (cubes `members`) between `part` and the rest."""
    return next((members[i], members[j]) for i, j in whole.bonds if (members[i] in part) != (members[j] in part))


def _overrides(action: Action, hook: str) -> bool:
    return getattr(type(action), hook) is not getattr(Action, hook)
