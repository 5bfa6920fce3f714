"""Elasticities: closed forms, the regression beside the exact derivatives, and a parameter without effect."""

from dataclasses import replace

import numpy as np
import pytest
from known_systems import bare_line, decay, network
from matplotlib.figure import Figure
from numpy.testing import assert_allclose
from rates_files import LINE, rates_file

from kinetics import Model, Transient, predict, solve
from kinetics.predicting import count_elasticities, passage_elasticities
from kinetics.predicting.elasticity import elasticities_of_draws
from kinetics.rates import ChannelRate, Convention, Rates

TIMES = [50.0, 400.0]
START = [30, 0, 0, 0]


def rates_of(**channels):
    """name=(events, exposure); without evidence where the second is None: then the first is the rate."""
    entries = {
        name: ChannelRate(rate=n, ways=1)
        if exposure is None
        else ChannelRate(rate=n / exposure, ways=1, events=n, exposure=exposure)
        for name, (n, exposure) in channels.items()
    }
    return Rates(convention=Convention(combinations="distinct"), channels=entries)


def measured(events):
    table = Rates.load("table3")
    channels = {
        name: ChannelRate(rate=given.rate, ways=given.ways, events=events, exposure=events / given.rate)
        for name, given in table.channels.items()
    }
    return Rates(convention=table.convention, channels=channels)


def test_a_decay_has_minus_its_rate_times_the_time():
    rates = rates_of(decay=(20, 40.0))
    found = count_elasticities(decay(), rates, [10], [0.5, 3.0])
    assert_allclose(found.value[0, :, 0], -20.5 / 40 * np.array([0.5, 3.0]), rtol=1e-12)
    assert_allclose(found.share, 1.0)
    assert found.is_exact
    assert not found.standard_error.any()


def test_the_regression_gives_the_average_over_the_posterior_whatever_the_curvature():
    """Of a decay: mean e^{-k}, k from Gamma(a, b): E[k d mean / dk] / E[mean] = -a / (b + 1); no line would do."""
    rates = rates_of(decay=(0, 0.5))
    drawn = predict(Model(decay(), [50]), rates, [1.0], seed=3, draws=1500).drawn
    found = elasticities_of_draws(drawn)
    error = found.standard_error[0, 0, 0]
    assert abs(found.value[0, 0, 0] + 0.5 / 1.5) < 4.9 * error
    assert error < 0.03
    # control: the derivative at the posterior mean is another number
    exact = count_elasticities(decay(), rates, [50], [1.0])
    assert_allclose(exact.value, -1.0, rtol=1e-12)
    assert abs(exact.value - found.value).max() > 4.9 * error


def test_birth_and_death_share_the_variance_by_their_events():
    """Mean b / d (1 - e^{-d t}): elasticity 1 to b; long after, -1 to d. Shares go as 1 / (n + 1/2)."""
    flow = network(("X",), {"birth": ((0,), (1,)), "death": ((1,), (0,))}, [1.0, 1.0])
    rates = rates_of(birth=(100, 100.0), death=(400, 400.0))
    drawn = predict(Model(flow, [0]), rates, [1.0, 30.0], seed=4, draws=400).drawn
    found = elasticities_of_draws(drawn)
    late = -1 + 1 / (np.e - 1)
    for value, expected in ((found.value[:, 0, 0], [1.0, late]), (found.value[:, 1, 0], [1.0, -1.0])):
        # curvature: the average over the posterior is within 0.01 of the derivative at its mean
        assert (np.abs(value - expected) < 4.9 * found.standard_error.max() + 0.01).all()
    assert_allclose(found.share[:, 1, 0], [400.5 / 501, 100.5 / 501], atol=0.15)
    assert found.share[0, 1, 0] > 2 * found.share[1, 1, 0]


def test_what_has_no_effect_has_no_elasticity():
    """Two decays side by side: each counts for itself. The control of all others."""
    pair = network(("X", "Y"), {"x": ((1, 0), (0, 0)), "y": ((0, 1), (0, 0))}, [1.0, 1.0])
    rates = rates_of(x=(50, 50.0), y=(50, 50.0))
    drawn = predict(Model(pair, [40, 40]), rates, [1.0], seed=5, draws=300).drawn
    found = elasticities_of_draws(drawn)
    z = found.value / found.standard_error
    assert (np.abs(z[[0, 1], 0, [1, 0]]) < 4.9).all()
    assert (np.abs(z[[0, 1], 0, [0, 1]]) > 4.9).all()
    assert (found.share[[0, 1], 0, [1, 0]] < 0.05).all()
    assert_allclose(count_elasticities(pair, rates, [40, 40], [1.0]).value[[0, 1], 0, [1, 0]], 0.0, atol=1e-8)


def test_draws_agree_with_exact_derivatives_on_the_line_of_four():
    """64 numbers within 4.9 of their errors, and 0.02 for the curvature of the posterior of 2000 events."""
    rates = measured(2000)
    drawn = predict(Model(bare_line(), START), rates, TIMES, seed=6).drawn
    sampled = elasticities_of_draws(drawn)
    exact = count_elasticities(bare_line(), rates, START, TIMES)
    seen = sampled.standard_error < 2
    assert seen.sum() > 30
    off = np.abs(sampled.value - exact.value)
    assert (off[seen] < 4.9 * sampled.standard_error[seen] + 0.02).all()
    # control: draws told apart from their parameters say nothing
    shuffled = replace(drawn, parameters=np.roll(drawn.parameters, 1, axis=0))
    lost = elasticities_of_draws(shuffled)
    off = np.abs(lost.value - exact.value)
    assert (off[seen] > 4.9 * lost.standard_error[seen] + 0.02).any()


def test_the_shape_of_a_break_model_is_a_parameter():
    """The mean at another alpha, with the coefficients that go with it, is the one that the value announces."""
    rates = rates_file("collision", 200)
    found = count_elasticities(LINE.network, rates, [12, 0, 0, 0], [40.0])
    assert found.parameters[-1] == "alpha"
    assert not found.is_rate[-1]
    assert_allclose(found.share.sum(axis=0), 1.0)
    posterior = rates.posterior(LINE.network)

    def at(alpha):
        point = posterior.mean.copy()
        point[-1] += alpha
        model = posterior.expected.with_rates(posterior.constants([point])[0])
        return np.log(solve(model, Transient(), [12, 0, 0, 0], [40.0]).mean())

    moved = (at(1e-4) - at(-1e-4)) / 2e-4
    assert_allclose(found.value[-1], moved, rtol=1e-6, atol=1e-9)
    assert np.abs(moved).max() > 1e-3


def test_a_weight_of_zero_has_a_derivative():
    """Breaks by one species that has no weight yet: the derivative by it is that of the rate that it would bring."""
    data = rates_file("collision-species", 200).as_dict()
    data["breaks"] |= {"posterior": None, "shape": data["breaks"]["shape"] | {"weight quadmer": 0.0}}
    for channel in data["channels"].values():
        channel["exposure"] = 1e3 if channel["exposures"] else channel["exposure"]
    none = Rates(**data)
    found = count_elasticities(LINE.network, none, [12, 0, 0, 0], [40.0])
    posterior = none.posterior(LINE.network)
    place = found.parameters.index("weight quadmer")
    points = np.tile(posterior.mean, (3, 1))
    points[:, place] = (0.0, 1e-5, 2e-5)
    network = posterior.expansion.network
    means = [
        solve(network.with_rates(row), Transient(), [12, 0, 0, 0], [40.0]).mean() for row in posterior.constants(points)
    ]
    slope = (4 * means[1] - 3 * means[0] - means[2]) / 2e-5
    assert_allclose(found.value[place], slope / means[0], rtol=1e-6, atol=1e-8)
    assert np.abs(found.value[place]).max() > 1e-4


def test_a_waiting_time_goes_as_one_over_its_only_rate():
    step = network(("A", "B"), {"forward": ((1, 0), (0, 1))}, [1.0])
    found = passage_elasticities(step, rates_of(forward=(5, 10.0)), [1, 0], "B")
    assert_allclose(found.value, [[-1.0]], rtol=1e-12)
    with pytest.raises(ValueError, match="no finite mean"):
        passage_elasticities(step, rates_of(forward=(0.0, None)), [1, 0], "B")


def test_large_networks_need_evidence_and_draws():
    bare = Rates.load("table3")
    known = count_elasticities(bare_line(), bare, [6, 0, 0, 0], [100.0])
    assert np.isfinite(known.value).all()
    assert np.isnan(known.share).all()
    with pytest.raises(ValueError, match="without evidence"):
        count_elasticities(bare_line(), bare, [6, 0, 0, 0], [100.0], exact_states=3)
    few = predict(Model(bare_line(), [6, 0, 0, 0]), measured(20), [100.0], draws=5).drawn
    with pytest.raises(ValueError, match="5 draws of the rates for 8 parameters; expected at least 18"):
        count_elasticities(bare_line(), measured(20), [6, 0, 0, 0], [100.0], few, exact_states=3)


def test_bars_for_every_parameter_and_species():
    found = count_elasticities(bare_line(), measured(20), [6, 0, 0, 0], [100.0])
    ax = Figure().add_subplot()
    assert found.plot(ax, bare_line().species) is ax
    assert len(ax.patches) == 8 * 4
    assert [label.get_text() for label in ax.get_yticklabels()] == list(found.parameters)
