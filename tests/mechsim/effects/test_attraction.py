"""Attraction of faces: the law, action and reaction, energy, and who attracts whom."""

import numpy as np
import pytest

from mechsim.kernels.forces import attract
from mechsim.world.bodies import quaternion_of

PULL = {"effect": "attraction", "strength": 0.02, "decay": 0.02, "reach": 0.06}


def place(world, slot, position, axes=None, velocity=(0, 0, 0), spin=(0, 0, 0)):
    b = world.bodies
    b.position[slot], b.velocity[slot], b.spin[slot] = position, velocity, spin
    b.orientation[slot] = [0, 0, 0, 1] if axes is None else quaternion_of(axes)
    world.engine.put(slot)
    b.locate()


def two_cubes(make_world, scene, gap, **how):
    """Two cubes, the upper one's bottom face over the lower one's top face."""
    world = make_world({"monomer": 2}, scene)
    place(world, 0, [0, 0, 0])
    place(world, 1, [0, 0, world.bodies.edge + gap], **how)
    return world


def energy(world):
    b, s = world.bodies, world.scene.effect("attraction")
    total = 0.0
    for slot in b.live:
        total += 0.5 * b.mass[slot] * b.velocity[slot] @ b.velocity[slot]
        total += 0.5 * b.spin[slot] @ b.world_inertia(slot) @ b.spin[slot]
    for i, f, j, g in world.before["attraction"].__self__.faces.within_reach():
        ends = [b.centre[c] + b.edge / 2 * (1 - 2 * (h & 1)) * b.axes[c][:, h >> 1] for c, h in ((i, f), (j, g))]
        d = min(np.linalg.norm(ends[1] - ends[0]), s.reach)
        total -= well(s, d)
    return total


def closing(b):
    """Speed at which the lower cube's top face and the upper one's bottom face near each other."""
    ends = [b.velocity[i] + np.cross(b.spin[i], [0, 0, (1 - 2 * i) * b.edge / 2]) for i in (0, 1)]
    return (ends[0] - ends[1])[2]


def well(s, d):
    """Energy that two faces d apart have handed over since they came within reach."""
    return s.strength * s.decay / 3 * ((1 + d / s.decay) ** -3 - (1 + s.reach / s.decay) ** -3)


def test_the_force_is_the_stated_one(make_world, scene_of):
    for gap, force in ((0.01, 0.02 / 1.5**4), (0.02, 0.02 / 16), (0.055, 0.02 / 3.75**4), (0.061, 0.0)):
        world = two_cubes(make_world, scene_of(PULL, "contact"), gap)
        world.before["attraction"]()
        b = world.bodies
        np.testing.assert_allclose(b.mass[0] * b.velocity[0], [0, 0, force * world.step_size], atol=1e-15)
        np.testing.assert_allclose(b.velocity[1], -b.velocity[0], atol=1e-15)


def test_only_faces_that_may_bond_attract(make_world, scene_of):
    side = np.array([[0, 0, 1], [1, 0, 0], [0, 1, 0]], float)  # a side face, which line4 never bonds, looks down
    world = two_cubes(make_world, scene_of(PULL, "contact"), 0.01, axes=side)
    world.before["attraction"]()
    np.testing.assert_array_equal(world.bodies.velocity, 0)


def test_impulses_are_equal_and_opposite_along_one_line(make_world, scene_of):
    """Linear and angular momentum are kept to rounding, bodies of any shape, turn and motion."""
    rng = np.random.default_rng(6)
    world = make_world({"trimer": 1, "monomer": 2}, scene_of(PULL, "contact"))
    b, pulled = world.bodies, 0
    line = int(b.live[0])
    for _ in range(300):
        turn = np.linalg.qr(rng.standard_normal((3, 3)))[0]
        turn *= np.linalg.det(turn)
        place(world, line, [0, 0, 0], turn, rng.standard_normal(3), rng.standard_normal(3))
        (end,) = [c for c in b.members[line] if b.uncovered[c, 4] and b.uncovered[c].sum() == 5][:1]
        small = np.linalg.qr(np.eye(3) + 0.1 * rng.standard_normal((3, 3)))[0]
        small *= np.sign(np.diag(small))
        flip = np.diag([1.0, -1.0, -1.0])
        for slot in b.live[1:].tolist():
            out = b.axes[end][:, 2] * (b.edge + rng.uniform(0.0, 0.05)) + 0.03 * rng.standard_normal(3)
            place(world, slot, b.centre[end] + out, b.axes[end] @ small @ flip, 0.5 * rng.standard_normal(3))
        before, was = b.momentum(), b.velocity.copy()
        world.before["attraction"]()
        pulled += not np.array_equal(was, b.velocity)
        after = b.momentum()
        np.testing.assert_allclose(after[0], before[0], atol=1e-17)
        np.testing.assert_allclose(after[1], before[1], atol=1e-17)
    assert pulled > 100


def test_a_step_hands_over_no_more_than_the_well_holds(make_world, scene_of):
    """At any step, strength and speed; and it never carries two faces past each other."""
    rng = np.random.default_rng(7)
    world = two_cubes(make_world, scene_of(PULL, "contact"), 0.02)
    b, s = world.bodies, world.scene.effect("attraction")
    gained = gained_fully = 0
    for _ in range(2000):
        gap, step, strength = rng.uniform(1e-4, 0.05), 10 ** rng.uniform(-4, 0), 10 ** rng.uniform(-4, 2)
        place(world, 1, [0, 0, b.edge + gap])
        b.velocity[:] = 10 ** rng.uniform(-2, 1) * rng.standard_normal((2, 3))
        b.spin[:] = 10 * rng.standard_normal((2, 3))
        kinetic, before = energy(world), closing(b)
        attract(
            np.array([[0, 4, 1, 5]]), b.body, b.centre, b.axes, b.edge, b.position, b.orientation, b.velocity, b.spin,
            b.mass, b.inertia, strength, s.decay, s.reach, step,
        )  # fmt: skip
        left = strength * s.decay / 3 * (1 - (1 + gap / s.decay) ** -3)
        assert energy(world) - kinetic <= left * (1 + 1e-9)
        gained += energy(world) > kinetic
        assert closing(b) * step <= max(before * step, gap * (1 + 1e-9))
        gained_fully += closing(b) * step > 0.999 * gap
    assert gained > gained_fully > 100


def test_two_cubes_fall_together_with_the_energy_of_the_well_and_stay(make_world, scene_of):
    world = two_cubes(make_world, scene_of(PULL, "contact", step=0.001), 0.04)
    b, s = world.bodies, world.scene.effect("attraction")
    total, fastest, ends = energy(world), 0.0, []
    for _ in range(6000):
        world.step()
        fastest = max(fastest, np.linalg.norm(b.velocity[0] - b.velocity[1]))
        ends.append(energy(world))
    expected = np.sqrt(2 * (well(s, 0.0) - well(s, 0.04)) / (b.mass[0] / 2))
    assert 0.94 * expected < fastest < 1.001 * expected  # contact ends the fall up to a step early
    assert max(ends) < total + 0.01 * well(s, 0.0)
    assert b.centre[1, 2] - b.centre[0, 2] == pytest.approx(b.edge, abs=0.003)
    assert np.abs(b.velocity).max() < 0.03


@pytest.mark.parametrize("step", [0.005, 0.002])
def test_a_swarm_gains_no_energy(make_world, scene_of, step):
    """Tumbling cubes that meet, swing and part: kinetic energy and wells together do not grow."""
    scene = scene_of(PULL, "walls", "contact", step=step, tank=[0.8, 0.8, 0.8])
    world = make_world({"monomer": 20}, scene)
    rng = np.random.default_rng(1)
    b = world.bodies
    b.velocity[:], b.spin[:] = 0.3 * rng.standard_normal((20, 3)), 2 * rng.standard_normal((20, 3))
    total, highest = energy(world), 0.0
    for _ in range(round(6 / step)):
        world.step()
        highest = max(highest, energy(world))
    assert highest < 1.01 * total
    assert energy(world) < 0.9 * total


@pytest.mark.parametrize(
    ("effects", "said"),
    [
        ((PULL,), "'attraction' needs effect 'contact'"),
        ((PULL | {"strength": -1.0}, "contact"), "at least 0"),
        ((PULL | {"decay": 0.0}, "contact"), "greater than 0"),
        ((PULL | {"reach": 0.08}, "contact"), "more than half the cubes' edge of 0.15"),
    ],
)
def test_what_cannot_be_is_refused(scene_of, effects, said):
    with pytest.raises(ValueError, match=said):
        scene_of(*effects)
