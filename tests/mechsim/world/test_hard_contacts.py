"""Hard cases of contact: overlaps, masses far apart, bonds that meet in one step, motions that are no numbers.

Beside them: a snap into a third body waits, faces that have just parted have not met: test_bonding; what is not a
number, by every effect: the contract of effects.
"""

import math

import numpy as np
import pytest
from handling import CONTACT, energy, events_of, put, run

from mechsim.effects.base import Stopped
from mechsim.kernels.contact import blocked

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
    assert np.abs(b.velocity).max() < 0.03
    assert np.abs(b.position[:, :2]).max() < 0.05 * b.edge


# -- bonds -------------------------------------------------------------------------------------------------------------

EAGER = {"effect": "bonding", "latch": {"kind": "encounter", "probability": 1.0}}
BRITTLE = {"effect": "breaking", "threshold": 0.0005}


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


@pytest.mark.parametrize(("threshold", "grace", "breaks"), [(5e-4, 0.0, False), (1e-6, 0.5, False), (1e-6, 0.0, True)])
def test_the_push_of_a_snap_breaks_nothing(make_world, scene_of, threshold, grace, breaks):
    """A cube snaps a fiftieth of an edge sideways into a line that lies against it, and the engine pushes them apart:
    at 0.05 / tu at most, too little even for bonds a sixteenth as strong as the scene's, and nothing to new ones.
    Control: bonds that give way at a touch do."""
    brittle = BRITTLE | {"threshold": threshold, "grace": grace}
    world = make_world({"monomer": 2, "trimer": 1}, scene_of(CONTACT, brittle, EAGER | {"capture_distance": 0.01}))
    b, seen = world.bodies, events_of(world)
    one, two, line = (int(s) for s in b.live)
    run(world, 0.02)
    seen.clear()
    put(world, one, [0, 0, 0])
    put(world, two, [-0.02 * b.edge, 0, 1.02 * b.edge])
    put(world, line, [0.985 * b.edge, 0, 1.3 * b.edge], np.array([[1, 0, 0], [0, 0, 1], [0, -1, 0]]))
    world.step()
    assert seen == [([1, 1], [2])]
    fastest = 0.0
    for _ in range(10):
        world.step()
        fastest = max(fastest, float(np.abs(b.velocity[b.live]).max()))
    assert 0.005 < fastest < 0.05  # it was pushed
    assert any(len(before) == 1 for before, _ in seen) == breaks


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


def test_fluid_that_is_not_a_number_is_found_in_the_body_it_drags(make_world, line4):
    world = make_world({"monomer": 3}, line4)
    world.step()
    world.sources["agitation"].flow[1, 0, 0] = np.nan
    with pytest.raises(Stopped, match=r"effect 'drag' produced .*: body 1 \(cube 1\) at"):
        world.step()


@pytest.mark.parametrize("density", [5e-324, 1e-300, 1e-20, 1e20, 1e300])
@pytest.mark.parametrize("edge", [0.15, 0.05])
def test_masses_that_the_engine_cannot_take_are_refused(scene_of, density, edge):
    """Below and above, the engine lets cubes pass through each other and says nothing."""
    with pytest.raises(ValueError, match="the engine finds collisions of masses"):
        scene_of("walls", density=density, edge=edge)


@pytest.mark.parametrize(("density", "edge"), [(0.0, 0.15), (-1.0, 0.15), (1.0, 0.0), (1.0, 1e-160), (1.0, 1e200)])
def test_no_mass_or_size_is_refused(scene_of, line4, density, edge):
    data = line4.as_dict() | {"cubes": {"density": density, "edge": edge}}
    with pytest.raises(ValueError, match=r"greater than 0|the engine finds"):
        type(line4)(**data)


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
