"""The boxes that a structure collides with, and the seams that boxes cube by cube would have."""

import sys
from itertools import product

import numpy as np
import pytest
from handling import collide

from mechsim.world.boxes import boxes_of
from mechsim.world.engines import engine_named

LINE = tuple((x, 0, 0) for x in range(4))
TEE = ((0, 0, 0), (1, 0, 0), (2, 0, 0), (1, 1, 0), (1, 2, 0))
PLATE = tuple(product(range(3), range(3), range(1)))


def cubes_of(boxes):
    return sorted(tuple(np.add(low, step)) for low, size in boxes for step in product(*map(range, size)))


@pytest.mark.parametrize(("positions", "boxes"), [(LINE, 1), (TEE, 2), (PLATE, 1), (((0, 0, 0), (1, 1, 1)), 2)])
def test_what_is_one_box_stays_one(positions, boxes):
    assert len(boxes_of(positions)) == boxes


def test_boxes_hold_each_cube_once():
    rng = np.random.default_rng(4)
    for _ in range(200):
        places = rng.integers(-2, 3, size=(rng.integers(1, 14), 3))
        positions = tuple({tuple(map(int, place)) for place in places})
        boxes = boxes_of(positions)
        assert cubes_of(boxes) == sorted(positions)
        assert boxes == boxes_of(positions[::-1])


def cube_by_cube(positions):
    return tuple((place, (1, 1, 1)) for place in positions)


def squeezes(make_world, scene, trials):
    """Two lines thrown at each other: of each first touch, the sum of the pushes over their resultant."""
    world = make_world({"quadmer": 2}, scene.without("agitation", "drag", "walls", "breaking", "bonding"))
    rng, b, found = np.random.default_rng(7), world.bodies, []
    for _ in range(trials):
        for slot, side in zip(b.live, (-0.35, 0.35), strict=True):
            b.orientation[slot] = rng.standard_normal(4)
            b.orientation[slot] /= np.linalg.norm(b.orientation[slot])
            b.position[slot] = side, *rng.uniform(-0.15, 0.15, 2)
            b.velocity[slot], b.spin[slot] = (-2.5 * side, 0.0, 0.0), 4 * rng.standard_normal(3)
            world.engine.put(slot)
        b.locate()
        for _ in range(80):
            collide(world)
            pushes = np.array([touch.impulse for touch in world.engine.touches()])
            if len(pushes):
                found.append(np.linalg.norm(pushes, axis=1).sum() / np.linalg.norm(pushes.sum(axis=0)))
                break
    return np.array(found)


def test_no_collision_squeezes_a_line_at_a_seam(make_world, line4, monkeypatch):
    """Convex bodies push each other apart one way, so the pushes add up to their resultant."""
    whole = squeezes(make_world, line4, 1500)
    homes = [sys.modules[kind.__module__] for kind in engine_named(line4.numerics.engine).load().__mro__]
    monkeypatch.setattr(next(home for home in homes if hasattr(home, "boxes_of")), "boxes_of", cube_by_cube)
    parts = squeezes(make_world, line4, 1500)
    assert whole.max() < 1.05
    assert (parts > 1.5).sum() > 5  # the control
