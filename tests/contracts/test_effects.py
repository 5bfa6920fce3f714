"""What every effect must do: each case runs for each member of EFFECTS, at the settings of its `example`."""

import importlib
import inspect
import json
import math
import re
import tomllib
from pathlib import Path

import msgspec
import numpy as np
import pytest
from handling import run

import mechsim.inspection.cost_profile as profiles
from kinetics.assembly import RuleBook, derive
from kinetics.support.settings import described, validated
from mechsim.effects import EFFECTS
from mechsim.effects.base import Action, Effect, FlowSource, Stopped
from mechsim.runs.record import RunSpec, execute
from mechsim.scene import Scene
from mechsim.world.world import World

BOOK = RuleBook.load("line4")
STRUCTURES = derive(BOOK).structures
START = {"monomer": 3, "dimer": 1}
UNIT = re.compile(r"\b(length|tu|mass|rad|degrees|edges|ratio|number|probability|unit)\b")
# What a step does beside effects.
WORK = {"guard", "fluid", "free spin", "motions into the engine", "engine", "free flight", "reading back"}
WORK |= {"places of cubes"}


def name_of(kind):
    return kind.name()


every_effect = pytest.mark.parametrize("kind", EFFECTS, ids=name_of)


def settings_of(kind):
    """A table of a scene."""
    return {"effect": name_of(kind)} | kind.example


def needed_by(kind):
    """Effects that a scene with this one must list, what these need included."""
    found = []
    for need in kind.needs:
        able = [other for other in EFFECTS if need in (name_of(other), other.provides)]
        best = next((other for other in able if name_of(other) == need), able[0])
        found += [other for other in (best, *needed_by(best)) if other not in found]
    return found


def scene_of(*tables):
    """A small tank with these effects."""
    data = {
        "name": "contract", "rules": "line4", "tank": {"size": [1.0, 1.0, 1.0]}, "cubes": {"edge": 0.15},
        "numerics": {"step": 0.00525}, "effects": list(tables),
    }  # fmt: skip
    return validated(Scene, data, "scene")


def scene_with(kind, **settings):
    """With the effect and what it needs, and nothing else."""
    return scene_of(settings_of(kind) | settings, *map(settings_of, needed_by(kind)))


@pytest.fixture
def world_of():
    """world_of(scene): a populated world, freed after the test."""
    made = []

    def make(scene):
        start = [STRUCTURES[name] for name, n in START.items() for _ in range(n)]
        made.append(World(scene, BOOK, sum(map(len, start)), np.random.SeedSequence(1)))
        made[-1].populate(start)
        return made[-1]

    yield make
    for world in made:
        world.engine.close()


def own_settings(kind):
    return list(kind.__struct_fields__)


def leaves(value, path=()):
    """Places of all values within tables and lists."""
    if isinstance(value, dict | list):
        for key, inner in value.items() if isinstance(value, dict) else enumerate(value):
            yield from leaves(inner, (*path, key))
    else:
        yield path, value


def replaced(table, path, value):
    """A copy with another value at a place."""
    table = json.loads(json.dumps(table))
    inner = table
    for key in path[:-1]:
        inner = inner[key]
    inner[path[-1]] = value
    return table


def toml_of(value):
    """A value as TOML writes it."""
    if isinstance(value, dict):
        return "{" + ", ".join(f"{key} = {toml_of(inner)}" for key, inner in value.items()) + "}"
    if isinstance(value, list):
        return "[" + ", ".join(map(toml_of, value)) + "]"
    return json.dumps(value)


# -- what it says of itself --------------------------------------------------------------------------------------------


@every_effect
def test_it_has_a_name_of_its_own_and_lives_in_the_file_of_that_name(kind):
    name = name_of(kind)
    assert re.fullmatch(r"[a-z]+(-[a-z]+)*", name)
    assert [name_of(other) for other in EFFECTS].count(name) == 1
    assert kind.__module__ == f"mechsim.effects.{name.replace('-', '_')}"
    assert kind.__name__ == "".join(word.capitalize() for word in name.split("-"))


@every_effect
def test_it_documents_every_setting_and_the_unit_of_every_number(kind):
    """In the docstring of the class that has the setting, as `name : what it is, unit`."""
    texts = [base.__doc__ or "" for base in kind.__mro__ if issubclass(base, Effect) and base is not Effect]
    assert texts[0].strip()
    assert importlib.import_module(kind.__module__).__doc__
    types = {each.name: each.type for each in msgspec.structs.fields(kind)}
    for name in own_settings(kind):
        entries = [
            found[1]
            for text in texts
            for found in re.finditer(rf"^ {{4}}(?:\w+, )*{name}(?:, \w+)* : (.+(?:\n {{5,}}.+)*)", text, re.MULTILINE)
        ]
        assert entries, f"{name} is not documented"
        if "a number" in described(types[name]):
            assert UNIT.search(entries[0]), f"{name} has no unit"


@every_effect
def test_what_it_needs_exists_and_a_scene_without_that_is_refused(kind):
    for need in kind.needs:
        able = [name_of(other) for other in EFFECTS if need in (name_of(other), other.provides)]
        assert able
        others = [settings_of(other) for other in needed_by(kind) if name_of(other) not in able]
        with pytest.raises(ValueError, match=f"effect '{name_of(kind)}' needs effect '{need}'"):
            scene_of(settings_of(kind), *others)


@every_effect
def test_a_scene_lists_it_once(kind):
    with pytest.raises(ValueError, match=f"effect '{name_of(kind)}' is listed twice"):
        scene_of(settings_of(kind), settings_of(kind), *map(settings_of, needed_by(kind)))


# -- its settings ------------------------------------------------------------------------------------------------------


@every_effect
def test_its_settings_come_back_from_a_toml_file(kind):
    effect = kind(**settings_of(kind))
    for table in (settings_of(kind), effect.as_dict()):
        text = "\n".join(f"{key} = {toml_of(value)}" for key, value in table.items())
        assert kind(**tomllib.loads(text)) == effect


@every_effect
def test_bad_settings_are_refused_by_name(kind):
    table = kind(**settings_of(kind)).as_dict()
    with pytest.raises(ValueError, match="unheard_of"):
        kind(**table | {"unheard_of": 1})
    for name in own_settings(kind):
        with pytest.raises(ValueError, match=name):
            kind(**table | {name: object()})
    for path, value in leaves(table):
        numbers = [math.nan, math.inf, -math.inf, "many"] if isinstance(value, int | float) else []
        for bad in numbers:
            with pytest.raises(ValueError, match=str(path[0])):
                kind(**replaced(table, path, bad))


@every_effect
def test_its_settings_are_part_of_a_scenes_name_and_frozen(kind):
    scene = scene_with(kind)
    assert scene.fingerprint != scene_of(*map(settings_of, needed_by(kind))).fingerprint
    assert scene.fingerprint == scene_with(kind, **kind.example).fingerprint
    for name in own_settings(kind):
        with pytest.raises(AttributeError, match="immutable"):
            setattr(scene.effects[0], name, None)


# -- in a world --------------------------------------------------------------------------------------------------------


@every_effect
def test_it_is_built_where_it_is_listed_and_nowhere_else(kind, world_of, monkeypatch):
    built = []
    attach = kind.attach
    monkeypatch.setattr(kind, "attach", lambda self, world: built.append(name_of(kind)) or attach(self, world))
    others = [settings_of(other) for other in needed_by(kind)]
    bare = world_of(scene_of(*others))
    assert not built
    assert name_of(kind) not in dict(bare.parts)
    world = world_of(scene_with(kind))
    assert built == [name_of(kind)]
    assert {name for name, _ in world.parts} <= WORK | {name_of(other) for other in (kind, *needed_by(kind))}


@every_effect
def test_the_same_seed_gives_the_same_record(kind):
    """Bit for bit, poses included."""
    spec = RunSpec(scene_with(kind), START, 0.2, seed=3, run=0, poses=0.02)
    one, two = execute(spec), execute(spec)
    assert one.completed
    assert one.digest == two.digest
    other = execute(RunSpec(spec.scene, START, 0.2, seed=4, run=0, poses=0.02))
    assert not np.array_equal(one.arrays["centres"], other.arrays["centres"])


@every_effect
def test_it_only_writes_motions_before_the_step(kind, world_of):
    """Poses, masses, the engine and the field are not its own; a source of flow changes its own flow alone."""
    world = world_of(scene_with(kind))
    b = world.bodies
    for _ in range(3):
        world.step()
    hook = world.before.get(name_of(kind))
    if hook is None:
        return
    held = [world.fluid, b.position, b.orientation, b.mass, b.inertia, b.centre, b.axes, b.offset, b.turn]
    held += [source.flow for name, source in world.sources.items() if name != name_of(kind)]
    if isinstance(hook.__self__, FlowSource):
        held += [b.velocity, b.spin]
    before = [array.tobytes() for array in held]
    hook()
    assert [array.tobytes() for array in held] == before


@every_effect
def test_as_a_source_of_flow_it_is_one_term_of_the_field(kind, world_of):
    """With a steady flow listed beside it, which is the same in every step; what the field was does not enter it."""

    class Steady(Effect, tag="steady"):
        def attach(self, world):
            class Flowing(FlowSource):
                def before_step(self):
                    self.flow[:] = 1.0

            return Flowing()

    scene = scene_with(kind)
    world = world_of(msgspec.structs.replace(scene, effects=(Steady(), *scene.effects)))
    own = world.sources.get(name_of(kind))
    for _ in range(4):
        world.step()
        np.testing.assert_array_equal(world.sources["steady"].flow, 1.0)
        np.testing.assert_array_equal(world.fluid, 1.0 if own is None else 1.0 + own.flow)
    if own is not None:
        assert own.flow.shape == world.fluid.shape == (5, len(world.drag_points), 3)
        world.fluid[:] = np.nan
        world.before[name_of(kind)]()
        assert np.isfinite(own.flow).all()


@pytest.mark.parametrize("poison", [np.nan, np.inf, -np.inf])
@every_effect
def test_a_motion_that_is_not_a_number_is_laid_at_its_door(kind, world_of, poison):
    """Where it acts before the step; body and effect are named."""
    world, name = world_of(scene_with(kind)), name_of(kind)
    slot = int(world.bodies.live[-1])
    hook = world.before.get(name)

    def poisoned():
        hook()
        if world.step_count == 3:
            world.bodies.spin[slot, 1] = poison

    world.parts = [(part, poisoned if hook and part == name else work) for part, work in world.parts]
    if hook is None:
        for _ in range(5):
            world.step()
        return
    said = rf"effect '{name}' produced a motion that is not a number: body {slot} \(cubes 3, 4\)"
    with pytest.raises(Stopped, match=said):
        run(world, 1.0)
    assert world.step_count == 3


@every_effect
def test_it_acts_through_hooks_that_the_step_runs(kind, world_of):
    world = world_of(scene_with(kind))
    assert isinstance(kind(**settings_of(kind)).attach(world_of(scene_with(kind))), Action)
    parts = [name for name, _ in world.parts]
    for hooks in (world.before, world.after):
        assert set(hooks) <= set(parts)
    if kind.opens:
        assert name_of(kind) in world.after  # events come of what a step did


@every_effect
def test_the_bill_lists_it(kind, world_of, monkeypatch):
    """By a clock that only counts, so that nothing depends on the machine."""
    ticks = iter(range(0, 10**9, 1000))
    monkeypatch.setattr(profiles, "_breaks", int)
    scene = scene_with(kind)
    profile = profiles.cost_profile(world_of(scene), "contract", blocks=8, warm_up=1, clock=lambda: next(ticks))
    listed = [item.name for item in profile.items if item.kind.startswith("effect")]
    assert listed == [effect.effect for effect in scene.effects]


def test_every_file_of_an_effect_is_listed():
    """A file that no scene can name would be dead code."""
    files = Path(inspect.getfile(Effect)).parent.glob("*.py")
    assert {
        str(file) for file in files if re.search(r'^class \w+\((?!Settings).*tag="', file.read_text(), re.MULTILINE)
    } == set(map(inspect.getfile, EFFECTS))
