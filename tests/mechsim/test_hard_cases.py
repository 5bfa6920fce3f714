"""Hard cases, each with its pass criterion. What is tested where it belongs is not repeated here:

- without drag and contact nothing is lost, impulses account for every change of velocity: test_engine
- undeclared damping, margins, friction are an error: test_bill
- explicit drag refuses where its bound is broken: test_drag; a step above an agitation's bound: test_agitation
- a snap into a third body waits, faces that have just parted have not met: test_bonding
- the densest tanks of the paper are filled without overlap: test_placement
"""

import math
import resource

import numpy as np
import pytest

from kinetics.assembly import RuleBook, Structure, derive
from mechsim.bodies import quaternion_of
from mechsim.effects.base import Stopped
from mechsim.kernels.contact import blocked
from mechsim.kernels.motion import coast
from mechsim.record import RunSpec, execute
from mechsim.world import World

HALF_BUILT = {"monomer": 10, "dimer": 5, "trimer": 4, "quadmer": 4}
LONG = (pytest.mark.validate, pytest.mark.timeout(7200))
CONTACT = {"effect": "contact", "restitution": 0.3, "friction": 0.3}


def energy(world):
    b = world.bodies
    return sum(
        0.5 * b.mass[s] * b.velocity[s] @ b.velocity[s] + 0.5 * b.spin[s] @ b.world_inertia(s) @ b.spin[s]
        for s in b.live
    )


def run(world, duration):
    while world.time < duration - 1e-9:
        world.step()


def put(world, slot, position, axes=None, velocity=(0, 0, 0), spin=(0, 0, 0)):
    b = world.bodies
    b.position[slot], b.velocity[slot], b.spin[slot] = position, velocity, spin
    b.orientation[slot] = [0, 0, 0, 1] if axes is None else quaternion_of(np.asarray(axes, float))
    world.engine.put(slot)
    b.locate()


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
        for hook in world.before.values():
            hook()
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
    if step < 1 / 60 and sigma < 20:
        assert record.completed
    elif not record.completed:
        assert "body" in record.outcome
        assert any(word in record.outcome for word in ("tunnelling", "spin", "runaway", "escaped"))
    sizes = derive(RuleBook.load("line4")).network.conserved["cubes"]
    assert (record.path.states @ sizes == 48).all()


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
        numerics = scene.numerics.model_copy(update={"step": 0.0105 / parts})
        world = make_world({"monomer": 60}, scene.model_copy(update={"numerics": numerics}), seed=parts)
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


def test_an_elastic_gas_is_refused(scene_of):
    """The engine takes overlaps back by a push that adds to the bounce: at 1 a gas would gain energy without end."""
    with pytest.raises(ValueError, match=r"less than or equal to 0\.9"):
        scene_of("walls", {"effect": "contact", "restitution": 1.0})


# -- contact -----------------------------------------------------------------------------------------------------------


def test_a_half_overlapping_start_is_rejected(make_world, scene_of):
    """Nothing puts two bodies into each other: neither the random start nor a bond's snap."""
    world = make_world({"monomer": 2}, scene_of("walls", "contact"))
    b = world.bodies
    put(world, 0, [0, 0, 0])
    centre, axes = np.array([[0.0, 0, b.edge / 2]]), np.eye(3)[None]
    skip = np.array([False, True])
    half = b.edge / 2
    assert blocked(centre, axes, b.centre, b.axes, skip, half, 1.0, -world.limit, world.limit)
    assert not blocked(2.1 * centre, axes, b.centre, b.axes, skip, half, 1.0, -world.limit, world.limit)
    with pytest.raises(ValueError, match="do not fit"):
        make_world({"monomer": 40}, scene_of("walls", "contact", tank=[0.4, 0.4, 0.5]))


@pytest.mark.parametrize("ratio", [1.0, 200.0, 1e4])
def test_mass_ratios_stay_bounded_and_keep_momentum(make_world, scene_of, ratio):
    world = make_world({"monomer": 2}, scene_of({"effect": "contact", "restitution": 0.5, "friction": 0.3}))
    b = world.bodies
    world.engine.remove(0)
    b.mass[0] *= ratio
    b.inertia[0] *= ratio
    world.engine.create(0)
    put(world, 0, [0, 0, 0])
    put(world, 1, [0.03, 0.02, 0.2], velocity=[0, 0, -2.0])
    linear, angular = b.momentum()
    start = energy(world)
    for _ in range(200):
        world.step()
        assert np.linalg.norm(b.velocity, axis=1).max() < 2.01
        assert energy(world) < 1.001 * start
    np.testing.assert_allclose(b.momentum()[0], linear, atol=1e-12 * abs(linear).max())
    np.testing.assert_allclose(b.momentum()[1], angular, atol=0.02 * abs(linear).max() * b.edge)
    assert b.velocity[1, 2] - b.velocity[0, 2] > 0.5  # they have parted


@pytest.mark.parametrize("ratio", [1.0, 200.0])
def test_a_heavy_cube_sinks_less_than_2_percent_into_a_light_one(make_world, scene_of, ratio):
    weight = {"effect": "buoyancy", "gravity": 1.0, "fluid_density": 0.0}
    world = make_world({"monomer": 2}, scene_of(weight, "walls", "contact"))
    b = world.bodies
    world.engine.remove(0)
    b.mass[0] *= ratio
    b.inertia[0] *= ratio
    world.engine.create(0)
    put(world, 1, [0, 0, -1.5 + 0.5 * b.edge])
    put(world, 0, [0, 0, -1.5 + 1.5 * b.edge])
    deepest = 0.0
    for _ in range(2000):
        world.step()
        deepest = max(deepest, b.edge - (b.position[0, 2] - b.position[1, 2]), -1.5 + b.edge / 2 - b.position[1, 2])
    assert deepest < 0.02 * b.edge
    assert np.abs(b.velocity).max() < 0.02
    assert np.abs(b.position[:, :2]).max() < 0.02 * b.edge


@pytest.mark.parametrize("steps", [400, pytest.param(100_000, marks=LONG)])
def test_120_large_cubes_run_in_the_papers_tank(make_world, line4, steps):
    large = line4.model_copy(update={"cubes": line4.cubes.model_copy(update={"edge": 0.25})})
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
    scene = scene.model_copy(update={"numerics": scene.numerics.model_copy(update={"step": 0.002625})})
    with World(scene, book, 55, np.random.SeedSequence(2)) as world:
        world.populate([plate, plate, *[book.monomer()] * 5])
        b = world.bodies
        for _ in range(1500):
            world.step()
        for slot in b.live:
            cubes = list(b.members[slot])
            places = (np.asarray(b.held(slot).positions) - b.shape(slot).centre) * b.edge
            np.testing.assert_allclose(b.centre[cubes], b.position[slot] + places @ b.lattice(slot).T, atol=1e-12)


# -- bonds -------------------------------------------------------------------------------------------------------------

EAGER = {"effect": "bonding", "latch": {"kind": "encounter", "probability": 1.0}}
BRITTLE = {"effect": "breaking", "threshold": 0.0005}


def events_of(world):
    seen = []
    world.listeners.append(lambda before, after: seen.append(([len(s) for s in before], [len(s) for s in after])))
    return seen


@pytest.mark.parametrize("tilt", [0.0, 20.0])
def test_docking_next_to_a_third_body_breaks_nothing(make_world, scene_of, tilt):
    """A cube snaps straight beside a line that lies close: bonds as brittle as these break in any collision, but the
    push that the snap may cause is none."""
    world = make_world({"monomer": 2, "trimer": 1}, scene_of(CONTACT, BRITTLE, EAGER))
    b, seen = world.bodies, events_of(world)
    run(world, 0.02)
    seen.clear()
    one, two, line = (int(s) for s in b.live)
    angle = math.radians(tilt)
    turn = np.array([[1, 0, 0], [0, math.cos(angle), -math.sin(angle)], [0, math.sin(angle), math.cos(angle)]])
    put(world, one, [0, 0, 0])
    put(world, two, [0, -0.3 * b.edge * math.sin(angle), 1.18 * b.edge], turn, velocity=[0, 0, -0.2])
    put(world, line, [1.16 * b.edge, 0, 0.6 * b.edge], np.array([[1, 0, 0], [0, 0, 1], [0, -1, 0]]))
    for _ in range(100):
        world.step()
    assert seen
    assert all(len(before) == 2 for before, _ in seen)  # joins alone


def test_two_bonds_on_one_face_in_one_step(make_world, scene_of):
    """Two cubes reach for one face at once. One gets it, the other stays as it is, whichever number they have."""
    made = []
    for order in ((0, 1, 2), (1, 2, 0), (2, 0, 1), (2, 1, 0)):
        world = make_world({"monomer": 3}, scene_of(CONTACT, EAGER | {"sideways": 1.0}))
        b, seen = world.bodies, events_of(world)
        run(world, 0.02)
        seen.clear()
        put(world, order[0], [0, 0, 0])
        for slot, x in zip(order[1:], (-0.995, 0.995), strict=True):
            put(world, slot, [x * b.edge, 0, 1.02 * b.edge])
        pairs = world.after["bonding"].__self__.faces.within_reach()
        assert {frozenset((i, j)) for i, _, j, _ in pairs.tolist()} == {frozenset(order[:2]), frozenset(order[::2])}
        world.step()
        made.append((seen, sorted(len(b.members[s]) for s in b.live)))
        assert sorted(c for s in b.live for c in b.members[s]) == [0, 1, 2]
        assert np.linalg.norm(b.position[b.live[0]] - b.position[b.live[1]]) > b.edge  # and they do not overlap
    assert made == [([([1, 1], [2])], [1, 2])] * 4


def test_a_bond_and_a_break_in_one_step_keep_all_cubes(make_world, scene_of, line4):
    """A line is hit so hard at one end that it breaks, while its other end takes a cube: the same comes of it in
    whatever order the scene lists the two effects."""
    for effects in ((CONTACT, BRITTLE | {"grace": 0.0}, EAGER), (CONTACT, EAGER, BRITTLE | {"grace": 0.0})):
        world = make_world({"monomer": 2, "trimer": 1}, scene_of(*effects))
        b, seen, together = world.bodies, events_of(world), 0
        ball, guest, line = (int(s) for s in b.live)
        run(world, 0.02)
        seen.clear()
        put(world, line, [0, 0, 0])
        axis = np.ptp(b.centre[list(b.members[line])], axis=0).argmax()
        cubes = sorted(b.members[line], key=lambda c: b.centre[c, axis])
        along = (b.centre[cubes[-1]] - b.centre[cubes[0]]) / (2 * b.edge)
        across = np.eye(3)[int(np.argmin(np.abs(along)))]
        axes = b.axes[cubes[-1]]
        put(world, ball, b.centre[cubes[0]] + (1.0 * b.edge + 0.018) * across, velocity=-6.0 * across)
        put(world, guest, b.centre[cubes[-1]] + 1.2 * b.edge * along, axes, velocity=-1.5 * along)
        for _ in range(20):
            already = len(seen)
            world.step()
            together += len(seen) - already == 2
            assert sorted(c for s in b.live for c in b.members[s]) == list(range(5))
            assert len(np.unique(b.body)) == len(b.live)
        assert together == 1
        assert seen == [([3], [1, 2]), ([2, 1], [3])]


# -- what is not a number ----------------------------------------------------------------------------------------------


@pytest.mark.parametrize("poison", [np.nan, np.inf, -np.inf])
@pytest.mark.parametrize("effect", ["agitation", "drag"])
def test_a_force_that_is_not_a_number_names_body_and_effect(make_world, line4, effect, poison):
    world = make_world({"monomer": 3, "dimer": 1}, line4)
    slot = int(world.bodies.live[-1])
    hook = dict(world.parts)[effect]

    def poisoned():
        hook()
        if world.step_count == 3:
            world.bodies.spin[slot, 1] = poison

    world.parts = [(name, poisoned if name == effect else part) for name, part in world.parts]
    with pytest.raises(
        Stopped, match=rf"effect '{effect}' made a motion that is not a number: body {slot} \(cubes 3, 4\)"
    ):
        run(world, 1.0)
    assert world.step_count == 3


def test_fluid_that_is_not_a_number_is_found_in_the_body_it_drags(make_world, line4):
    world = make_world({"monomer": 3}, line4)
    world.step()
    world.fluid[1, 0, 0] = np.nan
    with pytest.raises(Stopped, match=r"effect 'drag' made .*: body 1 \(cube 1\) at"):
        world.step()


@pytest.mark.parametrize("density", [5e-324, 1e-300, 1e-20, 1e20, 1e300])
@pytest.mark.parametrize("edge", [0.15, 0.05])
def test_masses_that_the_engine_cannot_take_are_refused(scene_of, density, edge):
    """Below and above, the engine lets cubes pass through each other and says nothing."""
    with pytest.raises(ValueError, match="the engine finds collisions of masses"):
        scene_of("walls", density=density, edge=edge)


@pytest.mark.parametrize(("density", "edge"), [(0.0, 0.15), (-1.0, 0.15), (1.0, 0.0), (1.0, 1e-160), (1.0, 1e200)])
def test_no_mass_or_size_is_refused(scene_of, line4, density, edge):
    data = line4.model_dump(mode="json") | {"cubes": {"density": density, "edge": edge}}
    with pytest.raises(ValueError, match=r"greater than 0|the engine finds"):
        type(line4).model_validate(data)


@pytest.mark.parametrize(("density", "edge"), [(3e-4, 0.02), (1e-6, 0.15), (9e8 / 0.25**3, 0.25)])
def test_masses_at_the_limits_collide_as_others(make_world, scene_of, density, edge):
    """A hit off the middle, in edges: it sends both cubes off as it does cubes of density and edge in between."""
    contact = {"effect": "contact", "restitution": 0.5, "friction": 0.3}
    apart = []
    for rho, length in ((density, edge), (1.0, 0.15)):
        world = make_world({"monomer": 2}, scene_of(contact, density=rho, edge=length, step=0.0002))
        put(world, 0, [0, 0, 0])
        put(world, 1, [0.1 * length, 0, 1.2 * length], velocity=[0, 0, -2.0])
        run(world, 0.05)
        b = world.bodies
        apart.append([*(b.velocity[1] - b.velocity[0]), *(length * b.spin[0]), *(length * b.spin[1])])
        np.testing.assert_allclose(b.momentum()[0], [0, 0, -2.0 * b.mass[1]], rtol=1e-12, atol=1e-12 * b.mass[1])
    assert apart[1][2] > 0.9
    np.testing.assert_allclose(apart[0], apart[1], atol=0.05)


# -- long runs ---------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("steps", [5_000, pytest.param(1_000_000, marks=LONG)])
def test_many_steps_without_leak_or_drift(make_world, line4, steps):
    """Joins and breaks all along: resident memory, quaternions, cubes and the books of momentum stay as they were."""
    scene = line4.changed("bonding", latch={"kind": "encounter", "probability": 1.0})
    scene = scene.changed("breaking", threshold=0.003)
    tight = scene.model_copy(update={"tank": scene.tank.model_copy(update={"size": (0.8, 0.8, 0.8)})})
    world = make_world({"monomer": 4, "quadmer": 2}, tight)
    b, seen = world.bodies, events_of(world)
    names = [name for name, _ in world.parts]
    books = names.index("guard", names.index("engine"))  # velocities are those of the engine's step
    parts = [part for _, part in world.parts]
    warm = 0
    for step in range(steps):
        for part in parts[: names.index("engine")]:
            part()
        before = b.velocity.copy()
        for part in parts[names.index("engine") : books]:
            part()
        if step % 50 == 0:
            change = np.zeros_like(before)
            for touch in world.engine.touches():
                for slot, sign in ((touch.a, 1), (touch.b, -1)):
                    if slot >= 0:
                        change[slot] += sign * touch.impulse / b.mass[slot]
            np.testing.assert_allclose((b.velocity - before)[b.live], change[b.live], atol=1e-10)
            np.testing.assert_allclose(np.linalg.norm(b.orientation[b.live], axis=1), 1, atol=1e-12)
            assert sorted(c for s in b.live for c in b.members[s]) == list(range(12))
        for part in parts[books:]:
            part()
        if step == max(steps // 10, 2000):
            warm = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    assert len(seen) > steps / 500
    grown = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - warm
    assert grown < 20_000 + 2 * len(seen)  # KiB; the engine itself keeps about 1 kB of each body ever made
