"""Steady flows, uniform and sheared: their closed forms, and that all sources of flow superpose."""

import numpy as np
import pytest
from handling import act, put
from msgspec.structs import replace  # not checked: no scene may list what is not registered

from mechsim.effects.base import Effect, FlowSource

CALM = {"effect": "agitation", "sigma": 0.0, "hold": 0.0105}
SMOOTH = {"effect": "ornstein-uhlenbeck", "sigma": 4.0, "correlation_time": 0.0105}
FIELD = {"effect": "random-field", "sigma": 4.0, "correlation_length": 0.3, "correlation_time": 0.0105}
STREAM = {"effect": "current", "velocity": [1.0, 0.0, 0.0]}
RATE = 2.0
SHEAR = {"effect": "shear", "gradient": [[0, RATE, 0], [0, 0, 0], [0, 0, 0]]}
TURN = np.array([[0.36, 0.48, -0.8], [-0.8, 0.6, 0.0], [0.48, 0.64, 0.6]])  # a cube that stands askew
MIXED = {"monomer": 3, "dimer": 1, "quadmer": 1}


def fluid_at(world):
    """Places of all drag points (C, P, 3), written the obvious way."""
    b = world.bodies
    return np.array([[b.centre[c] + b.axes[c] @ point for point in world.drag_points] for c in range(b.n_cubes)])


@pytest.mark.parametrize("effects", [(CALM, STREAM, "drag"), (STREAM, CALM, "drag"), (STREAM, "drag")])
def test_a_current_is_not_added_to_itself_from_step_to_step(make_world, scene_of, effects):
    world = make_world({"monomer": 2}, scene_of(*effects))
    seen = []
    for _ in range(6):
        world.step()
        assert len(np.unique(world.fluid[..., 0])) == 1
        seen.append(world.fluid[0, 0].tolist())
    assert seen == [[1.0, 0.0, 0.0]] * 6


class Hoarding(Effect, tag="hoarding"):
    """A current that adds to the field as if that were its own, which no source may."""

    def attach(self, world):
        class Adding(FlowSource):
            def before_step(self):
                self.flow += world.fluid
                self.flow[..., 0] += 1.0

        return Adding()


def test_the_field_that_is_read_is_the_sum_and_no_sources_memory(make_world, scene_of):
    """Control: a source that takes the field for its own state goes from 1 to 3, to 7."""
    scene = scene_of(CALM, "drag")
    world = make_world({"monomer": 1}, replace(scene, effects=(Hoarding(), *scene.effects)))
    seen = []
    for _ in range(3):
        act(world)
        seen.append(world.fluid[0, 0, 0])
    assert seen == [1.0, 3.0, 7.0]


@pytest.mark.parametrize("stirred", ["agitation", SMOOTH, FIELD])
def test_agitation_a_current_and_shear_superpose(make_world, scene_of, stirred):
    """The sum at every drag point of bodies on their way, with the random part that it has without the others."""
    world = make_world(MIXED, scene_of(stirred, STREAM, SHEAR, "drag"))
    b, noise = world.bodies, world.sources[stirred if isinstance(stirred, str) else stirred["effect"]]
    alone = make_world(MIXED, scene_of(stirred, "drag"))
    for _ in range(5):
        place = fluid_at(world)
        act(world)
        act(alone)
        if stirred is not FIELD:  # its velocity depends on where the cubes are
            np.testing.assert_array_equal(noise.flow, alone.fluid)
        steady = np.array([1.0, 0, 0]) + place[..., 1:2] * np.array([RATE, 0, 0])
        np.testing.assert_allclose(world.fluid, noise.flow + steady, atol=1e-13)
        assert np.abs(noise.flow).max() > 4.0
        for moved in (world, alone):
            moved.step_count += 1
        b.position[b.live] += world.step_size * b.velocity[b.live]
        b.locate()


def test_one_source_alone_is_the_field_bit_for_bit(make_world, line4):
    world = make_world(MIXED, line4)
    for _ in range(3):
        world.step()
        assert world.fluid.tobytes() == world.sources["agitation"].flow.tobytes()
        assert not np.shares_memory(world.fluid, world.sources["agitation"].flow)


def test_drag_listed_first_takes_the_fluid_of_the_step_before(make_world, scene_of):
    """Effects act in the order listed; the field is renewed after the last source."""
    world = make_world({"monomer": 1}, scene_of("drag", STREAM))
    world.step()
    assert not world.bodies.velocity.any()
    world.step()
    assert world.bodies.velocity[0, 0] > 0


def test_a_current_of_nothing_changes_nothing_and_no_source_means_no_sum(make_world, scene_of):
    names = [name for name, _ in make_world({"monomer": 1}, scene_of("drag")).parts]
    assert "fluid" not in names
    still = STREAM | {"velocity": [0.0, 0.0, 0.0]}
    ends = []
    for effects in (("agitation", "drag", "walls"), ("agitation", still, "drag", "walls")):
        world = make_world(MIXED, scene_of(*effects))
        for _ in range(20):
            world.step()
        ends.append(np.hstack([world.bodies.position, world.bodies.velocity, world.bodies.spin]))
    np.testing.assert_array_equal(*ends)


@pytest.mark.parametrize("step", [0.02, 0.002])
def test_a_free_cube_is_carried_to_the_velocity_of_the_current(make_world, scene_of, step):
    """m v' = Cd rho L^2 |u - v| (u - v), as all points move alike: the lag falls as 1 / (1 + Cd |u| t / L)."""
    world = make_world({"monomer": 1}, scene_of(STREAM | {"velocity": [1.2, -1.6, 0.0]}, "drag", step=step))
    direction = np.array([1.2, -1.6, 0.0])
    for passed in (0.2, 2.0):
        while world.time < passed - 1e-9:
            world.step()
        lag = 1 / (1 + 1.05 * 2.0 / 0.15 * passed)
        np.testing.assert_allclose(world.bodies.velocity[0], (1 - lag) * direction, atol=1e-11)
    np.testing.assert_allclose(world.bodies.spin[0], 0, atol=1e-12)


def test_in_shear_a_cube_drifts_by_its_place_and_spins_at_half_the_vorticity(make_world, scene_of):
    world = make_world({"monomer": 3}, scene_of(SHEAR, "drag", step=0.01))
    heights = [0.6, 0.0, -0.3]
    for slot, height in enumerate(heights):
        put(world, slot, [0.0, height, 0.5 * slot])
    b = world.bodies
    for _ in range(2500):
        world.step()
    np.testing.assert_allclose(b.position[:, 1], heights, atol=2e-3)  # along the flow alone
    np.testing.assert_allclose(b.velocity, [[RATE * y, 0, 0] for y in heights], atol=5e-3)
    np.testing.assert_allclose(b.spin, [[0, 0, -RATE / 2]] * 3, atol=1e-3)


def test_shear_has_its_still_place_and_follows_cubes_that_stand_askew(make_world, scene_of):
    gradient = np.array([[0.3, -1.0, 0.2], [0.5, 0.4, 0.0], [0.0, 2.0, -0.7]])
    centre = [0.2, -0.1, 0.4]
    effect = {"effect": "shear", "gradient": gradient.tolist(), "centre": centre}
    world = make_world({"monomer": 1, "trimer": 1}, scene_of(effect, "drag"))
    put(world, 0, centre, TURN.T)
    act(world)
    expected = np.einsum("ij,cpj->cpi", gradient, fluid_at(world) - centre)
    np.testing.assert_allclose(world.fluid, expected, atol=1e-13)
    np.testing.assert_allclose(world.fluid[0].mean(axis=0), 0, atol=1e-13)
    assert np.abs(world.fluid[0]).max() > 0.05  # it varies within a cube


@pytest.mark.parametrize(
    ("effects", "said"),
    [
        ((STREAM,), "effect 'current' needs effect 'drag'"),
        ((SHEAR,), "effect 'shear' needs effect 'drag'"),
        ((STREAM, STREAM, "drag"), "effect 'current' is listed twice"),
        ((CALM, SMOOTH, STREAM, "drag"), "'agitation' and 'ornstein-uhlenbeck' conflict"),
        ((STREAM | {"velocity": [1.0, 0.0]}, "drag"), "velocity"),
        ((STREAM | {"velocity": [1.0, 0.0, float("nan")]}, "drag"), "finite"),
        (({"effect": "current"}, "drag"), "velocity"),
        ((SHEAR | {"gradient": [[1, 0, 0], [0, 1, 0], [0, 0, -1.9]]}, "drag"), "compresses the fluid; expected 0"),
        ((SHEAR | {"gradient": [[0, float("inf"), 0], [0, 0, 0], [0, 0, 0]]}, "drag"), "finite"),
        ((SHEAR | {"gradient": [0, 1, 0]}, "drag"), "gradient"),
    ],
)
def test_what_cannot_be_is_refused(scene_of, effects, said):
    with pytest.raises(ValueError, match=said):
        scene_of(*effects)


def test_walls_hold_against_a_current(make_world, scene_of):
    """It presses the cubes against a wall, and the run goes on."""
    world = make_world({"monomer": 6}, scene_of("agitation", STREAM, SHEAR, "drag", "walls", "contact"))
    for _ in range(800):
        world.step()
    assert np.abs(world.bodies.centre).max(axis=0) == pytest.approx(world.half, abs=1.5)
    assert world.bodies.centre[:, 0].mean() > 0.3
