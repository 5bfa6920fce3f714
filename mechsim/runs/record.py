"""Single mechanics runs: their inputs, their execution, and the record of what happened."""

from __future__ import annotations

import hashlib
import json
import math
import time
from collections.abc import Callable
from dataclasses import dataclass, field, fields
from functools import cached_property, lru_cache
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from kinetics.assembly import Derivation, RuleBook, Structure
from kinetics.assembly.deriving.cached import derive_cached
from kinetics.network import Tank
from kinetics.runs import RESTART, JumpPath
from kinetics.support.config import is_path
from kinetics.support.frozen import set_fields
from kinetics.support.settings import validated
from kinetics.support.stream_keys import words_of
from mechsim.effects.base import EventKind, Stopped
from mechsim.runs.contents import RunInputs, is_trial
from mechsim.runs.event_watch import EventWatch, RunEvent
from mechsim.runs.species import some_of
from mechsim.scene import Scene
from mechsim.world.engines import engine_named

if TYPE_CHECKING:
    from mechsim.world.world import World

# Raised by hand whenever the same inputs would give another record: it is part of a run's name.
PHYSICS = 5
FREE_SPIN = 1  # the same for scenes without drag, whose bodies we turn ourselves
COMPLETED = "completed"
PROGRESS_STEPS = 500
MOST_STEPS = 1e15  # a double still counts them


def book_of(rules: str) -> tuple[RuleBook, Derivation]:
    """A rule book and its network, derived once a process, and again where its file has changed."""
    written = Path(rules).stat() if is_path(rules) and Path(rules).is_file() else None
    return _book_of(rules, written and (written.st_ino, written.st_size, written.st_mtime_ns))


@lru_cache(maxsize=16)
def _book_of(rules: str, _written: tuple[int, ...] | None) -> tuple[RuleBook, Derivation]:
    book = RuleBook.load(rules)
    return book, derive_cached(book)


@dataclass(frozen=True)
class RunSpec:
    """The full inputs of one run.

    composition : species -> copies in the tank at time 0, kept and placed in the network's order
    duration : simulated time, tu
    seed, run : seed and number of the run, which with the composition key its random streams; see `streams`
    restart : after every event reset the tank to the composition, with new places, while the clock runs on (paper,
        section VI-A2)
    poses : interval at which the poses of all cubes are recorded, tu; None: never
    until : end the run at the first copy of this species, if that comes before the duration; None: run to the end
    physics : version of the mechanics; today's, or an earlier one, whose stored runs can be read and no new ones made

    >>> from mechsim import RunSpec, Scene
    >>> RunSpec(Scene.load("line4"), {"monomer": 8, "dimer": 2}, duration=5.0, seed=1, run=0).title
    'line4: 8 monomer+2 dimer, 5 tu, seed 1, run 0'
    """

    scene: Scene
    composition: dict[str, int]
    duration: float
    seed: int
    run: int
    restart: bool = False
    poses: float | None = None
    until: str | None = None
    physics: int = PHYSICS

    def __post_init__(self) -> None:
        if not np.isfinite(self.duration) or self.duration <= 0:
            raise ValueError(f"duration = {self.duration}; expected a finite number of tu above 0")
        if self.poses is not None and not (np.isfinite(self.poses) and self.poses > 0):
            raise ValueError(f"poses = {self.poses}; expected a finite interval in tu above 0, or none")
        step = self.scene.numerics.step
        for name, value in (("duration", self.duration), ("poses", self.poses or 0.0)):
            if value / step > MOST_STEPS:
                raise ValueError(f"{name} = {value:g} tu; expected at most {MOST_STEPS:g} steps of {step} tu")
        if self.seed < 0 or self.run < 0:
            raise ValueError(f"seed = {self.seed}, run = {self.run}; neither may be negative")
        book, derivation = book_of(self.scene.rules)
        breaking = self.scene.openers("break")
        if book.semantics.bonds == "hold" and breaking:
            raise ValueError(
                f"scene {self.scene.name} lists the effect {breaking[0]!r}, but bonds of book {self.scene.rules} hold: "
                "leave the effect out"
            )
        species = derivation.network.species
        for name, count in self.composition.items():
            if name not in species:
                raise ValueError(f"unknown species {name!r}; book {self.scene.rules} has {some_of(species)}")
            if isinstance(count, bool) or int(count) != count or count < 0:
                raise ValueError(f"{name} = {count}; expected a whole number, 0 or more")
        # One order of placing for one name: a run's key does not depend on the order in which its species were written.
        ordered = {name: int(self.composition[name]) for name in species if self.composition.get(name)}
        set_fields(self, composition=ordered)
        if self.n_cubes < 1:
            raise ValueError("the composition holds no cubes")
        if breaking and not self.scene.openers("join") and not any(structure.bonds for structure in self.start):
            raise ValueError(
                f"scene {self.scene.name} lists the effect {breaking[0]!r}, but there are no bonds to break: the cubes "
                "start single and no effect joins them; start from structures, list one that does, or leave it out"
            )
        if self.until is not None:
            if self.until not in species:
                raise ValueError(f"until = {self.until!r}; book {self.scene.rules} has {some_of(species)}")
            if self.composition.get(self.until, 0):
                raise ValueError(f"until = {self.until!r}, but the composition already holds one: leave it out")
            if self.restart:
                raise ValueError(
                    f"until = {self.until!r} with restart: a restart resets the tank at every event; choose one"
                )
        edge, size = self.scene.cubes.edge, self.scene.tank.size
        volume, room = self.n_cubes * edge**3, float(np.prod(size))
        if volume > room:
            raise ValueError(f"{self.n_cubes} cubes of edge {edge} take {volume:.4g}; the tank holds {room:.4g}")
        if min(size) < edge:
            raise ValueError(f"a cube of edge {edge} does not fit into a tank that is {min(size)} wide")

    def check_can_be_made(self) -> None:
        """ValueError if the run is one of another version of the mechanics than today's."""
        if self.physics != PHYSICS:
            raise ValueError(
                f"{self.title} is not stored, and belongs to version {self.physics} of the mechanics: runs are made by "
                f"version {PHYSICS}; put the stored run back, or change the physics, and with it every run"
            )

    @property
    def n_cubes(self) -> int:
        """Number of cubes in the tank."""
        structures = book_of(self.scene.rules)[1].structures
        return sum(len(structures[name]) * count for name, count in self.composition.items())

    @property
    def start(self) -> list[Structure]:
        """The structures in the tank at time 0, in the order in which they are placed."""
        structures = book_of(self.scene.rules)[1].structures
        return [structures[name] for name, n in self.composition.items() for _ in range(n)]

    @property
    def inputs(self) -> dict[str, Any]:
        """Everything that decides what happens, ready for JSON; versions that change the physics included."""
        inputs: dict[str, Any] = {
            "scene": self.scene.content,
            "rules": book_of(self.scene.rules)[0].fingerprint,
            "composition": dict(sorted(self.composition.items())),
            "duration": self.duration,
            "seed": self.seed,
            "run": self.run,
            "restart": self.restart,
            "poses": self.poses,
            "physics": {"wellmixed": self.physics} | {name: version(name) for name in self.scene.packages},
        }
        engine = engine_named(self.scene.numerics.engine)
        if engine.version > 1:
            inputs["physics"] |= {"engine": engine.version}
        if self.scene.provider("drag") is None:
            inputs["physics"] |= {"free_spin": FREE_SPIN}
        # Named only where it is asked for: a run without it keeps the name that it had before there was one.
        return inputs if self.until is None else inputs | {"until": self.until}

    @classmethod
    def of_inputs(cls, inputs: dict[str, Any], file: str | Path) -> RunSpec:
        """The run that the inputs of a stored run describe.

        file : of the run. A rule book that is not shipped is looked for beside it, in the folder above, and in the
            working directory.

        ValueError: no such run, or no such book.
        """
        if is_trial(inputs):
            raise ValueError(f"{file} is a trial of the accuracy of mechanics, not a run")
        validated(RunInputs, inputs, str(file))
        scene = validated(Scene, inputs["scene"], str(file))
        if is_path(scene.rules):
            folder = Path(file).absolute().parent
            places = dict.fromkeys([folder, folder.parent, Path.cwd()])
            found = [place / scene.rules for place in places if (place / scene.rules).is_file()]
            if not found:
                raise ValueError(
                    f"{file} was made with a rule book {scene.rules}, which none of {', '.join(map(str, places))} "
                    "holds; put it beside the run"
                )
            scene = scene.replace(rules=str(found[0]))
        known = {f.name: inputs[f.name] for f in fields(cls) if f.name in inputs}
        return cls(**known | {"scene": scene, "physics": inputs["physics"]["wellmixed"]})

    @property
    def streams(self) -> np.random.SeedSequence:
        """Root of the run's random streams, from the seed, the SHA-256 of the composition and the run's number.

        Runs of the same seed and number but of different compositions draw different numbers, unless numpy mixes both
        keys into the same 128 bits: by chance one pair in 3e38.
        """
        start = json.dumps(self.inputs["composition"], sort_keys=True)
        return np.random.SeedSequence(self.seed, spawn_key=(*words_of(start), self.run))

    @cached_property
    def key(self) -> str:
        """SHA-256 of the inputs, which names the run."""
        return hashlib.sha256(json.dumps(self.inputs, sort_keys=True).encode()).hexdigest()

    @property
    def title(self) -> str:
        """A short name for people."""
        what = "+".join(f"{n} {name}" for name, n in self.composition.items())
        end = f"{self.duration:g} tu" if self.until is None else f"first {self.until} within {self.duration:g} tu"
        return f"{self.scene.name}: {what}, {end}, seed {self.seed}, run {self.run}"


@dataclass
class RunRecord:
    """The record of one run: its inputs and what happened.

    outcome : "completed", or "stopped: " and the guard's reason; such a run is not used in calibration
    arrays : initial (S,), times (E,), channels (E,), and of each event
        bonds (E, 2) : the two cubes whose bond was made or broken, -1 at a restart. Cubes are numbered from 0 in the
            order of `RunSpec.start`. A number stays with its cube between restarts; at a restart, bodies that are no
            longer as at the start are dealt out anew
        partners (E,) : what broke a bond: the index of another body's species, BY_WALL (walls alone), BY_SEVERAL (more
            than one body, or a body and a wall) or BY_UNKNOWN (no collision); NO_BREAK where no bond broke
        With a log of hits (`Breaking.log_above`), by collision: load_time (H,), load_channel (H,), the break that it
        makes or would make, load_partner (H,), a species or BY_WALL, load_value (H,) and load_flags (H,), bits SHARED
        and BROKE; see `load_log`.
        With poses: pose_times (K,), centres (K, C, 3), axes (K, C, 3, 3; columns) and body slots (K, C) of all cubes,
        the last frame at the run's end
    facts : end (tu), species, channels, open_channels, steps
    cost : cpu_seconds and wall_seconds; not part of the digest

    >>> from mechsim import RunSpec, Scene, execute
    >>> execute(RunSpec(Scene.load("line4"), {"monomer": 4}, duration=0.1, seed=1, run=0)).path.initial.tolist()
    [4, 0, 0, 0]
    """

    spec: RunSpec
    outcome: str
    arrays: dict[str, np.ndarray]
    facts: dict[str, Any]
    cost: dict[str, float] = field(default_factory=dict)

    @property
    def completed(self) -> bool:
        """Whether the run reached its end without being stopped by the guard."""
        return self.outcome == COMPLETED

    @property
    def digest(self) -> str:
        """SHA-256 over the inputs and the results, without the cost."""
        sha = hashlib.sha256()
        sha.update(json.dumps([self.spec.key, self.outcome, self.facts], sort_keys=True).encode())
        for name in sorted(self.arrays):
            array = np.ascontiguousarray(self.arrays[name])
            sha.update(f"{name} {array.dtype.str} {array.shape}".encode())
            sha.update(array.tobytes())
        return sha.hexdigest()

    @cached_property
    def path(self) -> JumpPath:
        """The run as a jump path of the derived network."""
        network = book_of(self.spec.scene.rules)[1].network
        if list(network.channels) != self.facts["channels"]:
            raise ValueError(f"{self.spec.title}: recorded with other channels than book {self.spec.scene.rules} gives")
        return JumpPath(
            network,
            initial=self.arrays["initial"],
            times=self.arrays["times"],
            channels=self.arrays["channels"],
            end=self.facts["end"],
            open_channels=np.array(self.facts["open_channels"], bool),
            tank=Tank(self.spec.scene.tank.size),
            partners=self.arrays.get("partners"),
        )


def execute(
    spec: RunSpec,
    progress: Callable[[float], None] | None = None,
    look: Callable[[World], None] | None = None,
) -> RunRecord:
    """Carry out one run; on the same machine and versions the record is the same, bit for bit.

    progress : called with the simulated time, tu, now and then
    look : called with the world before every step and at the end

    ValueError: the run is one of another version of the mechanics.

    >>> from mechsim import RunSpec, Scene, execute
    >>> spec = RunSpec(Scene.load("line4"), {"monomer": 4}, duration=0.1, seed=1, run=0)
    >>> execute(spec).digest == execute(spec).digest
    True
    """
    from mechsim.world.world import World  # the engine is loaded when a run is made, not when one is read

    spec.check_can_be_made()
    book, derivation = book_of(spec.scene.rules)
    watch = EventWatch(derivation, spec.composition, spec.until)
    start = spec.start
    steps = math.ceil(spec.duration / spec.scene.numerics.step - 1e-9)
    every = None if spec.poses is None else max(1, round(spec.poses / spec.scene.numerics.step))
    frames: list[tuple[float, np.ndarray, np.ndarray, np.ndarray]] = []
    cpu, wall = time.process_time(), time.perf_counter()
    outcome = COMPLETED
    with World(spec.scene, book, spec.n_cubes, spec.streams) as world:
        world.listeners.append(watch)
        world.hit_listeners.append(watch.log_hit)
        world.populate(start)
        for step in range(1, steps + 1):
            if every is not None and (step - 1) % every == 0:
                frames.append(world.snapshot())
            if look is not None:
                look(world)
            seen = len(watch.events)
            watch.step, watch.time = step, step * world.step_size
            try:
                world.step()
            except Stopped as reason:
                outcome = f"stopped: {reason}"
                break
            if spec.restart and len(watch.events) > seen:
                # Only the first event counts; a second one within the same step belongs to a state nobody chose.
                watch.events[seen + 1 :] = [RunEvent(watch.time, RESTART)]
                world.populate(start)
            if progress is not None and step % PROGRESS_STEPS == 0:
                progress(world.time)
            if watch.is_reached:
                break
        end = world.time
        if look is not None:
            look(world)
        if every is not None:
            frames.append(world.snapshot())
    arrays: dict[str, np.ndarray] = {
        "initial": watch.initial,
        "times": np.array([event.time for event in watch.events], np.float64),
        "channels": np.array([event.channel for event in watch.events], np.int64),
        "bonds": np.array([event.bond for event in watch.events], np.int16).reshape(-1, 2),
        "partners": np.array([event.partner for event in watch.events], np.int16),
    }
    breaking = spec.scene.provider("breaking")
    if breaking is not None and breaking.log_above is not None:
        arrays |= watch.log.arrays(lru_cache(None)(watch.break_channel), derivation.species_of)
    if every is not None:
        for name, values in zip(("pose_times", "centres", "axes", "slots"), zip(*frames, strict=True), strict=True):
            arrays[name] = np.array(values)
    facts = {
        "end": end,
        "steps": world.step_count,
        "species": list(derivation.network.species),
        "channels": list(derivation.network.channels),
        "open_channels": open_channels(spec.scene, derivation).tolist(),
    }
    cost = {"cpu_seconds": time.process_time() - cpu, "wall_seconds": time.perf_counter() - wall}
    return RunRecord(spec, outcome, arrays, facts, cost)


def open_channels(scene: Scene, derivation: Derivation) -> np.ndarray:
    """Channels (R,) bool that the scene's effects can make happen."""
    return np.array([bool(scene.openers(kind)) for kind in kinds(derivation)], bool)


def kinds(derivation: Derivation) -> list[EventKind]:
    """The kind of each channel."""
    return ["join" if len(event.before) > 1 else "break" for event in derivation.events]
