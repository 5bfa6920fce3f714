"""P-values of counts over groups: against exact ones, however small, and valid for any number of draws."""

import numpy as np
import pytest
from scipy.stats import binom, binomtest, chi2

from calibration.estimating.diagnosing.conditional import (
    Multinomial,
    Spacings,
    Trended,
    anderson_darling,
    spacing_test,
    spread_test,
    trend_test,
    weighted_p_value,
)


@pytest.mark.parametrize("n", [3, 100, 1000])
@pytest.mark.parametrize("share", [0.5, 0.6, 0.7, 0.85])
def test_two_groups_give_the_binomial_test(n, share):
    """The trend down to 1e-100 within a factor of 1.7, several standard errors of 3,000 draws; the spread within
    2.5, and in the far tail, where the weight of what was seen counts most, too large rather than too small."""
    x = round(share * n)
    exact = binomtest(x, n).pvalue
    events, rng = np.array([x, n - x]), np.random.default_rng(n)
    spread = spread_test(events, np.ones(2), rng)[1]
    assert exact / 2.5 < spread < 2.5 * exact**0.97
    assert 1 / 1.7 < trend_test([Trended(events, np.ones(2), np.array([60.0, 80.0]))], rng)[1] / exact < 1.7


def test_many_groups_give_chi_square_where_counts_are_large():
    rng = np.random.default_rng(1)
    events = rng.multinomial(4000, np.tile([1.0, 1.4], 20) / 48)
    dispersion, p_value = spread_test(events, np.ones(40), rng)
    exact = chi2.sf(39 * dispersion, 39)
    assert exact < 1e-8
    assert 0.3 < np.log(p_value) / np.log(exact) < 1.1


@pytest.mark.parametrize("test", [spread_test, lambda e, x, rng: trend_test([Trended(e, x, np.arange(5.0))], rng)])
def test_size_with_few_events_is_at_most_the_level(test):
    """At most 5 % and 1 %, within 6 standard errors of 600 tables of 12 events."""
    rng = np.random.default_rng(2)
    share = np.array([0.05, 0.1, 0.15, 0.3, 0.4])
    found = np.array([test(rng.multinomial(12, share), share, rng)[1] for _ in range(600)])
    for level in (0.05, 0.01):
        assert np.mean(found <= level) <= level + 6 * np.sqrt(level / 600)


def test_exposure_may_end_with_its_event():
    """Runs of one event each, which uses up the reactant: plain squares are valid, Pearson's, the control, are not."""
    rng = np.random.default_rng(7)
    once, exposures = np.ones(12, int), rng.exponential(size=(100, 12))
    plain, pearson = (
        sum(spread_test(once, x, rng, by_expected=by)[1] <= 0.05 for x in exposures) for by in (False, True)
    )
    assert binom.sf(plain - 1, 100, 0.05) > 1e-6
    assert binom.sf(pearson - 1, 100, 0.05) < 1e-6


def test_plain_draws_end_at_one_over_their_number():
    """Control: without the alternatives no p-value is below 1 / draws, as before."""
    events = np.array([95, 5])
    null = Multinomial(100, np.full(2, 0.5), np.full(2, 0.5))
    off = lambda counts: np.abs(counts[..., 0] - 50)  # noqa: E731
    plain = weighted_p_value(events, null, [], off, np.random.default_rng(3))
    assert plain > 1e-4
    tilted = Multinomial(100, np.array([0.95, 0.05]), np.full(2, 0.5))
    assert weighted_p_value(events, null, [tilted], off, np.random.default_rng(3)) < 1e-15


@pytest.mark.parametrize("n", [3, 31])
def test_gaps_have_the_tail_of_plain_draws(n):
    """Of 100,000 plain draws the one with rank 100 has p = 1e-3 (10 %), within a factor of 1.5 of the mean of 8 tests;
    draws from clustered gaps, the control,
    exceed it more often."""
    rng = np.random.default_rng(n)
    plain = Spacings(n, 1.0).draw(rng, 100_000)
    seen = plain[np.argsort(anderson_darling(plain))[-100]]
    assert 1 / 1.5 < np.mean([spacing_test(seen, rng)[1] for _ in range(8)]) / 1e-3 < 1.5
    other = Spacings(n, 0.6).draw(rng, 20_000)
    assert np.mean(anderson_darling(other) >= anderson_darling(seen[None])) > 3e-3


def test_a_trend_has_its_sign():
    rng = np.random.default_rng(4)
    rising = trend_test([Trended(np.array([10, 20, 40]), np.ones(3), np.array([1.0, 2.0, 4.0]))], rng)
    falling = trend_test([Trended(np.array([40, 20, 10]), np.ones(3), np.array([1.0, 2.0, 4.0]))], rng)
    assert rising[0] > 4
    assert falling[0] < -3
    assert max(rising[1], falling[1]) < 1e-3


def test_trends_of_several_channels_add_up():
    """Three channels, each with a trend too small to be seen alone, are seen together; opposite ones cancel."""
    rng = np.random.default_rng(6)
    values = np.array([60.0, 80.0, 120.0])
    tables = [
        Trended(np.array(n), np.ones(3) * x, values) for n, x in (([14, 20, 29], 1), ([7, 11, 15], 9), ([9, 12, 20], 4))
    ]
    alone = [trend_test([table], rng)[1] for table in tables]
    assert min(alone) > 0.01
    score, p_value = trend_test(tables, rng)
    assert p_value < 1e-3
    assert score > 3
    against = [*tables, *(Trended(t.events[::-1], t.exposure, values) for t in tables)]
    assert trend_test(against, rng)[1] > 0.5
