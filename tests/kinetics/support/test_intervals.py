"""Intervals and draws of rates, and Student's interval of means, against scipy's distributions."""

import numpy as np
import pytest
from scipy.stats import binom, gamma, kstest, poisson, t

from kinetics.support.intervals import (
    binomial_limits,
    exact_limits,
    jeffreys_posterior,
    posterior_draws,
    student_interval,
    student_quantile,
)


def test_limits_hold_for_pooled_evidence_of_less_than_one_event():
    """Evidence shared out between classes need not be whole: Gamma quantiles of n and of n + 1."""
    low, high = exact_limits(0.3, 20.0)
    assert low == pytest.approx(gamma.ppf(0.025, 0.3) / 20, rel=1e-9)
    assert high == pytest.approx(gamma.ppf(0.975, 1.3) / 20, rel=1e-9)
    assert poisson.cdf(4, exact_limits(4, 1.0)[1]) == pytest.approx(0.025)


def test_draws_are_the_posterior_and_rates_without_evidence_stay():
    draws = posterior_draws(np.random.default_rng(1), 2000, [2.0, 0.7], [3, None], [1.5, None])
    shape, rate = jeffreys_posterior(3, 1.5)
    assert kstest(draws[:, 0], gamma(shape, scale=1 / rate).cdf).pvalue > 1e-6
    assert kstest(draws[:, 0], gamma(3.0, scale=1 / rate).cdf).pvalue < 1e-6  # control: without Jeffreys' half
    np.testing.assert_array_equal(draws[:, 1], 0.7)


def test_students_interval_by_hand():
    values = np.array([[1.0, 5.0], [2.0, 5.0], [6.0, 5.0]])
    low, high = student_interval(values, 0.9)
    half = t.ppf(0.95, 2) * values[:, 0].std(ddof=1) / np.sqrt(3)
    np.testing.assert_allclose(low, [3 - half, 5.0])
    np.testing.assert_allclose(high, [3 + half, 5.0])
    assert student_quantile(2, 0.9) == pytest.approx(t.ppf(0.95, 2))
    assert np.isnan(student_interval(values[:1])[0]).all()


@pytest.mark.parametrize("runs", [7, 40])
def test_binomial_limits_cover_and_narrower_ones_do_not(runs):
    """Clopper & Pearson cover at least 95 % at every probability, by the distribution itself; 80 % limits do not."""
    hits, chances = np.arange(runs + 1), np.linspace(0.001, 0.999, 97)[:, None]
    for level, is_enough in ((0.95, True), (0.8, False)):
        low, high = binomial_limits(hits, runs, level)
        covered = (binom.pmf(hits, runs, chances) * ((low <= chances) & (chances <= high))).sum(axis=1)
        assert (covered.min() >= 0.95 - 1e-12) is np.bool_(is_enough)


def test_binomial_limits_at_the_ends():
    assert binomial_limits(0, 10)[0] == 0.0
    assert binomial_limits(10, 10)[1] == 1.0
    with pytest.raises(ValueError, match=r"level = 1\.5; expected"):
        binomial_limits(1, 2, 1.5)
