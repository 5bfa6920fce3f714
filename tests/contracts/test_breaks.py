"""What every break model must do, so that a new one is tested by its line in `BREAK_MODELS`."""

from dataclasses import replace

import numpy as np
import pytest
from break_studies import TANK, KnownBreaks
from numpy.testing import assert_allclose, assert_array_equal
from synthetic_runs import line_network

from calibration import estimate
from calibration.estimating.break_fit import fit_breaks, rates_of_fit
from kinetics.network import Model, Tank
from kinetics.predicting import predict
from kinetics.rates import Rates
from kinetics.rates.breaks import (
    ALONE,
    BREAK_MODELS,
    WALL,
    BreakModel,
    Expansion,
    base_channel,
    break_model,
    is_break,
    pairs,
)
from kinetics.runs import RESTART, JumpPath
from kinetics.sampling import sample_path
from tests.helpers.expanded_paths import on_base

LINE = line_network()
OTHER = Tank((1.0, 4.0, 5.0))
RNG = np.random.default_rng(0)
STATES = np.vstack([RNG.integers(0, 9, size=(30, 4)), np.eye(4, dtype=int), np.zeros((1, 4), dtype=int)])


@pytest.fixture(params=BREAK_MODELS, ids=lambda law: law.name)
def law(request):
    return request.param


def shapes(law, network=LINE):
    """Its start, and a few points inside of its range."""
    parameters = law.parameters(network)
    rows = [[p.start for p in parameters], *np.random.default_rng(1).uniform(0.1, 0.9, size=(3, len(parameters)))]
    return [{p.name: p.start for p in parameters}] + [
        {p.name: float(p.value(u)) for p, u in zip(parameters, row, strict=True)} for row in rows[1:]
    ]


def by_bodies(network, law, weights, state):
    """b N times the weighted pairs of every break in one state, body by body."""
    weight_of = dict(zip(law.partners(network), weights, strict=True))
    bodies = [name for name, n in zip(network.species, state, strict=True) for _ in range(n)]
    found = np.zeros(len(network.channels))
    for r in np.flatnonzero(is_break(network)):
        (broken,) = (name for name, n in zip(network.species, network.reactants[r], strict=True) if n)
        for i, body in enumerate(bodies):
            if body == broken:
                met = sum(weight_of.get(other, 0.0) for j, other in enumerate(bodies) if j != i)
                found[r] += met + weight_of.get(WALL, 0.0) + weight_of.get(ALONE, 0.0)
    return found * network.known_rates * network.ways


def test_it_has_a_name_a_docstring_and_a_place_among_the_models(law):
    assert law.name == law.name.lower()
    assert type(law).__doc__
    assert break_model(law.name) is law
    assert law.nested is None or law.nested in {other.name for other in BREAK_MODELS}


def test_partners_are_known_and_weights_are_positive(law):
    partners = law.partners(LINE)
    assert len(set(partners)) == len(partners) > 0
    assert set(partners) <= {*LINE.species, WALL, ALONE}
    for shape in shapes(law):
        weights = law.weights(LINE, shape)
        assert weights.shape == (len(partners),)
        assert np.isfinite(weights).all()
        assert (weights >= 0).all()
        assert weights.any()


def test_parameters_have_ranges_that_hold_their_start(law):
    for parameter in law.parameters(LINE):
        assert parameter.low <= parameter.start <= parameter.high
        assert parameter.value(0.0) == parameter.low
        assert parameter.value(1.0) == pytest.approx(parameter.high)
        for u in (0.0, 0.2, 0.7, 1.0):
            assert parameter.unit(float(parameter.value(u))) == pytest.approx(u, abs=1e-12)


@pytest.mark.parametrize("combinations", ["distinct", "ordered"])
def test_propensities_are_those_of_pairs_of_bodies(law, combinations):
    base = LINE.with_rates(LINE.known_rates, combinations=combinations)
    expansion = Expansion.of(base, law)
    for shape in shapes(law):
        weights = law.weights(base, shape)
        network = expansion.network.with_rates(expansion.constants(base.known_rates, weights))
        for state in STATES:
            expected = np.where(is_break(base), by_bodies(base, law, weights, state), base.propensities(state))
            summed = np.bincount(expansion.base_of, network.propensities(state), minlength=len(base.channels))
            assert_allclose(summed, expected, rtol=1e-12, atol=0)
        counted = np.tensordot(weights, np.array(pairs(base, law, STATES)), axes=1) * base.known_rates * base.ways
        expected = [by_bodies(base, law, weights, state) for state in STATES]
        assert_allclose(counted, expected, rtol=1e-12, atol=0)


def test_weights_by_size_are_those_of_any_network(law):
    for shape in shapes(law):
        sizes = LINE.conserved["cubes"] if "cubes" in LINE.conserved else np.arange(1, 5)
        if type(law).by_size is BreakModel.by_size:
            with pytest.raises(ValueError, match="by species, which differ between books"):
                law.by_size(sizes, shape)
            return
        bodies, wall, alone = law.by_size(sizes, shape)
        expected = dict(zip(law.partners(LINE), law.weights(LINE, shape), strict=True))
        assert_allclose(bodies, [expected.get(name, 0.0) for name in LINE.species])
        assert (wall, alone) == (expected.get(WALL, 0.0), expected.get(ALONE, 0.0))
        assert law.size_parameters == law.parameters(LINE)


def test_a_wrong_count_of_pairs_is_seen(law):
    """Control: pairs x y, where a body can break itself, are not those of bodies."""
    if law.partners(LINE) == (ALONE,):
        return
    weights = law.weights(LINE, shapes(law)[0])
    state = np.array([3, 2, 2, 2])
    counts = np.append(state, 1)[: len(weights)] if WALL in law.partners(LINE) else state
    wrong = LINE.known_rates * LINE.ways * LINE.combinations_of(state) * (weights @ counts)
    right = by_bodies(LINE, law, weights, state)
    chosen = is_break(LINE)
    assert not np.allclose(wrong[chosen], right[chosen], rtol=1e-3)


def test_channels_keep_what_their_base_channel_does(law):
    expansion = Expansion.of(LINE, law)
    network = expansion.network
    assert_array_equal(network.stoichiometry, LINE.stoichiometry[expansion.base_of])
    assert [base_channel(name) for name in network.channels] == [LINE.channels[r] for r in expansion.base_of]
    assert network.species == LINE.species
    for name, weights in network.conserved.items():
        assert_array_equal(weights, LINE.conserved[name])
        assert not (network.stoichiometry @ weights).any()
    joins = expansion.partner_of < 0
    assert_array_equal(expansion.base_of[joins], np.flatnonzero(~is_break(LINE)))
    if law.partners(LINE) == (ALONE,):
        assert network is LINE


def test_meetings_scale_with_volume_and_walls_with_surface_over_volume(law):
    expansion = Expansion.of(LINE, law)
    factors = expansion.scales(TANK, OTHER)
    partners = law.partners(LINE)
    for r, base, p in zip(range(factors.size), expansion.base_of, expansion.partner_of, strict=True):
        meets = not is_break(LINE)[base] or partners[p] in LINE.species
        expected = 12 / 20 if meets else 1.0
        if p >= 0 and partners[p] == WALL:
            expected = (58 / 20) / (32 / 12)
        assert factors[r] == pytest.approx(expected, rel=1e-14)
    assert_allclose(factors * expansion.scales(OTHER, TANK), 1.0, rtol=1e-14)
    assert_array_equal(expansion.scales(None, None), 1.0)
    with pytest.raises(ValueError, match="do not state their tank"):
        expansion.scales(None, OTHER)


def test_paths_on_the_base_tell_the_same_story(law):
    truth = KnownBreaks(law, shapes(law)[0], (1e-3, 2e-3, 1e-3, 2e-3))
    expansion, network = truth.network(TANK)
    path = sample_path(network, [10, 4, 4, 6], 500.0, seed=1)
    seen = on_base(expansion, replace(path, tank=TANK))
    assert (path.channels >= 0).sum() > 10
    assert_array_equal(seen.states, path.states)
    assert_array_equal(seen.channels, expansion.base_of[path.channels])
    assert seen.tank == TANK
    restarted = JumpPath(network, [0, 0, 0, 3], [1.0, 1.0], [len(network.channels) - 1, RESTART], 2.0)
    assert on_base(expansion, restarted).channels.tolist() == [7, RESTART]
    closed = replace(path, channels=[], times=[], open_channels=expansion.partner_of >= 0)
    assert_array_equal(on_base(expansion, closed).open_channels, is_break(LINE))


def test_it_is_fitted_saved_and_predicts(law, tmp_path):
    """Runs of a known model; its fit as a rates file; the prediction from that, in both tanks, beside the truth's.

    Some 1,500 breaks leave each of four coefficients an error of 5 %, which goes into a tenth to a third of a count.
    The control, the truth with every break at half its rate, is outside.
    """
    met = dict(zip(LINE.species, (10, 6, 6, 12), strict=True))  # so that every model breaks about as often
    weights = law.weights(LINE, shapes(law)[0])
    scale = 1e-2 / sum(w * met.get(p, 1) for p, w in zip(law.partners(LINE), weights, strict=True))
    truth = KnownBreaks(law, shapes(law)[0], tuple(scale * np.array([1.0, 1.5, 1.0, 2.0])))
    runs = truth.runs(40, 50.0, seed=5)
    fit = fit_breaks(law, runs)
    rates = rates_of_fit(estimate(runs), fit)
    rates.save(tmp_path / "rates.toml")
    again = Rates.load(tmp_path / "rates.toml")
    assert again == rates
    assert again.breaks.model == law.name
    assert again.tank == TANK.size
    draws = again.draw_constants(LINE, np.random.default_rng(2), 50)
    point = again.apply(LINE)
    assert draws.shape == (50, len(point.channels))
    assert (draws > 0).all()
    initial = [20, 6, 4, 8]
    for tank in (None, OTHER):
        made = predict(Model(LINE, initial, tank=tank), again, [20.0], runs=2000, draws=20)
        true = truth.network(tank or TANK)[1]
        breaks = true.stoichiometry.sum(axis=1) > 0
        halved = true.with_rates(true.known_rates * np.where(breaks, 0.5, 1.0))
        for model, is_right in ((true, True), (halved, False)):
            known = predict(Model(model, initial), None, [20.0], runs=2000, seed=1)
            error = 5 * np.hypot(made.standard_error, known.standard_error) + 0.06 * known.mean
            assert (np.abs(made.mean - known.mean) < error).all() == is_right


def test_rates_without_evidence_work(law):
    """A file written by hand, with rates and ways alone."""
    rates = Rates(
        convention={"combinations": "distinct"},
        channels={name: {"rate": 1e-4, "ways": 2.0} for name in LINE.channels},
        breaks={"model": law.name, "shape": shapes(law)[0]},
    )
    network = rates.apply(LINE)
    assert_array_equal(rates.draw_constants(LINE, np.random.default_rng(0), 3), [network.known_rates] * 3)
    if law.parameters(LINE):
        with pytest.raises(ValueError, match="has the shape parameters"):
            rates.replace(breaks=rates.breaks.replace(shape={})).apply(LINE)
