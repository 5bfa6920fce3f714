"""Breaking: loads in closed form, by action and reaction, and what a broken bond leaves."""

import numpy as np
import pytest

from kinetics.assembly import Structure
from mechsim.effects.breaking import CRITERIA
from mechsim.effects.bridges import Bridges
from mechsim.kernels.loads import bond_loads
from mechsim.world.engines import Touch

MASS, EDGE = 0.7, 0.3
LINE = np.array([[-0.5, 0, 0], [0.5, 0, 0]]) * EDGE


def loads(bonds, sides, place, contact, impulse):
    out = np.zeros((len(bonds), 3))
    bond_loads(np.array(bonds), np.array(sides), place, np.array(contact), np.array(impulse), MASS, EDGE, out)
    return out


def test_a_push_along_a_dimer_loads_its_bond_with_half_the_impulse():
    (load,) = loads([(0, 1)], [[True, False]], LINE, [LINE[0]], [[1.0, 0, 0]])
    np.testing.assert_allclose(load, [-0.5, 0, 0], atol=1e-12)  # a push: negative tension
    (load,) = loads([(0, 1)], [[True, False]], LINE, [LINE[0]], [[-1.0, 0, 0]])
    np.testing.assert_allclose(load, [0.5, 0, 0], atol=1e-12)
    assert CRITERIA["impulse"](load[None], 0.0)[0] == pytest.approx(0.5)


def test_a_hit_across_a_dimer_loads_its_bond_with_a_fifth_of_the_impulse():
    # The hit cube moves off at 0.8 p / m: p / 2m from the whole, 0.3 p / m from the turn (inertia 5/6 m L^2).
    (load,) = loads([(0, 1)], [[True, False]], LINE, [LINE[0]], [[0, 1.0, 0]])
    np.testing.assert_allclose(load, [0, 0.2, 0], atol=1e-12)


def test_a_squeeze_from_both_sides_only_pushes():
    contact = LINE + np.array([[-0.5, 0, 0], [0.5, 0, 0]]) * EDGE
    (load,) = loads([(0, 1)], [[True, False]], LINE, contact, [[1.0, 0, 0], [-1.0, 0, 0]])
    np.testing.assert_allclose(load, [-1, 0, 0], atol=1e-12)
    assert CRITERIA["impulse"](load[None], 0.0)[0] == pytest.approx(0.0, abs=1e-12)


def test_the_velocity_criterion_looks_at_the_structure_and_breaks_its_most_loaded_bond():
    load = np.array([[0.1, 0.0, 9.0], [0.1, 0.3, 0.0], [-5.0, 0.2, 0.0]])
    tear = CRITERIA["velocity"](load, 1.5)
    assert int(np.argmax(tear)) == 1
    assert tear.max() == pytest.approx(1.5)
    np.testing.assert_array_equal(CRITERIA["velocity"](np.array([[-1.0, 0.0, 1.0]]), 1.5), [0.0])  # a push only


def test_both_sides_of_every_bond_tell_the_same():
    """Action and reaction: computed from either side, a bond carries the same load."""
    rng = np.random.default_rng(3)
    zigzag = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [1, 1, 1], [2, 1, 1]]) * EDGE
    bonds = [(0, 1), (1, 2), (2, 3), (3, 4)]
    sides = np.array([[c <= i for c in range(5)] for i, _ in bonds])
    for _ in range(20):
        turn, _ = np.linalg.qr(rng.standard_normal((3, 3)))
        place = zigzag @ turn.T + rng.standard_normal(3)
        contact = place[rng.integers(5, size=3)] + 0.3 * EDGE * rng.standard_normal((3, 3))
        impulse = rng.standard_normal((3, 3))
        one = loads(bonds, sides, place, contact, impulse)
        other = loads([(j, i) for i, j in bonds], ~sides, place, contact, impulse)
        np.testing.assert_allclose(one, other, atol=1e-10)


def test_bonds_in_a_loop_are_not_bridges():
    ring = ((0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0))
    tail = (2, 0, 0)
    bridges = Bridges.of(Structure((*ring, tail), (0,) * 5, ("a",) * 5))
    assert bridges.bonds.tolist() == [[1, 4]]
    assert bridges.sides.tolist() == [[True, True, True, True, False]]


def test_a_touch_loads_both_of_its_bodies(make_world, line4):
    """The engine names one of the two first; its impulse is on that one, and the opposite on the other."""
    scene = line4.changed("breaking", threshold=0.01, log_above=1e-6)
    world = make_world({"dimer": 2}, scene)
    b = world.bodies
    struck, other = (int(s) for s in b.live)
    judge = world.after["breaking"].__self__.judge
    end, next_to_it = (b.centre[cube] for cube in b.members[struck])
    pull = 0.004 * (end - next_to_it) / b.edge  # tears this end off its neighbour; the opposite presses it on
    as_first = Touch(struck, other, tuple(end), tuple(pull))
    as_second = Touch(other, struck, tuple(end), tuple(-pull))
    assert judge(struck, [as_first]).load == pytest.approx(0.002)
    assert judge(struck, [as_second]).load == pytest.approx(0.002)
    # The control: read with the wrong sign it is a push, which tears nothing.
    assert judge(struck, [as_second._replace(impulse=as_first.impulse)]) is None


def collide(make_world, scene, speed):
    """A free cube thrown sideways at the end of a line of three."""
    world = make_world({"trimer": 1, "monomer": 1}, scene.without("agitation", "drag", "walls", "bonding"))
    b = world.bodies
    line, ball = (int(s) for s in b.live)
    b.position[line], b.orientation[line] = 0, [0, 0, 0, 1]
    world.engine.put(line)
    b.locate()
    cubes = list(b.members[line])
    along = b.centre[cubes[-1]] - b.centre[cubes[0]]
    across = np.eye(3)[int(np.argmin(np.abs(along)))]
    end = max(cubes, key=lambda c: b.centre[c] @ along)
    b.position[ball], b.orientation[ball] = b.centre[end] - 1.6 * b.edge * across, [0, 0, 0, 1]
    b.velocity[ball] = speed * across
    world.engine.put(ball)
    b.locate()
    before = b.momentum()
    for _ in range(100):
        world.step()
    np.testing.assert_allclose(b.momentum()[0], before[0], atol=1e-15)
    return sorted(len(b.members[s]) for s in b.live)


def test_a_hard_hit_breaks_a_line_and_a_soft_one_does_not(make_world, line4):
    scene = line4.changed("breaking", threshold=0.002, grace=0.0)
    assert collide(make_world, scene, 0.3) == [1, 3]
    assert collide(make_world, scene, 6.0) == [1, 1, 2]
    assert collide(make_world, scene.without("breaking"), 6.0) == [1, 3]
    assert collide(make_world, scene.changed("breaking", grace=10.0), 6.0) == [1, 3]


def test_the_velocity_criterion_is_a_speed(make_world, line4):
    """The ball hits the end of the line squarely: the line takes on at most twice its share, 1/4 of 6 per tu."""
    scene = line4.changed("breaking", criterion="velocity", threshold=1.0, grace=0.0)
    assert collide(make_world, scene, 6.0) == [1, 1, 2]
    assert collide(make_world, scene.changed("breaking", threshold=3.1), 6.0) == [1, 3]
    assert collide(make_world, scene, 0.6) == [1, 3]
