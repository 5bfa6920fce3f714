"""Agitation with a memory and with a correlation length: their stated laws, and what they are refused for."""

import itertools
import math

import numpy as np
import pytest

from kinetics.assembly import FACE_NORMALS
from mechsim.effects.drag import drag_points
from mechsim.kernels.fluid import cosine_of_half_turns, flow

SMOOTH = {"effect": "ornstein-uhlenbeck", "sigma": 4.0, "correlation_time": 0.00525}
FIELD = {"effect": "random-field", "sigma": 4.0, "correlation_length": 0.3, "correlation_time": 0.00525}
LONG = (pytest.mark.validate, pytest.mark.timeout(7200))
FACES = {"effect": "drag", "points": "sub-faces"}


def fluid_of(world, steps):
    """The fluid over many steps without the motion: (steps, C, P, 3)."""
    (name,) = world.sources
    seen = []
    for _ in range(steps):
        world.before[name]()
        world.superpose()
        seen.append(world.fluid.copy())
        world.step_count += 1
    return np.array(seen)


def mean_speed(world, duration):
    seen = []
    while world.time < 0.5 + duration:
        world.step()
        if world.time > 0.5:
            seen.append(np.linalg.norm(world.bodies.velocity, axis=1).mean())
    return float(np.mean(seen))


def correlation(u, lag):
    """Mean product at a lag in units of sigma^2, and its standard error from the scatter of the drag points."""
    products = (u[: len(u) - lag] * u[lag:]).mean(axis=0).ravel() / 16.0
    return products.mean(), products.std() / math.sqrt(products.size)


@pytest.mark.parametrize("step", [0.00525, 0.00175])
def test_the_memory_is_exponential_at_any_step(make_world, scene_of, step):
    u = fluid_of(make_world({"monomer": 60}, scene_of(SMOOTH, FACES, step=step)), 300)
    for lag in range(5):  # later both laws are near zero, and the control would be weak
        mean, error = correlation(u, lag)
        assert abs(mean - math.exp(-lag * step / 0.00525)) < 4.9 * error  # false alarm 1e-6
        assert abs(mean - math.exp(-lag * step / 0.0035)) > 4.9 * error or lag == 0  # another memory would be seen
    assert abs(u[0].std() - 4.0) < 4.9 * 4.0 / math.sqrt(2 * u[0].size)  # from the first step on


def test_half_the_hold_as_memory_drives_slow_bodies_like_held_noise(make_world, scene_of):
    held = {"effect": "agitation", "sigma": 1.0, "hold": 0.004}
    speeds = {}
    for name, effect in {
        "held": held,
        "half": SMOOTH | {"sigma": 1.0, "correlation_time": 0.002},
        "whole": SMOOTH | {"sigma": 1.0, "correlation_time": 0.004},
    }.items():
        speeds[name] = mean_speed(make_world({"monomer": 60}, scene_of(effect, "drag", step=0.001)), 4.0)
    assert speeds["half"] == pytest.approx(speeds["held"], rel=0.04)
    assert speeds["whole"] > 1.25 * speeds["held"]  # sqrt(2) in the limit


@pytest.mark.parametrize("effect", [SMOOTH, FIELD])
def test_the_speed_does_not_depend_on_the_step(make_world, scene_of, effect):
    effect = effect | {"correlation_time": 0.0105}
    coarse, fine = (
        mean_speed(make_world({"monomer": 60}, scene_of(effect, "drag", step=step), seed=2), 4.0)
        for step in (0.002625, 0.0013125)
    )
    assert fine == pytest.approx(coarse, rel=0.03)


def test_our_cosine_is_the_librarys():
    """Ours is fast because the compiler can take several at a time; the arguments' own rounding is no fault of it."""
    turns = np.random.default_rng(3).uniform(-1, 1, 2000) * np.repeat([1.0, 30.0, 1e5, 1e12], 500)
    turns = np.concatenate([turns, np.arange(-8, 8.25, 0.25), np.nextafter(0.5, [0, 1])])
    ours = np.array([cosine_of_half_turns(t) for t in turns])
    exact = np.cos(np.pi * np.remainder(turns, 2.0))  # the remainder is exact, its product with pi is not
    np.testing.assert_allclose(ours, exact, atol=1.5e-15)
    assert [cosine_of_half_turns(t) for t in (0.0, 0.5, 1.0, -1.5, 2.0**50)] == [1.0, 0.0, -1.0, 0.0, 1.0]
    assert not any(map(math.isfinite, map(cosine_of_half_turns, (math.nan, math.inf))))


def test_the_compiled_field_equals_the_sum_of_its_modes(make_world, scene_of):
    world = make_world({"monomer": 5, "trimer": 2}, scene_of(FIELD, FACES))
    for _ in range(3):
        world.step()
    world.before["random-field"]()
    world.superpose()
    modes = world.before["random-field"].__self__.modes
    b = world.bodies
    place = b.centre[:, None] + np.einsum("cij,pj->cpi", b.axes, world.drag_points)
    expected = np.cos(place @ modes[:, :3].T + modes[:, 3]) @ modes[:, 4:]
    np.testing.assert_allclose(world.fluid, expected, atol=1e-13)
    wave, push = modes[:, :3], modes[:, 4:]
    scale = np.linalg.norm(wave, axis=1) * np.linalg.norm(push, axis=1)
    np.testing.assert_allclose((wave * push).sum(axis=1) / scale, 0, atol=1e-14)  # divergence of every mode


def test_the_field_has_its_spread_and_correlation_length(make_world, scene_of):
    world = make_world({"monomer": 1}, scene_of(FIELD, "drag"))
    field = world.before["random-field"].__self__
    at = np.array([[0, 0, 0], [0.15, 0, 0], [0, 0.3, 0], [0.3, 0.3, 0], [3.0, 0, 0]])
    apart = np.linalg.norm(at, axis=1)
    u = np.zeros((len(at), 1, 3))
    products, squares = [], []
    for _ in range(4000):
        field.renew(1.0)
        flow(at, np.tile(np.eye(3), (len(at), 1, 1)), np.zeros((1, 3)), field.modes, u)
        products.append((u[:, 0] @ u[0, 0]) / 48.0)
        squares.append(u[0, 0] ** 2 / 16.0)
    products, squares = np.array(products), np.array(squares)
    error = products.std(axis=0) / math.sqrt(len(products))
    assert (np.abs(products.mean(axis=0) - np.exp(-(apart**2) / (2 * 0.3**2))) < 4.9 * error).all()
    assert (np.abs(products.mean(axis=0) - np.exp(-(apart**2) / (2 * 0.4**2)))[2:4] > 4.9 * error[2:4]).all()
    np.testing.assert_allclose(squares.mean(axis=0), 1.0, atol=4.9 * squares.std() / math.sqrt(len(squares)))
    assert (squares**2).mean() / squares.mean() ** 2 == pytest.approx(3.0, abs=0.35)  # near Gaussian: 3 + 2.4 / 32


def test_the_field_forgets_in_its_correlation_time(make_world, scene_of):
    world = make_world({"monomer": 1}, scene_of(FIELD | {"modes": 4096}, "drag"))
    world.before["random-field"]()
    field = world.before["random-field"].__self__
    first = field.modes.copy()
    for step in range(1, 4):
        world.step_count = step
        world.before["random-field"]()
        kept = (field.modes == first).all(axis=1).mean()
        expected = math.exp(-step)
        assert abs(kept - expected) < 4.9 * math.sqrt(expected * (1 - expected) / 4096)


def test_limits_of_the_correlation_length(make_world, scene_of):
    """Much shorter than a cube, its points are independent; much longer, the fluid moves as one."""
    spread = {}
    for length in (0.01, 30.0):
        effect = FIELD | {"correlation_length": length, "correlation_time": 0.001}
        u = fluid_of(make_world({"monomer": 8}, scene_of(effect, "drag", step=0.001)), 1500)
        spread[length] = math.sqrt(u.var(axis=(1, 2)).mean()) / 4.0  # within an instant, over all points of all cubes
    assert spread[0.01] == pytest.approx(1.0, abs=0.02)
    assert spread[30.0] < 0.05


def test_with_a_correlation_length_more_points_tell_the_same(make_world, scene_of):
    """Where neighbouring points see one velocity, 8 or 24 of them on the same area drive a cube alike; independent
    velocities average out instead."""
    speeds = {}
    for effect in (FIELD | {"correlation_length": 0.6}, SMOOTH):
        for drag in (FACES | {"coefficient": 0.35}, "drag"):  # sub-faces have three times the area of sub-cubes
            world = make_world({"monomer": 60}, scene_of(effect, drag))
            speeds[effect["effect"], drag == "drag"] = mean_speed(world, 5.0)
    assert speeds["random-field", True] == pytest.approx(speeds["random-field", False], rel=0.05)
    assert speeds["ornstein-uhlenbeck", True] > 1.3 * speeds["ornstein-uhlenbeck", False]


def lattice(n):
    """Centres of n^3 sub-cubes in edges, and what each face gives of their areas in (edge/2)^2: for n = 2 the eight of
    `drag`; the same area in all for any n."""
    at = (np.arange(n) + 0.5) / n - 0.5
    place = np.array(list(itertools.product(at, repeat=3)))
    return place, np.isclose(place @ FACE_NORMALS.T, at[-1]) / 3.0 * (2 / n) ** 2


def with_points(world, place, share):
    """The world with other drag points on its cubes."""
    dragging, n = world.before["drag"].__self__, world.bodies.n_cubes
    dragging.place, dragging.share = place, share
    dragging.points, dragging.areas = np.zeros((n, len(place), 3)), np.zeros((n, len(place)))
    world.set_drag_points(place * world.bodies.edge)
    for source in world.sources.values():
        source.flow = np.zeros_like(world.fluid)
    for slot in world.bodies.live:
        dragging.lay_out(slot)
    return world


def test_the_lattice_of_eight_is_that_of_the_drag():
    ours, theirs = (np.column_stack(points) for points in (lattice(2), drag_points("sub-cubes")))
    np.testing.assert_allclose(ours[np.lexsort(ours.T)], theirs[np.lexsort(theirs.T)], atol=1e-15)
    for n in (3, 4):
        np.testing.assert_allclose(lattice(n)[1].sum(axis=0), 4 / 3)


@pytest.mark.parametrize(("edges", "duration"), [(4, 2.0), pytest.param(2, 20.0, marks=LONG)])
def test_8_27_and_64_sub_cubes_are_driven_alike_by_a_correlated_field(make_world, scene_of, edges, duration):
    """Within 3 % where the fluid is correlated over two edges and more; in one and the same field, so that chance has
    little say. Measured: 0.4 % less speed with 64 at four edges, 1.5 % at two, 4.7 % at one, where the field varies
    within a cube and points further out tell of it."""
    scene = scene_of(FIELD | {"correlation_length": edges * 0.15}, "drag")
    worlds = [with_points(make_world({"monomer": 60}, scene), *lattice(n)) for n in (2, 3, 4)]
    speeds = [mean_speed(world, duration) for world in worlds]
    assert speeds == pytest.approx([speeds[0]] * 3, rel=0.03)


def test_64_sub_cubes_in_independent_fluid_average_it_out(make_world, scene_of):
    """Control: without a correlation length the number of points is no refinement."""
    speeds = [
        mean_speed(with_points(make_world({"monomer": 20}, scene_of(SMOOTH, "drag")), *lattice(n)), 2.0) for n in (2, 4)
    ]
    assert speeds[1] < 0.7 * speeds[0]


@pytest.mark.parametrize(
    ("effects", "said"),
    [
        (("agitation", SMOOTH, "drag"), "'agitation' and 'ornstein-uhlenbeck' conflict"),
        ((FIELD, SMOOTH, "drag"), "'random-field' and 'ornstein-uhlenbeck' conflict"),
        ((SMOOTH,), "effect 'ornstein-uhlenbeck' needs effect 'drag'"),
        ((FIELD,), "effect 'random-field' needs effect 'drag'"),
        ((SMOOTH | {"correlation_time": 0.005}, "drag"), "shorter than the step of 0.00525"),
        ((SMOOTH | {"correlation_time": -1.0}, "drag"), "greater than 0"),
        ((FIELD | {"correlation_length": -0.1}, "drag"), "greater than 0"),
        ((FIELD | {"correlation_length": 0.0}, "drag"), "greater than 0"),
        ((FIELD | {"correlation_length": 0.02}, "drag"), "choose numerics.step = 0.005 or less"),
        ((FIELD | {"correlation_time": 0.001}, "drag"), "choose numerics.step = 0.001 or less"),
        ((FIELD | {"sigma": float("nan")}, "drag"), "finite"),
    ],
)
def test_what_cannot_be_is_refused(scene_of, effects, said):
    with pytest.raises(ValueError, match=said):
        scene_of(*effects)
