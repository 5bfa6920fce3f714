"""What every model of crowding must do, so that a new one is tested by its line in `CROWDING_MODELS`."""

from itertools import product

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.spatial import ConvexHull
from scipy.spatial.transform import Rotation
from synthetic_runs import line_network

from kinetics.assembly import RuleBook, derive
from kinetics.network import Model, Tank
from kinetics.predicting import predict
from kinetics.rates import ChannelRate, ClassRates, Convention, CrowdingTerms, Rates
from kinetics.rates.breaks import Expansion, break_model
from kinetics.rates.crowding import CROWDING_MODELS, SOURCES, ConvexBodies, crowding_in, crowding_model
from kinetics.rates.crowding_terms import BodyGeometry

LINE = line_network()
EXPANSION = Expansion.of(LINE, break_model("collision-wall"))
TANK = Tank((2.0, 2.0, 3.0))
EDGE = 0.15
BODIES = ConvexBodies.of(derive(RuleBook.load("line4")).structures.values(), EDGE)
UNIT = np.array(list(product((-0.5, 0.5), repeat=3)))  # corners of a cube
STATES = np.random.default_rng(0).integers(0, 20, size=(30, 4))


@pytest.fixture(params=CROWDING_MODELS, ids=lambda model: model.name)
def model(request):
    return request.param


def shape_of(model, unit=0.4):
    return {p.name: float(p.value(unit)) for p in model.parameters}


def factors(model, shape, sources=SOURCES, tank=TANK, states=STATES):
    return crowding_in(EXPANSION, BODIES, tank, dict.fromkeys(sources, (model, shape))).factors(states)


def test_it_has_a_name_a_docstring_and_a_place_among_the_models(model):
    assert model.name == model.name.lower()
    assert type(model).__doc__
    assert crowding_model(model.name) is model
    assert len(model.parameters) <= 1  # what logged hits can tell


def test_a_crowd_never_makes_rates_smaller(model):
    found = factors(model, shape_of(model))
    fuller = factors(model, shape_of(model), states=STATES + np.array([0, 0, 0, 3]))
    assert (found > 0).all()
    assert (fuller >= found).all()
    alone = factors(model, shape_of(model), states=np.zeros((1, 4)))
    if not model.has_room:
        assert_allclose(alone, 1.0)  # an empty tank is mass action
    large = factors(model, shape_of(model), tank=Tank((200.0, 200.0, 300.0)), states=np.zeros((1, 4)))
    assert_allclose(large, 1.0, atol=5e-3)  # and room is that of a tank of this size


def test_each_source_has_its_own_channels(model):
    whole, one = factors(model, shape_of(model)), np.ones((30, len(EXPANSION.network.channels)))
    for source in SOURCES:
        found = factors(model, shape_of(model), [source])
        mine = (found != 1.0).any(axis=0)
        assert_allclose(found[:, mine], whole[:, mine])
        one[:, mine] *= found[:, mine]
    assert_allclose(one, whole)


def test_a_rates_file_keeps_it(model, tmp_path):
    geometry = zip(LINE.species, BODIES.radius, BODIES.surface, BODIES.volume, strict=True)
    terms = CrowdingTerms(
        walls=model.name,
        shape={"walls": shape_of(model)} if model.parameters else {},
        species={name: BodyGeometry(radius=float(r), surface=float(s), volume=float(v)) for name, r, s, v in geometry},
    )
    channels = {
        name: ChannelRate(rate=1e-3, ways=ways) for name, ways in zip(LINE.channels, LINE.ways.tolist(), strict=True)
    }
    breaks = {"model": "collision-wall", "shape": {"alpha": 1.0, "wall": 20.0}}
    rates = Rates(convention=Convention(combinations="distinct"), channels=channels, tank=TANK.size, crowding=terms)
    rates = rates.replace(breaks=type(rates.breaks)(**breaks))
    rates.save(tmp_path / "rates.toml")
    again = Rates.load(tmp_path / "rates.toml")
    assert again == rates
    for tank in (None, Tank((3.0, 3.0, 2.0))):
        plain, crowded = (r.apply(LINE, tank).propensities(STATES) for r in (rates.replace(crowding=None), again))
        expected = plain * factors(model, shape_of(model), ["walls"], tank or TANK)
        assert_allclose(crowded, expected, rtol=1e-12)
        assert_allclose(again.expected(LINE, tank).propensities(STATES), expected, rtol=1e-12)
    few = Model(again.apply(LINE, Tank((0.9, 0.9, 0.9))), {"monomer": 12})
    exact = predict(few, times=[300.0], method="transient")
    assert exact.error < 1e-9
    sampled = predict(few, times=[300.0], runs=2000, seed=1)
    off = abs(sampled.mean - exact.mean) / sampled.standard_error
    assert off.max() < 5.5  # a false alarm in a million for 16 such figures
    with pytest.raises(ValueError, match="rates by class do not: calibrate with --crowding none"):
        ClassRates.of_rates(derive(RuleBook.load("line4")), again)
    lost = again.replace(tank=None)
    with pytest.raises(ValueError, match="do not state theirs; give the tank"):
        lost.apply(LINE)


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"walls": "soft"}, "unknown model of crowding 'soft'; expected one of none, linear"),
        ({"walls": "three-body"}, "has the parameters third; none came"),
        ({"walls": "hard-bodies", "shape": {"walls": {"third": 1.0}}}, "has the parameters none; third came"),
        ({"walls": "three-body", "shape": {"walls": {"third": -1.0}}}, "third = -1 of crowding for walls; expected 0"),
        ({"shape": {"floor": {}}}, "has parameters for floor; expected bodies, walls, joins"),
    ],
)
def test_terms_that_make_no_sense_are_refused(given, message):
    with pytest.raises(ValueError, match=message):
        CrowdingTerms(**given)


def test_a_species_without_geometry_is_named():
    with pytest.raises(ValueError, match="no geometry of monomer, dimer"):
        CrowdingTerms(bodies="hard-bodies").crowding(EXPANSION, TANK)


# Geometry


def test_boxes_have_the_mean_width_of_the_formula():
    """Mean width (2 + m) a / 2 of a line of m cubes; of an L by sampling directions."""
    m = np.arange(1, 5)
    assert_allclose(BODIES.radius, (2 + m) * EDGE / 4)
    assert_allclose(BODIES.surface, (2 + 4 * m) * EDGE**2)
    assert_allclose(BODIES.volume, m * EDGE**3)
    bent = next(s for name, s in derive(RuleBook.load("t5")).structures.items() if len(s) == 5)
    corners = (np.array(bent.positions)[:, None] + UNIT).reshape(-1, 3)
    directions = np.random.default_rng(1).standard_normal((20_000, 3))
    directions /= np.linalg.norm(directions, axis=1)[:, None]
    reach = corners @ directions.T
    assert ConvexBodies.of([bent], 1.0).radius[0] == pytest.approx(np.ptp(reach, axis=0).mean() / 2, rel=5e-3)


def touching(m: int, n: int, rng: np.random.Generator) -> float:
    """Mean width of the union of two boxes in contact: uniform on the surface of their Minkowski sum, over turns."""
    total, area = 0.0, 0.0
    for _ in range(300):
        one, other = (EDGE * UNIT * [k, 1, 1] @ Rotation.random(random_state=rng).as_matrix() for k in (m, n))
        hull = ConvexHull((one[:, None] - other[None]).reshape(-1, 3))
        facets = hull.points[hull.simplices]
        areas = np.linalg.norm(np.cross(facets[:, 1] - facets[:, 0], facets[:, 2] - facets[:, 0]), axis=1) / 2
        chosen = facets[rng.choice(len(areas), size=40, p=areas / areas.sum())]
        at = np.einsum("qc,qcx->qx", rng.dirichlet(np.ones(3), size=40), chosen)
        wide = np.maximum(one.max(0), other.max(0) + at) - np.minimum(one.min(0), other.min(0) + at)
        total += hull.area * wide.mean()
        area += hull.area
    return total / area


@pytest.mark.parametrize(("m", "n"), [(1, 1), (1, 4), (4, 4)])
def test_a_pair_in_contact_has_the_width_of_spheres(m, n):
    """2 R_1 + 2 R_2 less twice the contact length, exact for spheres, within 3 % for boxes; not the larger width."""
    r, q = BODIES.radius[m - 1], BODIES.radius[n - 1]
    formula = 2 * (r + q) - 2 * r * q / (r + q)
    found = touching(m, n, np.random.default_rng(m + n))
    assert found == pytest.approx(formula, rel=0.03)
    assert abs(found - 2 * max(r, q)) > 0.1 * found  # control
    room = BODIES.room_of_pairs([m - 1], [n - 1], TANK)[0]
    sides = np.array(TANK.size)
    assert room == pytest.approx(12 * np.prod(sides - formula) / np.prod(sides - 2 * r) / np.prod(sides - 2 * q))


def test_a_tank_too_narrow_for_a_pair_is_refused():
    with pytest.raises(ValueError, match=r"do not fit into a tank of 0\.5 x 0\.5 x 9"):
        BODIES.room_of_pairs([3], [3], Tank((0.5, 0.5, 9.0)))
