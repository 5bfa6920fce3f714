"""Meetings that begin and end between two steps: who is followed, and that nothing is missed or made up."""

import itertools
import math

import numpy as np
import pytest

from mechsim.effects.faces import FacesWithinReach
from tests.mechsim.effects.test_bonding import CAPTURE, COSINE, EDGE, SIDEWAYS, find, naive, turned

LEVEL = [np.eye(3), np.eye(3)]
MET = {(0, 4, 1, 5)}


def above(gap, aside=0.0):
    """Two cubes, one above the other."""
    return [[0, 0, 0], [aside, 0, EDGE + gap]]


def test_cubes_that_pass_each_other_between_two_looks_meet():
    """One flies past above the other; within reach, 0.075 aside at most, only on its way."""
    before, now = above(0.01, -0.08), above(0.01, 0.08)
    assert find(now, LEVEL) == find(before, LEVEL) == set()  # the control: poses at the looks alone
    assert find(now, LEVEL, before=(before, LEVEL)) == MET


@pytest.mark.parametrize("gap", [CAPTURE + 1e-9, 0.05])
def test_cubes_that_never_come_within_reach_do_not_meet(gap):
    assert find(above(gap, 0.08), LEVEL, before=(above(gap, -0.08), LEVEL)) == set()
    assert find(above(CAPTURE - 1e-9, 0.08), LEVEL, before=(above(CAPTURE - 1e-9, -0.08), LEVEL)) == MET


def test_a_cube_that_comes_and_goes_along_another_line_does_not_meet():
    """Both ends of its way are near, and so are the bounds of its motion; but its way is too far aside."""
    before, now = [[0, 0, 0], [-0.09, 0, EDGE]], [[0, 0, 0], [0, -0.09, EDGE]]
    assert find(now, LEVEL, before=(before, LEVEL)) == MET  # 0.064 aside at the nearest
    further = [[[0, 0, 0], [-0.11, 0, EDGE]], [[0, 0, 0], [0, -0.11, EDGE]]]  # 0.078
    assert find(further[1], LEVEL, before=(further[0], LEVEL)) == set()


def test_cubes_that_only_turn_meet_while_their_faces_look_at_each_other():
    """Both turn from 15 degrees to one side to 15 to the other; up to 10.8 degrees they are 0.03 aside at most."""
    apart = above(0.01)
    ends = [[turned(0, angle)] * 2 for angle in (-15, 15)]
    assert [find(apart, axes, sideways=0.03) for axes in ends] == [set(), set()]  # the control
    assert find(apart, ends[1], before=(apart, ends[0]), sideways=0.03) == MET
    further = [turned(0, angle) @ ends[1][0] for angle in (0, 25)]  # on, from 15 degrees to 40
    assert find(apart, [further[1]] * 2, before=(apart, [further[0]] * 2), sideways=0.03) == set()


@pytest.mark.parametrize("young", [0, 1])
def test_a_body_born_since_the_last_look_is_seen_where_it_is(young):
    """It was not there to be met: neither by its own way nor by the other's."""
    before, now = above(0.01, -0.08), above(0.01, 0.08)
    born = [0.0, 0.0]
    assert find(now, LEVEL, before=(before, LEVEL), born=born) == MET
    born[young] = 1.0  # at the last look, after it
    assert find(now, LEVEL, before=(before, LEVEL), born=born) == set()
    assert find(above(0.01), LEVEL, before=(before, LEVEL), born=born) == MET  # as it stands now


def slow(now, before, looks=200):
    """Pairs of faces of two cubes within reach at any of many looks between the two; every look is made."""
    share = np.linspace(0, 1, looks, endpoint=False)[:, None, None, None]
    axes = (1 - share) * now[1] + share * before[1]  # (looks, 2, 3, 3)
    centre = (1 - share[..., 0]) * now[0] + share[..., 0] * before[0]
    between = centre[:, 1] - centre[:, 0]
    met = set()
    for f, g in itertools.product(range(6), repeat=2):
        a = axes[:, 0, :, f // 2] * (1, -1)[f % 2]
        b = axes[:, 1, :, g // 2] * (1, -1)[g % 2]
        n = (a - b) / (np.linalg.norm(a - b, axis=1)[:, None] + 1e-300)
        along = (between * n).sum(axis=1)
        supports = EDGE / 2 * np.abs(np.einsum("tcik,ti->tck", axes, n)).sum(axis=(1, 2))
        aside = np.linalg.norm(between - along[:, None] * n, axis=1)
        looking = ((a * b).sum(axis=1) <= -COSINE) & ((a * between).sum(axis=1) > 0) & (along > 0)
        if (looking & (aside <= SIDEWAYS) & (along - supports <= CAPTURE)).any():
            met.add((0, f, 1, g))
    return met


def test_the_kernel_finds_what_many_looks_find():
    """Two cubes side by side that move and turn at random, slowly to fast. What the two find may differ in passages
    shorter than 1/64 of the way alone.
    """
    rng = np.random.default_rng(7)
    found, expected, present = set(), set(), set()
    for trial in range(1000):
        size = 10 ** rng.uniform(-2.5, -1.2)
        place = rng.normal(0, 1, 3)
        centre = np.array([np.zeros(3), rng.uniform(1.0, 1.6) * EDGE * place / np.linalg.norm(place)])
        axes = np.array([rotation(rng.normal(0, 1, 3)) for _ in range(2)])
        last = np.array([rotation(rng.normal(0, min(2 * size, 0.15), 3)) @ own for own in axes])
        before = centre + rng.normal(0, size, (2, 3)), last
        found |= {(trial, *pair) for pair in find(centre, axes, before=before)}
        expected |= {(trial, *pair) for pair in slow((centre, axes), before)}
        present |= {(trial, *pair) for pair in naive(centre, axes)}
    assert present <= found & expected
    assert len(expected - present) > 50  # the control: how many are met in between only
    assert len(found ^ expected) <= 0.03 * len(expected - present)


def rotation(vector):
    angle = float(np.linalg.norm(vector))
    x, y, z = vector / angle
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + math.sin(angle) * cross + (1 - math.cos(angle)) * cross @ cross


def passing(make_world, scene, latch):
    """One free cube is about to fly past another, 0.062 a step: within reach, 0.015 aside, only between two steps."""
    bonding = scene.changed("bonding", latch=latch).without("agitation", "drag", "walls", "breaking")
    world = make_world({"monomer": 2}, bonding)
    b, step = world.bodies, world.step_size
    for slot, place, speed in zip(b.live.tolist(), above(0.01, -0.0925), (0.0, 0.0617 / step), strict=True):
        b.position[slot], b.orientation[slot] = place, [0, 0, 0, 1]
        b.velocity[slot] = [speed, 0, 0]
        world.engine.put(slot)
    b.locate()
    return world


def test_a_passage_in_a_run_bonds_where_meetings_count(make_world, line4):
    scene = line4.changed("bonding", sideways=0.1)
    world = passing(make_world, scene, {"kind": "encounter", "probability": 1.0})
    seen = []
    for _ in range(4):
        world.step()
        seen.append(len(world.bodies.live))
    assert seen == [2, 1, 1, 1]
    waiting = passing(make_world, scene, {"kind": "delay", "rate": 1e9})
    for _ in range(4):  # the control: the time within reach is what counts, and no step ends there
        waiting.step()
    assert len(waiting.bodies.live) == 2


def test_a_tank_put_back_is_not_passed_through(make_world, line4, book):
    """New places are not ways: after a restart cubes are looked at where they stand."""
    world = make_world({"monomer": 40}, line4.without("bonding", "breaking"))
    faces, wrong = (FacesWithinReach(world, CAPTURE, 135.0, EDGE / 2, in_passing=True) for _ in range(2))
    plain = FacesWithinReach(world, CAPTURE, 135.0, EDGE / 2)
    followed = 0
    for _ in range(10):
        for _ in range(3):
            world.step()
            faces.within_reach()
            wrong.within_reach()
        world.populate([book.monomer()] * 40)
        world.step()
        assert faces.within_reach().tolist() == plain.within_reach().tolist()
        wrong.looked = np.inf  # the control: ages are not asked for
        followed += len(wrong.within_reach()) - len(plain.within_reach())
    assert followed > 20
