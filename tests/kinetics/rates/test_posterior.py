"""The posterior of a rates file: its closed forms beside its own draws."""

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from rates_files import LINE, SHAPES, rates_file

from kinetics.network import Tank
from kinetics.rates import Rates
from kinetics.rates.breaks import BREAK_MODELS

N = 40_000


@pytest.mark.parametrize("model", [law.name for law in BREAK_MODELS])
@pytest.mark.parametrize("events", [0, 3])
def test_expected_constants_are_the_mean_of_draws(model, events):
    """Within 6 standard errors: 60 numbers or fewer, false alarm 1e-7 were the means normal."""
    rates, tank = rates_file(model, events), Tank((2.0, 2.0, 6.0))
    drawn = rates.draw_constants(LINE.network, np.random.default_rng(1), N, tank)
    expected = rates.expected(LINE.network, tank).known_rates
    error = drawn.std(axis=0) / np.sqrt(N)
    assert (np.abs(drawn.mean(axis=0) - expected) < 6 * error).all()
    assert (expected > 0).all()
    # control: the point rates are not the mean, by half an event
    assert (np.abs(drawn.mean(axis=0) - rates.apply(LINE.network, tank).known_rates) > 6 * error).any()


@pytest.mark.parametrize("model", [law.name for law in BREAK_MODELS])
def test_moments_of_the_parameters_are_those_of_draws(model):
    posterior = rates_file(model).posterior(LINE.network)
    drawn = posterior.draw(np.random.default_rng(2), N)
    assert posterior.names == (*LINE.network.channels, *SHAPES[model])
    assert_allclose(drawn.mean(axis=0), posterior.mean, rtol=6 * 0.6 / np.sqrt(N))
    scale = np.sqrt(np.diag(posterior.covariance))
    off = np.cov(drawn.T) - posterior.covariance
    assert (np.abs(off) < 6 * 2 / np.sqrt(N) * np.outer(scale, scale)).all()


def test_the_best_shape_and_the_point_rates_give_the_network_of_the_file():
    rates = rates_file("collision-wall")
    posterior = rates.posterior(LINE.network)
    point = np.append(posterior.rates, list(rates.breaks.shape.values()))
    assert_allclose(posterior.constants([point])[0], rates.apply(LINE.network).known_rates, rtol=1e-14)


def test_without_evidence_nothing_is_open():
    rates = Rates.load("table3")
    posterior = rates.posterior(LINE.network)
    assert not posterior.covariance.any()
    assert_array_equal(rates.expected(LINE.network).known_rates, rates.apply(LINE.network).known_rates)
