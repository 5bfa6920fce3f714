"""Drag and agitation: closed forms, a slow reference, and the paper's speeds."""

import numpy as np
import pytest

from mechsim.bodies import matrix_of
from mechsim.effects.drag import drag_points

MIXED = {"monomer": 4, "dimer": 2, "trimer": 2, "quadmer": 2}
PAPER_SPEEDS = {3.0: 0.8, 3.5: 1.0, 4.0: 1.2, 4.5: 1.35, 5.0: 1.5}  # section V-A


def calm(line4):
    """Drag in fluid at rest, nothing else."""
    return line4.without("agitation", "walls", "contact", "breaking", "bonding")


def mean_speed(world, duration, skip=1.0):
    """Time average of the bodies' mean speed."""
    seen = []
    while world.time < skip + duration:
        world.step()
        if world.time > skip:
            seen.append(np.linalg.norm(world.bodies.velocity[world.bodies.live], axis=1).mean())
    return float(np.mean(seen))


@pytest.mark.parametrize("step", [0.05, 0.002])
def test_a_cube_that_does_not_turn_slows_down_exactly(make_world, line4, step):
    """Eight points move alike, so m v' = -c v^2 with c = Cd rho L^2 and m = rho L^3: the scheme solves it."""
    numerics = line4.numerics.model_copy(update={"step": step})
    world = make_world({"monomer": 1}, calm(line4).model_copy(update={"numerics": numerics}))
    world.bodies.velocity[0] = direction = np.array([1.2, -1.6, 0.0])
    for _ in range(round(0.2 / step)):
        world.step()
    np.testing.assert_allclose(world.bodies.velocity[0], direction / (1 + 1.05 * 2 / 0.15 * 0.2), atol=1e-12)


def naive_step(world):
    """Velocities after one step by dense 6x6 systems, written the obvious way."""
    b, step = world.bodies, world.step_size
    place, share = drag_points(world.scene.effect("drag").points)
    after = {}
    for slot in b.live:
        r = matrix_of(b.orientation[slot])
        mass = np.zeros((6, 6))
        mass[:3, :3] = b.mass[slot] * np.eye(3)
        mass[3:, 3:] = r @ np.diag(b.inertia[slot]) @ r.T
        system, push = mass / step, np.zeros(6)
        for cube in b.members[slot]:
            for k, point in enumerate(place):
                area = share[k] @ b.uncovered[cube] * (b.edge / 2) ** 2
                arm = r @ (b.offset[cube] + b.edge * b.turn[cube] @ point)
                cross = np.array([[0, -arm[2], arm[1]], [arm[2], 0, -arm[0]], [-arm[1], arm[0], 0]])
                jacobian = np.hstack([np.eye(3), -cross])  # velocity of the point from (v, w)
                relative = world.fluid[cube, k] - jacobian @ np.concatenate([b.velocity[slot], b.spin[slot]])
                c = 0.5 * 1.05 * area * np.linalg.norm(relative)
                system += c * jacobian.T @ jacobian
                push += c * jacobian.T @ relative
        after[slot] = np.concatenate([b.velocity[slot], b.spin[slot]]) + np.linalg.solve(system, push)
    return after


@pytest.mark.parametrize("points", ["sub-cubes", "sub-faces"])
def test_kernel_equals_a_dense_reference(make_world, line4, points):
    world = make_world(MIXED, line4.changed("drag", points=points))
    b = world.bodies
    for _ in range(40):
        world.step()
    world._before[0]()  # agitation; then drag alone
    expected = naive_step(world)
    world._before[1]()
    for slot in b.live:
        got = np.concatenate([b.velocity[slot], b.spin[slot]])
        np.testing.assert_allclose(got, expected[slot], rtol=1e-11, atol=1e-12)


@pytest.mark.parametrize(("points", "area_of_a_face"), [("sub-cubes", 4 / 3 / 4), ("sub-faces", 1.0)])
def test_only_uncovered_faces_have_area(make_world, line4, points, area_of_a_face):
    world = make_world(MIXED, line4.changed("drag", points=points))
    b = world.bodies
    areas = world._before[1].__self__.areas
    for slot in b.live:
        uncovered = b.uncovered[list(b.members[slot])].sum()
        assert uncovered == 4 * len(b.members[slot]) + 2  # of a line
        assert areas[list(b.members[slot])].sum() == pytest.approx(uncovered * area_of_a_face * b.edge**2)


def test_fluid_is_held_for_the_hold_and_has_the_stated_spread(make_world, line4):
    world = make_world({"monomer": 60})
    draws = []
    for _ in range(40):
        world.step()
        draws.append(world.fluid.copy())
    for even, odd in zip(draws[0::2], draws[1::2], strict=True):
        np.testing.assert_array_equal(even, odd)
    values = np.array(draws[0::2])
    assert values.std() == pytest.approx(4.0, rel=0.01)
    assert values.mean() == pytest.approx(0.0, abs=0.05)
    assert not (draws[0] == draws[2]).any()


@pytest.mark.parametrize("sigma", PAPER_SPEEDS)
def test_mean_speed_is_within_5_percent_of_the_papers(make_world, line4, sigma):
    world = make_world({"monomer": 60}, line4.without("bonding", "breaking").changed("agitation", sigma=sigma))
    assert mean_speed(world, 15) == pytest.approx(PAPER_SPEEDS[sigma], rel=0.05)


def test_speed_does_not_depend_on_the_step_or_on_the_number_of_cubes(make_world, line4):
    scene = line4.without("bonding", "breaking")
    standard = mean_speed(make_world({"monomer": 60}, scene), 30)
    half = scene.numerics.model_copy(update={"step": scene.numerics.step / 2})
    assert mean_speed(make_world({"monomer": 60}, scene.model_copy(update={"numerics": half})), 30) == pytest.approx(
        standard, rel=0.02
    )
    for n in (1, 120):
        world = make_world({"monomer": n}, scene)
        assert mean_speed(world, 1500 / n if n > 1 else 300) == pytest.approx(standard, rel=0.02)


def test_redrawing_at_every_step_has_no_limit(make_world, line4):
    """Control: with the paper's per-step noise the speed falls with the step, so a held velocity is what is needed."""
    scene = line4.without("bonding", "breaking")
    speeds = []
    for step in (0.00525, 0.002625):
        numerics = scene.numerics.model_copy(update={"step": step})
        fine = scene.model_copy(update={"numerics": numerics}).changed("agitation", hold=step)
        speeds.append(mean_speed(make_world({"monomer": 60}, fine), 10))
    assert speeds[1] < 0.85 * speeds[0]
