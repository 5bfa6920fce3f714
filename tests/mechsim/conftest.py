"""Small worlds for the tests of the mechanics."""

import numpy as np
import pytest

from kinetics.assembly import RuleBook, derive
from mechsim.scene import Scene
from mechsim.world import World


@pytest.fixture(scope="session")
def book():
    return RuleBook.load("line4")


@pytest.fixture(scope="session")
def derivation(book):
    return derive(book)


@pytest.fixture(scope="session")
def line4():
    return Scene.load("line4")


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
