"""Small worlds for the tests of the mechanics."""

import numpy as np
import pytest

from kinetics.assembly import RuleBook, derive
from kinetics.support.settings import validated
from mechsim.scene import Scene
from mechsim.world.engines import engine_named
from mechsim.world.world import World


@pytest.fixture(scope="session")
def book():
    return RuleBook.load("line4")


@pytest.fixture(scope="session")
def derivation(book):
    return derive(book)


@pytest.fixture(scope="session")
def line4():
    return Scene.load("line4")


@pytest.fixture(scope="session")
def by_engine():
    """by_engine(name): the shipped scene, computed by this engine; skips where it cannot be installed."""

    def make(name):
        for package in engine_named(name).packages:
            pytest.importorskip(package)
        data = Scene.load("line4").as_dict()
        data["numerics"]["engine"] = name
        return validated(Scene, data, "scene")

    return make


@pytest.fixture
def make_world(book, derivation, line4):
    """make_world(composition, scene=, seed=): a populated world, freed after the test."""
    made = []

    def make(composition, scene=line4, seed=1):
        start = [derivation.structures[name] for name, n in composition.items() for _ in range(n)]
        world = World(scene, book, sum(len(s) for s in start), np.random.SeedSequence(seed))
        made.append(world)
        world.populate(start)
        return world

    yield make
    for world in made:
        world.engine.close()


@pytest.fixture
def scene_of(line4):
    """scene_of({"effect": ...}, ..., step=, edge=, density=, tank=, guard=): line4's tank with these effects alone.

    A bare name stands for the effect as line4 lists it.
    """

    def make(*effects, step=None, edge=None, density=None, tank=None, guard=None):
        data = line4.as_dict()
        as_listed = {item["effect"]: item for item in data["effects"]}
        data["effects"] = [as_listed[e] if isinstance(e, str) else e for e in effects]
        data["numerics"] |= {"step": step} if step else {}
        data["cubes"] |= ({"edge": edge} if edge else {}) | ({"density": density} if density else {})
        data["tank"] |= {"size": tank} if tank else {}
        data["guard"] |= guard or {}
        return validated(Scene, data, "scene")

    return make
