"""The engine facts the mechanics rests on, and the momenta it keeps."""

import numpy as np
import pytest
from handling import act, collide

from mechsim.kernels.motion import coast
from mechsim.world.bodies import BodyShape, matrix_of, quaternion_of

MIXED = {"monomer": 8, "dimer": 4, "trimer": 2, "quadmer": 2}


def stir(world, speed=1.5, seed=5):
    """Give every body a random motion."""
    rng = np.random.default_rng(seed)
    b = world.bodies
    for slot in b.live:
        b.velocity[slot], b.spin[slot] = speed * rng.standard_normal(3), 6 * rng.standard_normal(3)


def test_free_flight_equals_the_engine(make_world, line4):
    world = make_world(MIXED, line4.without("agitation", "drag", "breaking", "bonding", "contact", "walls"))
    stir(world)
    b = world.bodies
    for _ in range(150):
        world.engine.set_motions()
        world.engine.step()
        coast(b.live, b.position, b.orientation, b.velocity, b.spin, b.inertia, world.step_size)
        mine = b.position.copy(), b.orientation.copy(), b.velocity.copy(), b.spin.copy()
        world.engine.read(b.live.tolist())
        np.testing.assert_allclose(mine[0], b.position, atol=2e-14)
        sign = np.sign((mine[1] * b.orientation).sum(axis=1))[:, None]
        np.testing.assert_allclose(mine[1] * sign, b.orientation, atol=2e-13)
        np.testing.assert_allclose(mine[2], b.velocity, atol=1e-14)  # the default damping of 0.04 would show here
        np.testing.assert_allclose(mine[3], b.spin, atol=1e-13)


@pytest.mark.parametrize("sub_cycles", [1, 4])
def test_impulses_account_for_every_change_of_velocity(make_world, line4, sub_cycles):
    scene = line4.without("breaking", "bonding").changed("contact", friction=0.7).changed("drag", sub_cycles=sub_cycles)
    world = make_world(MIXED, scene)
    stir(world)
    b, touched = world.bodies, 0
    for _ in range(600):
        act(world)
        before = b.velocity.copy()
        collide(world)
        change = np.zeros_like(b.velocity)
        for touch in world.engine.touches():
            touched += 1
            for slot, sign in ((touch.a, 1), (touch.b, -1)):
                if slot >= 0:
                    change[slot] += sign * np.array(touch.impulse) / b.mass[slot]
        np.testing.assert_allclose((b.velocity - before)[b.live], change[b.live], atol=1e-10)
        b.locate()
    assert touched > 100


def test_without_agitation_and_drag_momentum_is_kept(make_world, line4):
    world = make_world({"monomer": 40}, line4.without("agitation", "drag", "walls", "breaking", "bonding"))
    stir(world)
    linear, angular = world.bodies.momentum()
    collisions = 0
    for _ in range(400):
        world.step()
        collisions += len(world.engine.touches())
    after = world.bodies.momentum()
    assert collisions > 5
    scale = np.abs(world.bodies.mass[:, None] * world.bodies.velocity).sum()
    np.testing.assert_allclose(after[0], linear, atol=1e-12 * scale)
    np.testing.assert_allclose(after[1], angular, atol=2e-3 * scale)  # the engine's penetration push is not central


def test_compounds_have_their_own_inertia(make_world):
    world = make_world(MIXED)
    b = world.bodies
    for slot in b.live:
        k = len(b.members[slot])
        along = b.cube_mass * b.edge**2 * k / 6
        across = b.cube_mass * b.edge**2 * (k / 6 + k * (k * k - 1) / 12)
        np.testing.assert_allclose(sorted(b.inertia[slot]), sorted([along, across, across]), rtol=1e-12)


def test_shape_of_an_l_is_turned_into_its_principal_axes():
    shape = BodyShape.of(((0, 0, 0), (1, 0, 0), (2, 0, 0), (2, 1, 0)))
    np.testing.assert_allclose(shape.offset.mean(axis=0), 0, atol=1e-15)
    tensor = np.eye(3) * ((shape.offset**2).sum() + 4 / 6) - shape.offset.T @ shape.offset
    np.testing.assert_allclose(tensor, np.diag(shape.inertia), atol=1e-14)
    assert np.linalg.det(shape.frame) == pytest.approx(1)


def test_quaternions_and_matrices_agree():
    rng = np.random.default_rng(2)
    for q in rng.standard_normal((50, 4)):
        unit = q / np.linalg.norm(q)
        back = quaternion_of(matrix_of(unit))
        np.testing.assert_allclose(back * np.sign(back @ unit), unit, atol=1e-14)


def test_joining_and_parting_keep_momenta_and_the_centre_of_mass(make_world, book, line4):
    world = make_world({"monomer": 1, "trimer": 1}, line4.without("walls"))
    stir(world)
    b = world.bodies

    def state():
        centre = (b.mass[b.live, None] * b.position[b.live]).sum(axis=0) / b.mass[b.live].sum()
        return *b.momentum(), centre

    before = state()
    (end,) = [c for c in b.members[b.live[1]] if b.uncovered[c, 4] and b.uncovered[c].sum() == 5][:1]
    free = b.members[b.live[0]][0]
    keeper, other, joined = world.docking(free, 4, end, 4)
    assert len(b.members[keeper]) == 3  # the heavier one keeps its orientation
    world.join(keeper, other, joined)
    assert len(b.live) == 1
    for was, now in zip(before, state(), strict=True):
        np.testing.assert_allclose(now, was, atol=1e-14)
    slot = int(b.live[0])
    places = b.centre.copy()
    i, j = b.held(slot).bonds[1]
    world.part(slot, book.break_bond(b.held(slot), i, j))
    assert sorted(len(b.members[s]) for s in b.live) == [2, 2]
    np.testing.assert_allclose(b.centre, places, atol=1e-14)
    for was, now in zip(before, state(), strict=True):
        np.testing.assert_allclose(now, was, atol=1e-14)
