"""The engine that holds bodies near a contact alone, step by step beside the one that holds all."""

import numpy as np
import pytest
from handling import put

from mechsim.runs.record import book_of
from mechsim.scene import Scene
from mechsim.world.engines import near_engine
from mechsim.world.world import World

CROWD = {
    "line4": {"monomer": 40, "dimer": 20, "trimer": 10, "quadmer": 10},
    "t5": {"monomer": 20, "trimer.a": 8, "trimer.b": 8, "trimer.c": 8, "quadmer.a": 6, "quadmer.b": 6, "pentamer": 8},
}


@pytest.fixture
def make():
    """make(scene, composition, engine=, seed=): a populated world."""
    made = []

    def make(scene, composition, engine="near", seed=1):
        book, derivation = book_of(scene.rules)
        start = [derivation.structures[name] for name, n in composition.items() for _ in range(n)]
        numerics = scene.numerics.replace(engine=engine)
        made.append(
            World(
                scene.replace(numerics=numerics),
                book,
                sum(map(len, start)),
                np.random.SeedSequence(seed),
            )
        )
        made[-1].populate(start)
        return made[-1]

    yield make
    for world in made:
        world.engine.close()


def side_by_side(full, near, steps):
    """Steps of both from the same poses and motions: bodies that touched something but were left out, and by how much
    velocities differ afterwards, of bodies that touched nothing and of the others."""
    names = ("position", "orientation", "velocity", "spin")
    missed, free, touched = 0, [], []
    for _ in range(steps):
        for name in names:
            getattr(near.bodies, name)[:] = getattr(full.bodies, name)
        for slot in near.bodies.live.tolist():
            near.engine.put(slot)
        near.bodies.locate()
        full.step()
        near.step()
        is_touched = np.zeros(full.bodies.n_cubes, bool)
        is_touched[list(full.engine.near_contacts())] = True
        missed += int((is_touched & ~near.engine.is_in).sum())
        differ = np.abs(full.bodies.velocity - near.bodies.velocity).max(axis=1)
        touched += differ[is_touched].tolist()
        free += differ[~is_touched].tolist()
    return missed, np.array(free), np.array(touched)


@pytest.mark.parametrize("name", CROWD)
def test_every_body_that_touches_something_is_in_and_moves_as_with_all_bodies_in(make, name):
    scene = Scene.load(name)
    scene = scene.without(*scene.openers("break"), *scene.openers("join"))
    full, near = make(scene, CROWD[name], "pybullet"), make(scene, CROWD[name])
    missed, free, touched = side_by_side(full, near, 500)
    assert missed == 0
    assert len(touched) > 1000
    assert free.max() < 1e-12
    assert np.quantile(touched, 0.6) < 1e-12  # most groups are the same with all bodies in
    assert np.quantile(touched, 0.97) < 3e-4  # where the solver stops


def test_bodies_that_touch_are_seen_to_be_left_out(make, monkeypatch, line4):
    """Control: a search for boxes that overlap by a tenth of their size."""
    monkeypatch.setattr(near_engine, "BREAKING", -0.1)
    scene = line4.without("breaking", "bonding")
    full, near = make(scene, CROWD["line4"], "pybullet"), make(scene, CROWD["line4"])
    missed, _, _ = side_by_side(full, near, 100)
    assert missed > 50


def test_few_bodies_are_in_through_joins_and_breaks(make, line4):
    world = make(line4.changed("breaking", threshold=0.002), {"monomer": 60, "quadmer": 5})
    sizes, share = [], []
    world.listeners.append(lambda event: sizes.append((len(event.before), len(event.after))))
    for _ in range(3000):
        world.step()
        share.append(world.engine.is_in.sum() / len(world.bodies.live))
        assert set(np.flatnonzero(world.engine.is_in)) <= set(world.bodies.live)
    assert {(1, 2), (2, 1)} <= set(sizes)
    assert np.mean(share) < 0.2
    assert sorted(world.bodies.flat) == list(range(80))


def test_walls_hold_bodies_that_pass_through_each_other(make, line4):
    world = make(line4.without("breaking", "bonding", "contact"), {"monomer": 60})
    seen = []
    for _ in range(500):
        world.step()
        seen += [min(touch.a, touch.b) for touch in world.engine.touches()]
    assert set(seen) == {-1}


def test_what_is_set_aside_touches_nothing(make, line4):
    """A body leaves its place in the engine as it flies away; another one that comes there meets nobody."""
    world = make(line4.without("agitation", "drag", "walls", "breaking", "bonding"), {"monomer": 3})
    put(world, 0, (0, 0, 0))
    put(world, 1, (0.14, 0, 0), velocity=(1, 0, 0))
    put(world, 2, (0.5, 0.14, 0), velocity=(-1, 0, 0))
    world.step()
    assert world.engine.is_in.tolist() == [True, True, False]
    put(world, 0, (0, 0.7, 0))
    put(world, 1, (0.7, 0, 0))
    for _ in range(180):
        world.step()
        assert not world.engine.is_in.any()
    np.testing.assert_allclose(world.bodies.velocity[2], (-1, 0, 0), rtol=1e-12)


def test_the_same_seed_gives_the_same_bits(make, line4):
    def places(seed):
        world = make(line4, {"monomer": 60}, seed=seed)
        for _ in range(400):
            world.step()
        return world.bodies.centre.tobytes()

    assert places(1) == places(1) != places(2)


@pytest.mark.validate
def test_cubes_touch_and_move_as_often_and_as_fast_as_with_all_in(make, line4):
    """Over 24 runs of each, mean speed and mean number of bodies that touch something; false alarm 1e-6 each."""

    def means(engine, restitution=0.3):
        scene, found = line4.without("breaking", "bonding").changed("contact", restitution=restitution), []
        for seed in range(24):
            world, seen = make(scene, {"monomer": 60}, engine, seed), []
            for _ in range(4000):
                world.step()
                seen.append((np.linalg.norm(world.bodies.velocity, axis=1).mean(), len(world.engine.near_contacts())))
            found.append(np.mean(seen[200:], axis=0))
        return np.array(found)

    def z(a, b):
        return (a.mean(axis=0) - b.mean(axis=0)) / np.sqrt(a.var(axis=0, ddof=1) / 24 + b.var(axis=0, ddof=1) / 24)

    full = means("pybullet")
    assert np.abs(z(means("near"), full)).max() < 5.7  # of 46 degrees of freedom
    assert np.abs(z(means("near", restitution=0.8), full)).max() > 5.7
