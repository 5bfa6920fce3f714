"""What every engine must be: each case runs for each member of ENGINES."""

import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from handling import collide, put

from kinetics.assembly import RuleBook, derive
from kinetics.support.packages import EXTRAS
from mechsim.inspection.cost_profile import _damping
from mechsim.runs.ensemble import run_all
from mechsim.runs.record import RunSpec, execute
from mechsim.runs.store import RunStore, digest_of
from mechsim.scene import Scene
from mechsim.world import engines
from mechsim.world.engines import ENGINES, Engine, EngineEntry, engine_named
from mechsim.world.engines.base import CONTINUOUS, LEAST_BOUNCE, RECOVERY, SLEEPING
from mechsim.world.world import World

every_engine = pytest.mark.parametrize("entry", ENGINES, ids=lambda entry: entry.name)
BOOK = RuleBook.load("line4")
START = {"monomer": 6, "dimer": 3, "trimer": 2, "quadmer": 2}


def scene_with(engine, scene="line4"):
    """A shipped scene computed by this engine."""
    data = Scene.load(scene).as_dict()
    data["numerics"]["engine"] = engine
    return Scene(**data)


def installed(entry):
    """Skip where a package that it needs cannot be installed."""
    for package in entry.packages:
        pytest.importorskip(package)


@pytest.fixture
def world_of():
    """world_of(scene, start): a populated world, by default of 24 cubes in a small tank, freed after the test."""
    made = []

    def make(scene, start=START):
        tight = scene.replace(tank=scene.tank.replace(size=(0.9, 0.9, 0.9)))
        structures = derive(BOOK).structures
        start = [structures[name] for name, n in start.items() for _ in range(n)]
        made.append(World(tight, BOOK, sum(map(len, start)), np.random.SeedSequence(1)))
        made[-1].populate(start)
        return made[-1]

    yield make
    for world in made:
        world.engine.close()


@every_engine
def test_it_has_a_name_of_its_own_and_lives_in_the_file_of_that_name(entry):
    assert re.fullmatch(r"[a-z]+", entry.name)
    assert [other.name for other in ENGINES].count(entry.name) == 1
    installed(entry)
    assert entry.home == f"mechsim.world.engines.{entry.name}_engine"
    kind = entry.load()
    assert issubclass(kind, Engine)
    assert kind.__doc__.strip()


def test_every_file_of_an_engine_is_listed():
    """A file that no scene can name would be dead code."""
    files = Path(engines.__file__).parent.glob("*_engine.py")
    assert {file.stem for file in files} == {entry.home.rpartition(".")[2] for entry in ENGINES}


@every_engine
def test_another_engine_is_not_imported_with_it(entry):
    """Nor is a package that only another needs, so that one engine works where another cannot be installed."""
    installed(entry)
    others = [other for other in ENGINES if other is not entry]
    extra = {package for other in others for package in other.packages} & set(EXTRAS) - set(entry.packages)
    code = (
        f"import sys\nfor name in {sorted(extra)}: sys.modules[name] = None\n"
        f"from mechsim.world.engines import engine_named\nkind = engine_named({entry.name!r}).load()\n"
        f"built_on = {{base.__module__ for base in kind.__mro__}}\n"
        f"assert not (set({[other.home for other in others]}) - built_on) & set(sys.modules)"
    )
    subprocess.run([sys.executable, "-W", "error", "-c", code], check=True, cwd=Path(__file__).parents[2])


@every_engine
def test_a_scene_names_it_and_so_does_a_record(entry):
    """Except the first, whose scenes and runs keep the names that they had before there were several."""
    installed(entry)
    scene, plain = scene_with(entry.name), Scene.load("line4")
    spec = RunSpec(scene, {"monomer": 2}, 1.0, seed=1, run=0)
    told = ("engine",) if entry.version > 1 else ()
    assert set(spec.inputs["physics"]) == {"wellmixed", "numpy", *entry.packages, *told}
    assert (scene.fingerprint == plain.fingerprint) == (entry is ENGINES[0])
    assert spec.inputs["scene"]["numerics"].get("engine", ENGINES[0].name) == entry.name
    assert RunSpec.of_inputs(spec.inputs, "a.run").key == spec.key


@every_engine
def test_runs_by_two_versions_of_it_have_two_names(entry, monkeypatch):
    """An engine that makes another record of the same inputs gets another version, and its runs another key."""
    installed(entry)
    spec = RunSpec(scene_with(entry.name), {"monomer": 2}, 1.0, seed=1, run=0)
    keys = {spec.key}
    for version in {1, entry.version + 1} - {entry.version}:
        others = [other if other is not entry else entry._replace(version=version) for other in ENGINES]
        monkeypatch.setattr(engines, "ENGINES", tuple(others))
        keys.add(RunSpec(scene_with(entry.name), {"monomer": 2}, 1.0, seed=1, run=0).key)
    assert len(keys) == len({1, entry.version, entry.version + 1})


def test_the_first_version_of_an_engine_is_not_told():
    """Runs by the first engine keep the key that they had before there were versions; our own has changed."""
    assert {entry.name: entry.version for entry in ENGINES} == {"pybullet": 1, "own": 2}


def test_scenes_keep_the_name_that_they_had_before_there_were_engines():
    """The hash with which the rates of results/line4 were measured."""
    assert Scene.load("line4").fingerprint == "23fb51b4d2d7a3a65367dc77e3e86766b0835053d306e438ecbe47211168d8a5"


def test_an_unknown_engine_is_refused():
    with pytest.raises(ValueError, match=f"unknown engine 'bullet'; expected one of {ENGINES[0].name}"):
        scene_with("bullet")


def test_an_engine_that_lacks_an_effect_of_the_scene_is_refused_before_it_is_imported(monkeypatch):
    lacking = EngineEntry("lacking", "no.such.module", "Nothing", (), lacks=("walls",))
    monkeypatch.setattr(engines, "ENGINES", (*ENGINES, lacking))
    assert engine_named("lacking") is lacking
    with pytest.raises(ValueError, match=r"engine 'lacking' lacks effect 'walls', .* choose numerics.engine from pyb"):
        scene_with("lacking")


# -- in a world --------------------------------------------------------------------------------------------------------


@every_engine
def test_what_is_in_force_is_what_the_scene_and_the_conventions_say(entry, world_of):
    installed(entry)
    scene = scene_with(entry.name).changed("contact", restitution=0.4, friction=0.7)
    world = world_of(scene)
    force = world.engine.in_force() | _damping(world)
    said = {
        "restitution": 0.4, "friction": 0.7, "step": scene.numerics.step, "substeps": 0, "gravity": 0,
        "solver_iterations": scene.numerics.solver_iterations, "inner_iterations": 1, "least_bounce": LEAST_BOUNCE,
        "overlap_recovery": RECOVERY, "sleeping": SLEEPING, "continuous_collision": CONTINUOUS, "rolling_friction": 0,
        "spinning_friction": 0, "contact_damping": -1, "contact_stiffness": -1, "mass_error": 0, "inertia_error": 0,
        "linear_damping": 0, "angular_damping": 0, "differences": 0,
    }  # fmt: skip
    assert 0 <= force.pop("margin") <= 0.001
    assert force == pytest.approx(said, abs=1e-12)


@every_engine
def test_its_touches_account_for_what_bodies_received(entry, world_of):
    """Bodies by slot, a wall by -1; every impulse is on the first and, turned round, on the second."""
    installed(entry)
    world = world_of(scene_with(entry.name).without("bonding", "breaking"))
    b, of_walls, of_bodies = world.bodies, 0, 0
    names = [name for name, _ in world.parts]
    begin = names.index("motions into the engine")
    for _ in range(300):
        for k, (_, part) in enumerate(world.parts):
            if k == begin:
                before = b.mass[b.live, None] * b.velocity[b.live]
            part()
        received = np.zeros_like(b.velocity)
        for touch in world.engine.touches():
            for slot, sign in ((touch.a, 1), (touch.b, -1)):
                if slot >= 0:
                    received[slot] += sign * np.array(touch.impulse)
            of_walls += min(touch.a, touch.b) < 0
            of_bodies += min(touch.a, touch.b) >= 0
        np.testing.assert_allclose(b.mass[b.live, None] * b.velocity[b.live] - before, received[b.live], atol=1e-12)
        is_several = [len(members) > 1 for members in b.members] + [False]  # the last one: a wall, slot -1
        several = [touch for touch in world.engine.touches() if is_several[touch.a] or is_several[touch.b]]
        assert world.engine.touches(of_structures=True) == several
    assert min(of_walls, of_bodies) > 50


def thrown(world, axes, speed):
    """Throw body 0 along z at a cube, if there is one, or at the wall, so that they meet at each of 24 moments of a
    step; the speeds along z (24, 2) of its contact point before and after, relative to what it meets."""
    b, found = world.bodies, []
    other = 1 if len(b.live) > 1 else None
    put(world, 0, [0, 0, 0], axes)
    top = (b.centre[:, 2] + b.edge / 2 * np.abs(b.axes[:, 2]).sum(axis=1))[list(b.members[0])].max()
    wall = world.half[2] if other is None else -b.edge / 2
    for phase in range(24):
        if other is not None:
            put(world, other, [0, 0, 0])
        put(world, 0, [0, 0, wall - top - speed * world.step_size * phase / 24], axes, velocity=[0, 0, speed])
        while True:
            before = b.velocity.copy(), b.spin.copy()
            collide(world)
            touches = world.engine.touches()
            if touches:
                break
        place = np.mean([touch.place for touch in touches], axis=0)
        at = b.position - world.step_size * b.velocity  # where they touched
        slots = [0] if other is None else [0, other]
        speeds = [
            sum(sign * (v[s] + np.cross(w[s], place - at[s]))[2] for s, sign in zip(slots, (1, -1), strict=False))
            for v, w in (before, (b.velocity, b.spin))
        ]
        found.append(speeds)
    return np.array(found)


@every_engine
@pytest.mark.parametrize("restitution", [0.0, 0.3, 0.7, 1.0])
@pytest.mark.parametrize("speed", [0.3, 1.0, 3.0])
def test_restitution_comes_out_as_declared_wherever_in_a_step_bodies_meet(entry, restitution, speed, world_of):
    """Within 2 % of the speed of approach: a cube flat at a wall, one flat at a cube, a line of four by a corner."""
    installed(entry)
    scene = scene_with(entry.name).without("agitation", "drag", "bonding", "breaking")
    scene = scene.changed("contact", restitution=restitution, friction=0.0)
    tilted = np.linalg.qr(np.random.default_rng(1).standard_normal((3, 3)))[0]
    for start, axes in (({"monomer": 1}, np.eye(3)), ({"monomer": 2}, np.eye(3)), ({"quadmer": 1}, tilted)):
        seen = thrown(world_of(scene, start), axes, speed)
        np.testing.assert_allclose(seen[:, 0], speed, rtol=1e-6)
        np.testing.assert_allclose(-seen[:, 1], restitution * speed, atol=0.02 * speed)


@every_engine
@pytest.mark.parametrize(("speed", "bounces"), [(0.15, False), (0.25, True), (2.0, True)])
def test_touches_tell_whether_surfaces_came_fast_enough_to_bounce(entry, speed, bounces, world_of):
    """By their speed before any impulse, of bodies and of walls."""
    installed(entry)
    scene = scene_with(entry.name).without("agitation", "drag", "bonding", "breaking")
    for start, other in (({"monomer": 1}, None), ({"monomer": 2}, 1)):
        world = world_of(scene, start)
        edge = world.bodies.edge
        if other is not None:
            put(world, other, [0, 0, 0])
        put(world, 0, [0, 0, (0.45 if other is None else -edge / 2) - edge / 2 - 0.003], velocity=[0, 0, speed])
        while not world.engine.touches():
            collide(world)
        assert {touch.bounces for touch in world.engine.touches()} == {bounces}


@every_engine
def test_bodies_that_overlap_are_put_apart_after_their_impulses(entry, world_of):
    """A cube is struck .002 before a wall, by one that is .008 deep in it: the wall is none of this step's collisions,
    though the cube is then put .004 aside."""
    installed(entry)
    world = world_of(scene_with(entry.name).without("agitation", "drag", "bonding", "breaking"), {"monomer": 2})
    edge = world.bodies.edge
    at = 0.45 - 0.002 - edge / 2
    put(world, 0, [0, 0, at])
    put(world, 1, [0, 0, at - edge + 0.008], velocity=[0, 0, 1.0])
    collide(world)
    assert {frozenset(touch[:2]) for touch in world.engine.touches()} == {frozenset((0, 1))}
    # Restitution .3 leaves speeds of .35 and .65; both are put apart by half of the overlap, but for what may stay.
    step = world.step_size
    np.testing.assert_allclose(world.bodies.position[0, 2], at + 0.65 * step + 0.004, atol=2e-5)
    np.testing.assert_allclose(world.bodies.position[1, 2], at - edge + 0.008 + 0.35 * step - 0.004, atol=2e-5)
    collide(world)
    assert {frozenset(touch[:2]) for touch in world.engine.touches() if -1 in touch[:2]} == {frozenset((0, -1))}


@every_engine
def test_the_same_seed_gives_the_same_record_for_any_number_of_workers(entry, tmp_path):
    installed(entry)
    specs = [RunSpec(scene_with(entry.name), START, 0.25, seed=1, run=run, poses=0.05) for run in range(3)]
    here = digest_of(map(execute, specs))
    assert here == digest_of(map(execute, specs))
    assert run_all(specs, RunStore(tmp_path), workers=2).digest == here


def test_an_engine_works_where_the_packages_of_another_are_not_installed():
    """A whole run, its name included."""
    code = (
        "import sys\nsys.modules['pybullet'] = None\nfrom importlib import metadata\nfrom pathlib import Path\n"
        "from mechsim import RunSpec, Scene, execute\nfrom mechsim.runs import record\n"
        "def version(name):\n    assert name != 'pybullet'\n    return metadata.version(name)\n"
        "record.version = version\n"
        "data = Scene.load('line4').as_dict()\ndata['numerics']['engine'] = 'own'\n"
        "run = execute(RunSpec(Scene(**data), {'monomer': 8}, 0.1, seed=1, run=0))\n"
        "assert run.completed and run.digest"
    )
    subprocess.run([sys.executable, "-W", "error", "-c", code], check=True, cwd=Path(__file__).parents[2])
