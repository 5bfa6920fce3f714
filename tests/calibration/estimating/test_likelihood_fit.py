"""Estimates and profile-likelihood intervals against closed forms, and what data cannot tell."""

import numpy as np
import pytest
from scipy.optimize import brentq
from scipy.stats import chi2

from calibration.estimating.likelihood_fit import fit_parameters


def exponential(events, exposure):
    """Independent constants: n ln k - k T each."""
    events, exposure = np.array(events, dtype=float), np.array(exposure, dtype=float)

    def scored(logs):
        k = np.exp(logs)
        return float(events @ logs - exposure @ k), events - exposure * k

    return scored


def ends(events, exposure):
    """Where the likelihood of one constant has fallen by half the 95 % quantile of chi-squared."""
    best = events / exposure

    def fall(k):
        return events * np.log(k / best) - exposure * (k - best) + chi2.ppf(0.95, 1) / 2

    return brentq(fall, best * 1e-9, best), brentq(fall, best, best * 100)


def normal(mean, covariance):
    """A normal log-likelihood of the logarithms, by whose correlation profiles differ from sections."""
    precision = np.linalg.inv(covariance)

    def scored(logs):
        off = logs - mean
        return float(-0.5 * off @ precision @ off), -precision @ off

    return scored


def test_closed_forms():
    found = fit_parameters(exponential([20, 3], [60.0, 0.5]), ["a", "b"], [1.0, 1.0])
    np.testing.assert_allclose(found.value, [20 / 60, 6.0], rtol=1e-6)
    for p, (n, t) in enumerate([(20, 60.0), (3, 0.5)]):
        np.testing.assert_allclose([found.low[p], found.high[p]], ends(n, t), rtol=1e-5)
    np.testing.assert_allclose(found.covariance, np.diag([1 / 20, 1 / 3]), rtol=1e-4, atol=1e-6)
    assert found.notes == ()
    assert np.abs(found.gradient).max() < 1e-3


def test_profiles_follow_the_ridge():
    covariance = np.array([[0.04, 0.0297], [0.0297, 0.0225]])
    found = fit_parameters(normal([0.3, -2.0], covariance), ["a", "b"], [1.0, 1.0])
    half = np.sqrt(chi2.ppf(0.95, 1) * np.diag(covariance))
    np.testing.assert_allclose(np.log(found.low), np.array([0.3, -2.0]) - half, rtol=1e-5)
    np.testing.assert_allclose(np.log(found.high), np.array([0.3, -2.0]) + half, rtol=1e-5)


def test_a_constant_without_events_is_bounded_from_above():
    found = fit_parameters(exponential([20, 0], [60.0, 5.0]), ["a", "b"], [1.0, 1.0])
    assert found.low[1] == 0.0
    assert found.high[1] == pytest.approx(chi2.ppf(0.95, 1) / 2 / 5.0, rel=1e-4)
    assert found.notes == ("the data do not bound b from below",)


def test_a_flat_profile_is_no_number():
    """Only the product of a and b is known."""

    def scored(logs):
        value, (slope,) = exponential([20], [60.0])(logs[:1] + logs[1:2])
        return value, np.array([slope, slope])

    found = fit_parameters(scored, ["a", "b"], [1.0, 1.0])
    assert np.isnan(found.value).all()
    assert found.low.tolist() == [0.0, 0.0]
    assert np.isinf(found.high).all()
    assert found.covariance is None
    assert [note.split(":")[0] for note in found.notes] == ["the data cannot tell a", "the data cannot tell b"]
    assert found.to_dict()["a"] == {"value": None, "low": 0.0, "high": None}


def test_the_best_of_several_maxima_is_taken():
    """Two peaks; the first start leads to the lower one, and a note says that there are others."""

    def scored(logs):
        x = logs[0]
        lower, higher = np.exp(-0.5 * (x / 0.2) ** 2), 50 * np.exp(-0.5 * ((x - 3.0) / 0.2) ** 2)
        both = lower + higher + 1e-300
        return float(np.log(both)), np.array([(-x * lower - (x - 3.0) * higher) / 0.04 / both])

    found = fit_parameters(scored, ["k"], [1.0], starts=12)
    assert np.log(found.value[0]) == pytest.approx(3.0, abs=1e-5)
    assert "starts ended at a lower maximum" in found.notes[0]
    alone = fit_parameters(scored, ["k"], [1.0], starts=1)
    assert np.log(alone.value[0]) == pytest.approx(0.0, abs=1e-5)


def test_a_largest_value_ends_the_search_and_the_interval():
    found = fit_parameters(exponential([20, 3], [60.0, 0.5]), ["a", "b"], [0.1, 1.0], most=[0.4, 100.0])
    low, high = ends(20, 60.0)
    assert high > 0.4  # without a limit it would reach beyond
    np.testing.assert_allclose([found.low[0], found.high[0]], [low, 0.4], rtol=1e-5)
    at_limit = fit_parameters(exponential([20], [60.0]), ["a"], [0.1], most=[0.2])
    assert at_limit.value[0] == pytest.approx(0.2, rel=1e-9)
    assert at_limit.high[0] == pytest.approx(0.2, rel=1e-9)
    assert at_limit.low[0] < 0.2


def test_a_start_at_which_the_likelihood_is_zero_says_why():
    def scored(logs):
        raise ValueError("row 3: cannot be")

    with pytest.raises(ValueError, match="row 3"):
        fit_parameters(scored, ["k"], [1.0])


@pytest.mark.parametrize("seed", range(3))
def test_the_same_seed_gives_the_same_fit(seed):
    once, again = (fit_parameters(exponential([9], [3.0]), ["k"], [1.0], seed=seed) for _ in range(2))
    assert once.value.tolist() == again.value.tolist()
    assert once.evaluations == again.evaluations


def test_an_upper_end_is_not_looked_for_where_chains_are_stiff():
    """A likelihood that settles for large k costs more the larger k is: the search says that there is no upper end."""
    tried = []

    def settles(logs):  # of k / (1 + k), seen 30 times
        tried.append(float(logs[0]))
        share = 1.0 / (1.0 + np.exp(-logs[0]))
        return 30 * np.log(share), np.array([30 * (1.0 - share)])

    found = fit_parameters(settles, ["k"], np.array([1.0]), most=np.array([50.0]), starts=1)
    assert found.high[0] == pytest.approx(50.0)  # where its range ends
    tried.clear()
    found = fit_parameters(settles, ["k"], np.array([1.0]), starts=1)
    ends = found.at[0]
    assert found.high[0] == np.inf
    assert 0 < found.low[0] < ends
    assert max(tried) <= np.log(max(ends, 1.0)) + np.log(1e4) + 1e-9
