"""The bound by which breaking passes bodies over: never exceeded, and needed."""

import numpy as np
import pytest

from kinetics.assembly import Structure
from mechsim.effects.breaking import BOUNDS, CRITERIA
from mechsim.effects.bridges import Bridges
from mechsim.kernels.loads import bond_loads
from mechsim.runs.record import RunSpec, execute

MASS, EDGE = 0.7, 0.3
SHAPES = {
    "dimer": ((0, 0, 0), (1, 0, 0)),
    "line": ((0, 0, 0), (0, 0, 1), (0, 0, 2), (0, 0, 3)),
    "bent": ((0, 0, 0), (1, 0, 0), (1, 1, 0), (1, 1, 1), (2, 1, 1)),
    "ring with a tail": ((0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (2, 0, 0), (3, 0, 0)),
}


class Bodies:
    edge, cube_mass = EDGE, MASS


def shares_of_bound(criterion, structure, rng, tries=3000):
    """Largest load over its bound, of random hits: on the surface and far off it, alone and several at once."""
    bridges = Bridges.of(structure)
    fixed, by_arm = BOUNDS[criterion](bridges, structure, Bodies)
    lattice = np.array(structure.positions, float) * EDGE
    found = []
    for _ in range(tries):
        turn, _ = np.linalg.qr(rng.standard_normal((3, 3)))
        place = lattice @ turn.T + rng.standard_normal(3)
        n = int(rng.integers(1, 4))
        off = EDGE * rng.choice([0.5, 0.6, 3.0]) * rng.uniform(-1, 1, (n, 3))
        contact = place[rng.integers(len(place), size=n)] + off @ turn.T
        impulse = rng.standard_normal((n, 3))
        loads = np.zeros((len(bridges.bonds), 3))
        bond_loads(bridges.bonds, bridges.sides, place, contact, impulse, MASS, EDGE, loads)
        change = float(np.linalg.norm(impulse.sum(axis=0)) / (MASS * len(place)))
        arms = np.linalg.norm(contact - place.mean(axis=0), axis=1)
        most = np.linalg.norm(impulse, axis=1) @ (fixed + by_arm * arms)
        found.append(CRITERIA[criterion](loads, change).max() / most)
    return np.array(found)


@pytest.mark.parametrize("criterion", CRITERIA)
@pytest.mark.parametrize("shape", SHAPES)
def test_no_hit_loads_a_bond_above_the_bound(criterion, shape):
    places = SHAPES[shape]
    structure = Structure(places, (0,) * len(places), ("a",) * len(places))
    shares = shares_of_bound(criterion, structure, np.random.default_rng(7))
    assert shares.max() <= 1
    assert shares.max() > 0.3  # a third of the bound would be none


def test_a_structure_without_bridges_carries_nothing_that_is_judged():
    ring = ((0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0))
    structure = Structure(ring, (0,) * 4, ("a",) * 4)
    for bound in BOUNDS.values():
        assert bound(Bridges.of(structure), structure, Bodies) == (0.0, 0.0)


def digests(line4, monkeypatch, factor):
    """Runs that break much, by each criterion, with the bound times `factor`."""
    true = dict(BOUNDS)
    for name in BOUNDS:
        monkeypatch.setitem(BOUNDS, name, lambda *args, name=name: tuple(factor * x for x in true[name](*args)))
    found = []
    for criterion, threshold in (("impulse", 0.002), ("wrench", 0.006), ("velocity", 0.4)):
        scene = line4.changed("breaking", criterion=criterion, threshold=threshold)
        record = execute(RunSpec(scene, {"quadmer": 15, "trimer": 10, "dimer": 5}, 4.0, 1, 0, poses=3.0))
        found.append((record.digest, int((record.arrays["partners"] >= -2).sum())))
    monkeypatch.undo()
    return found


def test_passing_bodies_over_changes_no_run(line4, monkeypatch):
    """Every body judged, only those that the bound leaves, and, as a control, a tenth of the bound."""
    told = digests(line4, monkeypatch, 1.0)
    assert all(breaks >= 5 for _, breaks in told), told
    assert digests(line4, monkeypatch, 1e9) == told
    assert all(wrong != right for wrong, right in zip(digests(line4, monkeypatch, 0.1), told, strict=True))
