"""Exponents, medians and rankings against times drawn from known laws, censored ones among them."""

import math

import numpy as np
import pytest
from scipy.stats import binom

from mechsim.studies.fit import exponents, fit_log, mean, median, power, ranking

LEVELS = np.array([40.0, 60.0, 80.0, 100.0, 120.0])
SETS = 400  # of synthetic data
FALSE_ALARM = 1e-6


def drawn(rng, levels, exponent, runs, cap=math.inf, shape=4.0):
    """First times whose mean goes by a power of the level, waits of several steps (gamma); inf beyond the cap."""
    times = [rng.gamma(shape, 200 * (level / 60) ** exponent / shape, runs) for level in levels]
    return [np.where(each > cap, np.inf, each) for each in times]


def coverage(exponent, assumed, cap):
    rng = np.random.default_rng(11)
    fits = [exponents(drawn(rng, LEVELS, exponent, 20, cap), LEVELS[:, None], cap)[0] for _ in range(SETS)]
    return sum(fit.low <= assumed <= fit.high for fit in fits)


@pytest.mark.parametrize("cap", [1e9, 400.0])  # none, and one in eight, censored
def test_exponents_are_covered(cap):
    """95 % limits hold the truth in at least 91 % of sets, whatever the exact law of the times."""
    assert coverage(-1.0, -1.0, cap) >= binom.ppf(FALSE_ALARM, SETS, 0.91)


def test_a_wrong_exponent_is_not_covered():
    """The control: 2 would pass for 1 if the limits were merely wide."""
    assert coverage(-1.0, -2.0, 1e9) < 0.05 * SETS


def test_leaving_censored_runs_out_would_be_wrong():
    """The control for censoring: without them the long waits are lost, and with them the exponent."""
    rng = np.random.default_rng(12)
    times = drawn(rng, LEVELS, -1.0, 400, cap=200.0)
    kept = [each[np.isfinite(each)] for each in times]
    right = exponents(times, LEVELS[:, None], 200.0)[0]
    wrong = exponents(kept, LEVELS[:, None], 200.0)[0]
    assert abs(right.value + 1) < 0.1
    assert wrong.high < 0 < abs(wrong.value + 1) - 0.3


def test_without_censoring_it_is_least_squares():
    times = np.concatenate(drawn(np.random.default_rng(3), LEVELS, -1.0, 15))
    design = np.column_stack([np.ones(75), np.repeat(np.log(LEVELS), 15)])
    slopes, *_ = np.linalg.lstsq(design, np.log(times), rcond=None)
    rest = np.log(times) - design @ slopes
    fit = fit_log(times, design, 1e9)
    np.testing.assert_allclose(fit.slopes, slopes, rtol=1e-9)
    expected = rest @ rest / 73 * np.linalg.inv(design.T @ design)
    np.testing.assert_allclose(fit.covariance, expected, rtol=1e-7)


def test_the_likelihood_is_at_its_top():
    times = np.concatenate(drawn(np.random.default_rng(4), LEVELS, -1.0, 30, cap=220.0))
    design = np.column_stack([np.ones(150), np.repeat(np.log(LEVELS), 30)])
    fit = fit_log(times, design, 220.0)

    def value(slopes, scatter):
        z = (np.log(np.minimum(times, 220.0)) - design @ slopes) / scatter
        late = np.array([math.log(0.5 * math.erfc(each / math.sqrt(2))) for each in z])
        return np.where(np.isfinite(times), -0.5 * z**2 - math.log(scatter * math.sqrt(2 * math.pi)), late).sum()

    assert value(fit.slopes, fit.scatter) == pytest.approx(fit.log_likelihood, rel=1e-12)
    for shift in np.vstack([np.eye(3), -np.eye(3)]) * 1e-3:
        assert value(fit.slopes + shift[:2], fit.scatter + shift[2]) < fit.log_likelihood


def test_exponents_of_two_factors_are_told_apart():
    rng = np.random.default_rng(5)
    levels = np.array([(n, edge) for n in (40.0, 80.0, 120.0) for edge in (0.15, 0.2, 0.25)])
    times = [rng.gamma(4, 5000 / n * (0.15 / edge) ** 2, 60) for n, edge in levels]
    number, edge = exponents(times, levels, 1e9)
    assert number.low < -1 < number.high
    assert edge.low < -2 < edge.high
    assert edge.high - edge.low < 0.5


def test_ranking_puts_the_stronger_factor_first_and_sees_interactions():
    rng = np.random.default_rng(6)
    levels = np.array([(a, b) for a in (1.0, 2.0, 3.0) for b in (40.0, 80.0, 120.0)])
    plain = [rng.gamma(4, 50 / a**0.5 * 60 / b, 60) for a, b in levels]
    first, second, both = ranking(["a", "b"], plain, levels, 1e9)
    assert (first.factors, second.factors, both.factors) == (("b",), ("a",), ("a", "b"))
    assert first.p_value < FALSE_ALARM
    assert both.p_value > FALSE_ALARM
    crossed = [rng.gamma(4, 50 * (60 / b) ** (a / 2), 60) for a, b in levels]
    assert ranking(["a", "b"], crossed, levels, 1e9)[2].p_value < FALSE_ALARM


def test_medians_are_covered_whatever_the_law():
    rng = np.random.default_rng(7)
    hits = sum(each.low <= math.log(2) <= each.high for each in (median(rng.exponential(1, 20)) for _ in range(2000)))
    assert hits >= binom.ppf(FALSE_ALARM, 2000, 0.95)
    assert hits <= binom.ppf(1 - FALSE_ALARM, 2000, 0.97)


def test_medians_and_means_with_censored_runs():
    times = np.array([3.0, 1.0, np.inf, 2.0, np.inf, 4.0, 5.0])
    assert median(times).value == 4.0
    assert (median(times).low, median(times).high) == (1.0, np.inf)
    assert mean(times, 10.0).value == pytest.approx(35 / 7)
    assert median(np.full(8, np.inf)).value == np.inf
    assert math.isnan(median(times[:5]).low)  # five runs give no 95 % limits
    assert math.isnan(median(times[:0]).value)
    assert math.isnan(mean(times[:1], 10.0).low)


def test_too_little_is_refused():
    with pytest.raises(ValueError, match="0 of 10 first times were observed"):
        exponents([np.full(2, np.inf)] * 5, LEVELS[:, None], 9.0)
    with pytest.raises(ValueError, match="at too few points"):
        exponents([np.array([1.0, 2.0, 3.0])], np.array([[40.0]]), 9.0)


def test_the_paper_s_speeds_have_its_exponent():
    found = power(np.array([3.0, 3.5, 4.0, 4.5, 5.0]), np.array([0.8, 1.0, 1.2, 1.35, 1.5]))
    assert found.value == pytest.approx(1.23, abs=0.01)


def test_the_ranking_is_the_analysis_of_variance():
    """Without censoring: F by sums of squares, written another way."""
    rng = np.random.default_rng(8)
    levels = np.array([(a, b) for a in (1.0, 2.0, 3.0) for b in (40.0, 80.0)])
    times = [rng.lognormal(a * 0.1, 0.5, 5) for a, _ in levels]
    logs = np.log(np.array(times)).reshape(3, 2, 5)
    centre = logs.mean()
    of_a = 10 * ((logs.mean(axis=(1, 2)) - centre) ** 2).sum()
    of_b = 15 * ((logs.mean(axis=(0, 2)) - centre) ** 2).sum()
    rest = ((logs - centre) ** 2).sum() - of_a - of_b
    found = {share.factors: share for share in ranking(["a", "b"], times, levels, 1e9)}
    first, second = found[("a",)], found[("b",)]
    assert (first.freedom, first.rest, second.freedom, second.rest) == (2, 26, 1, 26)
    assert first.f == pytest.approx(of_a / 2 / (rest / 26), rel=1e-6)
    assert second.f == pytest.approx(of_b / (rest / 26), rel=1e-6)
