"""Hard cases of time and space: steps, speeds, spins, edges, crowds and a million steps, each with its pass criterion.

What is tested where it belongs is not repeated here:
- contacts, mass ratios, bonds that meet, what is not a number: test_hard_contacts
- without drag and contact nothing is lost, impulses account for every change of velocity: test_engine
- undeclared damping, margins, friction are an error: test_cost_profile
- a step above an agitation's bound: test_agitation
- the densest tanks of the paper are filled without overlap: test_placement
"""

import resource

import numpy as np
import pytest
from handling import act, energy, events_of, put, run

from kinetics.assembly import RuleBook, Structure, derive
from mechsim.effects.base import Stopped
from mechsim.kernels.motion import coast
from mechsim.runs.record import RunSpec, execute
from mechsim.world.world import World

HALF_BUILT = {"monomer": 10, "dimer": 5, "trimer": 4, "quadmer": 4}
LONG = (pytest.mark.validate, pytest.mark.timeout(7200))


# -- the step, the agitation and the edge ------------------------------------------------------------------------------


@pytest.mark.parametrize("edge", [0.05, 0.15, 0.25])
@pytest.mark.parametrize("sigma", [1.0, 20.0])
@pytest.mark.parametrize("step", [1 / 10, 1 / 60, 1 / 960])
def test_drag_stays_finite_at_any_step_and_agitation(make_world, scene_of, step, sigma, edge):
    """No guard, no walls: the semi-implicit step alone must hold speeds below the fluid's largest, however long the
    step is to the relaxation time (up to 1/10 tu to 1/900 tu)."""
    held = {"effect": "agitation", "sigma": sigma, "hold": max(step, 1 / 60) if step < 1 / 60 else step}
    world = make_world(HALF_BUILT, scene_of(held, "drag", step=step, edge=edge))
    b = world.bodies
    fastest = 0.0
    for _ in range(300):
        act(world)
        coast(b.live, b.position, b.orientation, b.velocity, b.spin, b.inertia, step)
        world.step_count += 1
        fastest = max(fastest, float(np.abs(b.velocity[b.live]).max()))
    for values in (b.position, b.orientation, b.velocity, b.spin):
        assert np.isfinite(values[b.live]).all()
    assert 0.01 * sigma < fastest < 5 * sigma  # one point's largest component in 300 draws is 5 sigma or so


@pytest.mark.parametrize("step", [1 / 10, 1 / 30, 1 / 120, 1 / 480])
@pytest.mark.parametrize("sigma", [1.0, 5.0, 20.0])
def test_a_whole_scene_ends_well_or_by_a_named_outcome(line4, scene_of, step, sigma):
    """With walls, contacts and bonds: the run completes, or the guard says which body did what. Never anything else."""
    held = {"effect": "agitation", "sigma": sigma, "hold": max(round(1 / 60 / step), 1) * step}
    names = [effect.effect for effect in line4.effects if effect.effect != "agitation"]
    record = execute(RunSpec(scene_of(held, *names, step=step), HALF_BUILT, 0.5, seed=1, run=0, poses=0.25))
    assert np.isfinite(record.arrays["centres"]).all()
    if sigma * step < 0.2 * 0.15:  # in a step the fluid moves by less than a fifth of an edge
        assert record.completed
    elif not record.completed:
        assert "body" in record.outcome
        assert any(word in record.outcome for word in ("tunnelling", "spin", "runaway", "escaped"))
    sizes = derive(RuleBook.load("line4")).network.conserved["cubes"]
    assert (record.path.states @ sizes == 48).all()


@pytest.mark.parametrize("edge", [0.05, 0.1, 0.2, 0.25])
def test_a_whole_scene_of_any_edge(line4, edge):
    """At the scene's own step. Cubes of a third of the edge are turned nine times as fast: the guard may say so."""
    scene = line4.replace(cubes=line4.cubes.replace(edge=edge))
    record = execute(RunSpec(scene, HALF_BUILT, 1.0, seed=1, run=0, poses=0.5))
    assert np.isfinite(record.arrays["centres"]).all()
    assert record.completed == (edge > 0.05)
    assert record.completed or record.outcome.startswith("stopped: spin beyond what a step resolves: body")


def mean_speed(world, duration):
    seen = []
    while world.time < 0.5 + duration:
        world.step()
        if world.time > 0.5:
            seen.append(np.linalg.norm(world.bodies.velocity[world.bodies.live], axis=1).mean())
    return float(np.mean(seen))


@pytest.mark.validate
@pytest.mark.parametrize("sigma", [3.0, 5.0])
def test_speed_is_within_1_percent_from_half_the_default_step_downwards(make_world, line4, sigma):
    """At a fixed hold of 0.0105 tu, of which the default step is a half; 60 cubes for 40 tu resolve 0.2 %."""
    scene = line4.without("bonding", "breaking").changed("agitation", sigma=sigma)
    speeds = []
    for parts in (4, 8, 16):
        numerics = scene.numerics.replace(step=0.0105 / parts)
        world = make_world({"monomer": 60}, scene.replace(numerics=numerics), seed=parts)
        speeds.append(mean_speed(world, 40))
    assert speeds[0] == pytest.approx(speeds[2], rel=0.01)
    assert speeds[1] == pytest.approx(speeds[2], rel=0.01)


# -- energy and momentum -----------------------------------------------------------------------------------------------


@pytest.mark.parametrize("step", [1 / 60, 0.00525, 1 / 960])
@pytest.mark.parametrize("spin", [(8.0, 0.5, 8.0), (13.0, 1.0, 0.2), (0.3, 0.2, 20.0)])
def test_a_spun_line_without_drag_keeps_energy_and_angular_momentum(make_world, scene_of, step, spin):
    """Within 1 % and 0.1 % over 10 tu; the engine's own step multiplies the energy by up to 90."""
    world = make_world({"quadmer": 1}, scene_of("walls", step=step))
    b, slot = world.bodies, int(world.bodies.live[0])
    put(world, slot, [0, 0, 0], spin=spin)
    before, momentum = energy(world), b.momentum()[1]
    for _ in range(round(10 / step)):
        world.step()
        assert energy(world) == pytest.approx(before, rel=1e-3)
    np.testing.assert_allclose(b.momentum()[1], momentum, atol=1e-9 * np.linalg.norm(momentum))


def test_the_engines_own_spin_does_not(make_world, scene_of):
    """Control: why it is taken over."""
    world = make_world({"quadmer": 1}, scene_of("walls", step=1 / 60))
    put(world, int(world.bodies.live[0]), [0, 0, 0], spin=(8.0, 0.5, 8.0))
    before = energy(world)
    world.parts = [(name, part) for name, part in world.parts if name not in ("free spin", "guard")]
    run(world, 10)
    assert energy(world) > 10 * before


def test_a_body_without_symmetry_keeps_them_too(scene_of):
    """Three different moments: energy swings by the square of the step, and comes back."""
    book = RuleBook.load("t5")
    shape = Structure(((0, 0, 0), (1, 0, 0), (2, 0, 0), (2, 1, 0), (2, 1, 1)), (0,) * 5, (book.monomer().letters * 5))
    swings = []
    for step in (1 / 120, 1 / 240):
        with World(scene_of("walls", step=step), book, 5, np.random.SeedSequence(1)) as world:
            world.populate([shape])
            slot = int(world.bodies.live[0])
            put(world, slot, [0, 0, 0], spin=(7.0, -5.0, 6.0))
            before, momentum = energy(world), world.bodies.momentum()[1]
            seen = []
            while world.time < 10:
                world.step()
                seen.append(energy(world) / before - 1)
            np.testing.assert_allclose(world.bodies.momentum()[1], momentum, rtol=1e-9)
            assert np.abs(seen).max() < 0.01
            first, last = np.abs(seen[: len(seen) // 4]).max(), np.abs(seen[-len(seen) // 4 :]).max()
            assert last < 1.5 * first + 1e-9  # no drift
            swings.append(np.abs(seen).max())
    assert swings[1] < 0.5 * swings[0]


@pytest.mark.parametrize("restitution", [0.0, 0.5, 0.9])
@pytest.mark.parametrize("step", [1 / 120, 1 / 240])
def test_a_gas_in_a_box_gains_no_energy(make_world, scene_of, restitution, step):
    contact = {"effect": "contact", "restitution": restitution, "friction": 0.3}
    scene = scene_of("walls", contact, step=step, tank=[1.0, 1.0, 1.0])
    world = make_world({"monomer": 20, "dimer": 3, "quadmer": 2}, scene)
    rng = np.random.default_rng(3)
    for slot in world.bodies.live:
        world.bodies.velocity[slot], world.bodies.spin[slot] = rng.standard_normal((2, 3)) * [[1.0], [3.0]]
    begin = highest = energy(world)
    hits = 0
    for _ in range(round(4 / step)):
        world.step()
        hits += len(world.engine.touches())
        highest = max(highest, energy(world))
    assert hits > 300
    assert highest < 1.01 * begin
    assert energy(world) < begin


@pytest.mark.parametrize(("friction", "least", "most"), [(0.0, 0.95, 1.05), (0.3, 0.0, 0.9)])
def test_an_elastic_gas_keeps_its_energy(make_world, scene_of, friction, least, most):
    """At restitution 1, some 30 collisions a cube: PyBullet adds up to 3 %, our engine a tenth of a percent. Control:
    with friction it is lost."""
    contact = {"effect": "contact", "restitution": 1.0, "friction": friction}
    world = make_world({"monomer": 40}, scene_of("walls", contact, tank=[1.2, 1.2, 1.2]))
    b = world.bodies
    b.velocity[b.live] = np.random.default_rng(3).standard_normal((len(b.live), 3))
    begin, hits = energy(world), 0
    while world.time < 3:
        world.step()
        hits += len(world.engine.touches()) > 0
    assert hits > 100
    assert least < energy(world) / begin < most


def test_without_fluid_and_contact_nothing_changes_a_momentum(make_world, scene_of):
    """Zero fluid, no contact: linear and angular momentum within 1e-9 over 10 tu, structures tumbling."""
    world = make_world(HALF_BUILT, scene_of())
    b, rng = world.bodies, np.random.default_rng(7)
    b.velocity[b.live], b.spin[b.live] = rng.standard_normal((2, len(b.live), 3)) * [[[1.0]], [[8.0]]]
    linear, angular = b.momentum()
    run(world, 10)
    np.testing.assert_allclose(b.momentum()[0], linear, rtol=0, atol=1e-9 * np.linalg.norm(linear))
    np.testing.assert_allclose(b.momentum()[1], angular, rtol=0, atol=1e-9 * np.linalg.norm(angular))


# -- fast cubes --------------------------------------------------------------------------------------------------------


def fly_at_a_wall(make_world, scene, speed, ahead):
    """A cube at this speed whose face is so far from a wall."""
    world = make_world({"monomer": 1}, scene)
    put(world, 0, [0, 0, 1.5 - world.bodies.edge / 2 - ahead], velocity=[0, 0, speed])
    return world


THIN = {"effect": "walls", "thickness": 0.01}
FAST = {"max_speed": 100.0}


@pytest.mark.parametrize("phase", [0.0, 0.25, 0.5, 0.75, 0.999])
def test_a_cube_at_speed_60_does_not_pass_a_thin_wall(make_world, scene_of, phase):
    """Just within the guard's bound of half an edge a step: its middle is still inside when the wall is found."""
    step = 0.499 * 0.15 / 60
    world = fly_at_a_wall(make_world, scene_of(THIN, "contact", step=step, guard=FAST), 60.0, (3 + phase) * 60 * step)
    run(world, 0.01)
    assert world.bodies.velocity[0, 2] < -0.3 * 60 + 0.1
    assert world.bodies.position[0, 2] < 1.5


@pytest.mark.parametrize(
    ("step", "guard", "said"),
    [
        (0.00525, {}, "runaway speed: body 0"),
        (0.00525, FAST, "tunnelling risk: a body moves more than half an edge in a step: body 0"),
        (0.501 * 0.15 / 60, FAST, "tunnelling risk"),
    ],
)
def test_a_cube_too_fast_for_the_step_is_refused_by_name(make_world, scene_of, step, guard, said):
    """Engines do not look along the way (PyBullet's continuous collision detection does nothing for such bodies)."""
    world = fly_at_a_wall(make_world, scene_of(THIN, "contact", step=step, guard=guard), 60.0, 0.4)
    with pytest.raises(Stopped, match=said):
        world.step()
    assert world.step_count == 1


def test_an_engine_alone_lets_a_fast_cube_through_another(make_world, scene_of):
    """Control: why there is a guard."""
    world = make_world({"monomer": 2}, scene_of("contact", guard=FAST))
    put(world, 0, [0, 0, 0])
    put(world, 1, [0, 0, -0.16], velocity=[0, 0, 60.0])
    world.parts = [(name, part) for name, part in world.parts if name != "guard"]
    run(world, 0.05)
    np.testing.assert_allclose(world.bodies.velocity, [[0, 0, 0], [0, 0, 60]], atol=1e-12)
    assert world.bodies.position[1, 2] > 2.0


# -- crowds and plates -------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("steps", [400, pytest.param(100_000, marks=LONG)])
def test_120_large_cubes_run_in_the_papers_tank(make_world, line4, steps):
    large = line4.replace(cubes=line4.cubes.replace(edge=0.25))
    world = make_world({"monomer": 120}, large)
    b = world.bodies
    for _ in range(steps):
        world.step()  # no guard trip, so no escape
    assert sum(len(b.members[s]) for s in b.live) == 120
    assert (np.abs(b.centre) < np.array([1, 1, 1.5])).all()


def test_a_plate_of_25_cubes_under_strong_agitation_stays_a_plate(line4, book):
    """Sigma 12, three times the paper's: a compound has no joints that could open."""
    plate = Structure(tuple((x, y, 0) for x in range(5) for y in range(5)), (0,) * 25, ("a",) * 25)
    scene = line4.without("bonding", "breaking").changed("agitation", sigma=12.0)  # free cubes reach 200 rad / tu
    scene = scene.replace(numerics=scene.numerics.replace(step=0.002625))
    with World(scene, book, 55, np.random.SeedSequence(2)) as world:
        world.populate([plate, plate, *[book.monomer()] * 5])
        b = world.bodies
        for _ in range(1500):
            world.step()
        for slot in b.live:
            cubes = list(b.members[slot])
            places = (np.asarray(b.held(slot).positions) - b.shape(slot).centre) * b.edge
            np.testing.assert_allclose(b.centre[cubes], b.position[slot] + places @ b.lattice(slot).T, atol=1e-12)


# -- long runs ---------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("steps", [5_000, pytest.param(1_000_000, marks=LONG)])
def test_many_steps_without_leak_or_drift(make_world, line4, steps, record_property):
    """Joins and breaks all along: resident memory, quaternions, cubes and the books of momentum stay as they were."""
    scene = line4.changed("bonding", latch={"kind": "encounter", "probability": 1.0})
    scene = scene.changed("breaking", threshold=0.003)
    tight = scene.replace(tank=scene.tank.replace(size=(0.8, 0.8, 0.8)))
    world = make_world({"monomer": 4, "quadmer": 2}, tight)
    b, seen = world.bodies, events_of(world)
    names = [name for name, _ in world.parts]
    books = names.index("guard", names.index("engine"))  # velocities are those of the engine's step
    parts = [part for _, part in world.parts]
    pushed, received, exchanged, warm = np.zeros(3), np.zeros(3), 0.0, 0
    for step in range(steps):
        for part in parts[: names.index("engine")]:
            part()
        before = b.velocity.copy()
        for part in parts[names.index("engine") : books]:
            part()
        change = np.zeros_like(before)
        for touch in world.engine.touches():
            for slot, sign in ((touch.a, 1), (touch.b, -1)):
                if slot >= 0:
                    change[slot] += sign * np.array(touch.impulse) / b.mass[slot]
        told = b.mass[b.live, None] * change[b.live]
        pushed += told.sum(axis=0)
        received += (b.mass[b.live, None] * (b.velocity - before)[b.live]).sum(axis=0)
        exchanged += np.abs(told).sum()
        if step % 50 == 0:
            np.testing.assert_allclose((b.velocity - before)[b.live], change[b.live], atol=1e-10)
            np.testing.assert_allclose(np.linalg.norm(b.orientation[b.live], axis=1), 1, atol=1e-12)
            assert sorted(c for s in b.live for c in b.members[s]) == list(range(12))
        for part in parts[books:]:
            part()
        if step == max(steps // 10, 2000):
            warm = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    assert len(seen) > steps / 500
    np.testing.assert_allclose(received, pushed, rtol=0, atol=1e-10 * exchanged)  # over all steps
    grown = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - warm
    record_property("events", len(seen))
    record_property("resident memory grown, KiB", grown)
    record_property("books off, relative", float(np.abs(received - pushed).max() / exchanged))
    assert grown < 20_000 + 2 * len(seen)  # KiB; the engine itself keeps about 1 kB of each body ever made
