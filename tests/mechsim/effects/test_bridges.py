"""The bound by which breaking passes bodies over: never exceeded, and needed."""

from itertools import product

import numpy as np
import pytest

from kinetics.assembly import Structure
from kinetics.runs import NO_BREAK
from mechsim.effects.breaking import BOUNDS, CRITERIA, most_of_a_push
from mechsim.effects.bridges import Bridges
from mechsim.kernels.loads import SLACK, bond_loads, hit_bound
from mechsim.runs.record import RunSpec, execute
from mechsim.world.bodies import BodyShape, matrix_of

MASS, EDGE = 0.7, 0.3
SHAPES = {
    "dimer": ((0, 0, 0), (1, 0, 0)),
    "line": ((0, 0, 0), (0, 0, 1), (0, 0, 2), (0, 0, 3)),
    "bent": ((0, 0, 0), (1, 0, 0), (1, 1, 0), (1, 1, 1), (2, 1, 1)),
    "ring with a tail": ((0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (2, 0, 0), (3, 0, 0)),
}


def shares_of_bound(criterion, places, rng, tries=3000):
    """Largest load over its bound, of random hits: one or several, on the surface, far off it and between two cubes."""
    structure = Structure(places, (0,) * len(places), ("a",) * len(places))
    bridges, shape = Bridges.of(structure), BodyShape.of(places)
    levers = bridges.levers(shape.offset)
    of_pull, of_moment, of_change = BOUNDS[criterion]
    found = []
    for _ in range(tries):
        position, orientation = rng.standard_normal((1, 3)), rng.standard_normal((1, 4))
        orientation /= np.linalg.norm(orientation)
        turn = matrix_of(orientation[0])
        n = int(rng.integers(1, 4))
        off = rng.choice([0.5, 0.6, 3.0]) * rng.uniform(-1, 1, (n, 3))
        off[rng.random((n, 3)) < 0.3] = 0.5
        contact = position + EDGE * (shape.offset[rng.integers(len(places), size=n)] + off @ shape.frame) @ turn.T
        impulse = rng.standard_normal((n, 3))
        loads = np.zeros((len(bridges.bonds), 3))
        centre = position + EDGE * shape.offset @ turn.T
        bond_loads(bridges.bonds, bridges.sides, centre, contact, impulse, MASS, EDGE, loads)
        mass = MASS * len(places)
        most = 0.0
        for at, push in zip(contact, impulse, strict=True):
            sign = float(rng.choice([-1, 1]))
            most += hit_bound(
                levers, bridges.sides, shape.offset, position, orientation, 0, tuple(at), tuple(sign * push), sign,
                EDGE, of_pull, of_moment, of_change / mass,
            )  # fmt: skip
        change = float(np.linalg.norm(impulse.sum(axis=0)) / mass)
        found.append((n, CRITERIA[criterion](loads, change).max() / most))
    return np.array(found)


@pytest.mark.parametrize("criterion", CRITERIA)
@pytest.mark.parametrize("shape", SHAPES)
def test_no_hit_loads_a_bond_above_the_bound(criterion, shape):
    contacts, shares = shares_of_bound(criterion, SHAPES[shape], np.random.default_rng(7)).T
    assert shares.max() <= 1
    assert shares.max() > 0.9  # nine tenths of the bound would be none
    if criterion == "impulse":  # of one contact the bound is the load itself, but for rounding
        assert np.median(shares[contacts == 1]) > 1 - 1e-4


@pytest.mark.parametrize("criterion", CRITERIA)
@pytest.mark.parametrize("shape", SHAPES)
def test_a_push_anywhere_counts_as_no_more_than_the_most_of_a_push(criterion, shape):
    """On the surface and a tenth of an edge off it; nor is that much more than what some push counts as."""
    places = SHAPES[shape]
    structure = Structure(places, (0,) * len(places), ("a",) * len(places))
    bridges, shape_of, rng = Bridges.of(structure), BodyShape.of(places), np.random.default_rng(8)
    cubes, levers = shape_of.offset, bridges.levers(shape_of.offset)
    of_pull, of_moment, of_change = BOUNDS[criterion]
    bound = of_pull, of_moment, of_change / (MASS * len(places))
    most, largest = most_of_a_push(bridges, levers, cubes, bound), 0.0
    pose = np.zeros((1, 3)), np.array([[0.0, 0, 0, 1]])
    for _ in range(3000):
        off = rng.choice([-0.6, -0.5, 0.5, 0.6], 3) * rng.choice([1.0, rng.random()], 3)
        place = EDGE * (cubes[rng.integers(len(places))] + off @ shape_of.frame)
        push = rng.standard_normal(3)
        push /= np.linalg.norm(push)
        counts = hit_bound(levers, bridges.sides, cubes, *pose, 0, tuple(place), tuple(push), 1.0, EDGE, *bound)
        largest = max(largest, counts)
    assert 0.4 * most < largest <= most


@pytest.mark.parametrize("shape", SHAPES)
def test_the_most_of_a_push_is_that_of_some_corner(shape):
    """Of boxes two edges wide around each cube of the side that is hit; by what pushes along x, y and z do there."""
    places = SHAPES[shape]
    structure, cubes = Structure(places, (0,) * len(places), ("a",) * len(places)), BodyShape.of(places).offset
    bridges = Bridges.of(structure)
    levers, most = bridges.levers(cubes), 0.0
    for lever, side in zip(levers, bridges.sides, strict=True):
        for struck, who in enumerate((~side, side)):
            for place in (cube + corner for cube in cubes[who] for corner in product((-1.0, 1.0), repeat=3)):
                loads = np.array([lever[struck] @ np.append(push, np.cross(place, push)) for push in np.eye(3)])
                pull, moment = (np.linalg.norm(part, ord=2) for part in (loads[:, :3], loads[:, 3:]))
                most = max(most, 0.4 * pull + 0.7 * moment)
    rounding = SLACK * (1.1 * (5.0 + np.abs(cubes).sum(axis=1).max()) + 0.2)
    expected = (1.0 + SLACK) * (most + 0.2 + rounding)
    assert most_of_a_push(bridges, levers, cubes, (0.4, 0.7, 0.2)) == pytest.approx(expected, rel=1e-9)


@pytest.mark.parametrize("criterion", CRITERIA)
def test_a_bound_with_the_hit_on_the_wrong_side_is_exceeded(criterion, monkeypatch):
    """The control: levers of the other side, as if another cube had been hit."""
    true = Bridges.levers
    monkeypatch.setattr(Bridges, "levers", lambda self, places: true(self, places)[:, ::-1].copy())
    _, shares = shares_of_bound(criterion, SHAPES["line"], np.random.default_rng(7), tries=300).T
    assert (shares.max() > 1) == (criterion != "velocity")  # which looks at no lever


def test_between_two_cubes_rounding_does_not_decide_who_was_hit():
    """A contact a rounding error off the plane between the cubes of a dimer, to either side, has one bound."""
    structure = Structure(SHAPES["dimer"], (0, 0), ("a", "a"))
    bridges, cubes = Bridges.of(structure), np.array([[-0.5, 0, 0], [0.5, 0, 0]])
    pose = np.zeros((1, 3)), np.array([[0.0, 0, 0, 1]])

    def bound(x):
        place, impulse = (x, 0.5 * EDGE, 0.0), (1.0, -0.4, 0.2)
        return hit_bound(
            bridges.levers(cubes), bridges.sides, cubes, *pose, 0, place, impulse, 1.0, EDGE, 1.0, 0.0, 0.0
        )

    assert bound(1e-12) == pytest.approx(bound(-1e-12), rel=1e-9)
    assert bound(0.1 * EDGE) != pytest.approx(bound(-0.1 * EDGE), rel=1e-2)  # clear of it the side decides


def test_a_structure_without_bridges_carries_nothing_that_is_judged():
    ring = ((0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0))
    structure = Structure(ring, (0,) * 4, ("a",) * 4)
    assert Bridges.of(structure).levers(BodyShape.of(ring).offset).shape == (0, 2, 6, 6)


def digests(line4, monkeypatch, factor):
    """Runs that break much, by each criterion, with the bound times `factor`."""
    true = dict(BOUNDS)
    for name in BOUNDS:
        monkeypatch.setitem(BOUNDS, name, tuple(factor * x for x in true[name]))
    found = []
    for criterion, threshold in (("impulse", 0.002), ("wrench", 0.006), ("velocity", 0.4)):
        scene = line4.changed("breaking", criterion=criterion, threshold=threshold)
        record = execute(RunSpec(scene, {"quadmer": 15, "trimer": 10, "dimer": 5}, 4.0, 1, 0, poses=3.0))
        found.append((record.digest, int((record.arrays["partners"] != NO_BREAK).sum())))
    monkeypatch.undo()
    return found


def test_passing_bodies_over_changes_no_run(line4, monkeypatch):
    """Every body judged, only those that the bound leaves, and, as a control, a tenth of the bound."""
    told = digests(line4, monkeypatch, 1.0)
    assert all(breaks >= 5 for _, breaks in told), told
    assert digests(line4, monkeypatch, 1e9) == told
    assert all(wrong != right for wrong, right in zip(digests(line4, monkeypatch, 0.1), told, strict=True))
