"""Gravity and buoyancy: free fall, terminal velocity, neutral cubes, and the momentum of what rests on the floor."""

import numpy as np
import pytest

WEIGHT = {"effect": "buoyancy", "gravity": 2.0}
MIXED = {"monomer": 2, "dimer": 1, "quadmer": 1}


@pytest.mark.parametrize("density", [4.0, 0.5, 1.0])
def test_single_cubes_and_lines_fall_or_rise_alike(make_world, scene_of, density):
    world = make_world(MIXED, scene_of(WEIGHT, density=density, tank=[2.0, 2.0, 30.0]))
    b = world.bodies
    start = b.position[b.live]
    for _ in range(100):
        world.step()
    speed = -(1 - 1 / density) * 2.0 * world.time
    np.testing.assert_allclose(b.velocity[b.live], np.tile([0, 0, speed], (4, 1)), atol=1e-12)
    # The velocity is changed first, so a body is half a step ahead of the parabola.
    drop = 0.5 * speed * (world.time + world.step_size)
    np.testing.assert_allclose(b.position[b.live] - start, np.tile([0, 0, drop], (4, 1)), atol=1e-12)
    np.testing.assert_array_equal(b.spin[b.live], 0)


@pytest.mark.parametrize("density", [3.0, 0.2])
def test_a_cube_sinks_or_rises_at_its_terminal_velocity(make_world, scene_of, density):
    reached = []
    for step in (0.01, 0.005):
        world = make_world({"monomer": 1}, scene_of(WEIGHT, "drag", density=density, step=step))
        for _ in range(round(6 / step)):
            world.step()
        reached.append(world.bodies.velocity[0, 2])
    expected = np.sign(1 - density) * np.sqrt(abs(density - 1) * 2.0 * 0.15 / 1.05)
    coarse, fine = np.abs(np.array(reached) / expected - 1)
    assert fine < 0.05
    assert fine == pytest.approx(coarse / 2, rel=0.1)  # first order in the step


def test_contact_impulses_and_weight_are_all_the_momentum_there_is(make_world, scene_of):
    """Heavy bodies fall to the floor, pile up and come to rest; every step adds up."""
    scene = scene_of(WEIGHT, "drag", "walls", "contact", density=3.0, tank=[1.0, 1.0, 1.0])
    world = make_world({"monomer": 6, "dimer": 2}, scene)
    b = world.bodies
    weight = np.array([0, 0, -(1 - 1 / 3.0) * 2.0]) * b.mass[b.live].sum()
    for _ in range(1500):
        before = b.mass[b.live] @ b.velocity[b.live]
        world.before["buoyancy"]()
        np.testing.assert_allclose(b.mass[b.live] @ b.velocity[b.live] - before, weight * world.step_size, atol=1e-14)
        world.before["drag"]()
        before = b.mass[b.live] @ b.velocity[b.live]
        for name, part in world.parts:
            if name not in world.before:
                part()
        pushed = sum((t.impulse for t in world.engine.touches() if t.b < 0 <= t.a), np.zeros(3))
        pushed -= sum((t.impulse for t in world.engine.touches() if t.a < 0 <= t.b), np.zeros(3))
        np.testing.assert_allclose(b.mass[b.live] @ b.velocity[b.live] - before, pushed, atol=1e-12)
    assert np.abs(b.velocity[b.live]).max() < 0.05
    assert b.centre[:, 2].min() == pytest.approx(-0.5 + 0.075, abs=0.003)
    assert b.centre[:, 2].max() < 0.0


@pytest.mark.parametrize("settings", [{"gravity": 0.0}, {"gravity": -1.0}, {"gravity": 1.0, "fluid_density": -1.0}])
def test_bad_settings_are_refused(scene_of, settings):
    with pytest.raises(ValueError, match=r"greater than|at least"):
        scene_of({"effect": "buoyancy"} | settings)
