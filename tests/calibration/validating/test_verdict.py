"""Ranks, single runs and the verdict: exact where they say so, and sharp where they must be."""

from functools import partial

import numpy as np
import pytest
from scipy.stats import binom, combine_pvalues, kstest

from calibration.validating.power import Power
from calibration.validating.predictive import ENOUGH, least_p, looks, predictive_p, sequential_p, shown_p, upper_p
from calibration.validating.scores import share_inside
from calibration.validating.single_runs import judge_single_runs, pooled_p
from calibration.validating.verdict import ConsistencyCheck, judged

FALSE_ALARM = 1e-6


def test_predictive_p_is_uniform_without_ties():
    """20,000 numbers among 199 like them."""
    rng = np.random.default_rng(1)
    counts = rng.gamma(0.3, size=(200, 20_000))
    p = predictive_p(counts[0], counts[1:])
    values, tally = np.unique(np.rint(p * 100).astype(int), return_counts=True)
    np.testing.assert_array_equal(values, np.arange(1, 101))
    assert p.min() == least_p(199) == 0.01
    chi_squared = ((tally - 200) ** 2 / 200).sum()
    assert chi_squared < 99 + 6 * np.sqrt(2 * 99)
    off = predictive_p(rng.gamma(0.4, size=20_000), counts[1:])  # control
    assert kstest(off, "uniform").pvalue < FALSE_ALARM


def test_ties_never_make_a_p_value_small():
    """Counts of mean 0.3, nearly all equal: at no level more than its share, and none of the commonest count below 1.

    A control breaks ties at random: its p-values keep the level as well, and call some runs without events rare.
    """
    rng = np.random.default_rng(1)
    counts = rng.poisson(0.3, size=(200, 20_000)).astype(float)
    p = predictive_p(counts[0], counts[1:])
    assert not any(over(p, level) for level in LEVELS)
    assert (p[counts[0] == 0] == 1.0).all()
    assert p[counts[0] == 3].max() < 0.2  # three are seldom
    ties = (counts[1:] == counts[0]).sum(axis=0)
    rank = 1 + (counts[1:] < counts[0]).sum(axis=0) + rng.integers(0, ties + 1)
    broken = 2 * np.minimum(rank, 201 - rank) / 200
    assert not any(over(broken, level) for level in LEVELS)
    assert broken[counts[0] == 0].min() < 0.02


@pytest.fixture(scope="module")
def stopped():
    """p-values of 8,000 numbers (Gamma, mean 20) among 39, 79, ..., 999 groups like them, and the least possible."""
    rng = np.random.default_rng(2)
    values = rng.gamma(20.0, size=(1000, 8000))
    return sequential_p(values[0], looks(39, 999), lambda n: values[1 : n + 1])


def over(p, level):
    """Whether more p-values are at most this level than its share allows, at a false-alarm rate of 1e-6."""
    return binom.sf(np.count_nonzero(p <= level) - 1, p.size, level) < FALSE_ALARM


LEVELS = (0.002, 0.004, 0.01, 0.011, 0.02, 0.03, 0.05, 0.1, 0.2, 0.249, 0.25, 0.5)


def test_stopping_keeps_the_level(stopped):
    """At no level more than its share; below the least that stops, just its share. The control: the smallest ever.

    Looked at as often, but with the smallest p-value on the way instead of the last, the level is lost.
    """
    p, _ = stopped
    assert not any(over(p, level) for level in LEVELS)
    assert binom.cdf(np.count_nonzero(p <= 0.008), p.size, 0.008) > FALSE_ALARM
    rng = np.random.default_rng(3)
    values = rng.gamma(20.0, size=(1000, 8000))
    ways = [predictive_p(values[0], values[1 : n + 1]) for n in looks(39, 999)]
    assert any(over(np.min(ways, axis=0), level) for level in LEVELS)


def test_small_p_values_have_all_groups_and_large_ones_the_first(stopped):
    p, least = stopped
    assert p.min() == 0.002
    np.testing.assert_allclose(least[p < 0.01], 2 / 1000)
    assert np.mean(least == 2 / 40) > 0.7  # 3 in 4 are clear at once
    assert (p >= ENOUGH * least)[least > 2 / 1000].all()  # each stopped with as many groups on its side
    groups = 2 / least - 1
    assert groups.mean() < 200  # of 999


def test_nothing_is_made_where_all_is_clear():
    asked = []

    def groups(n):
        asked.append(n)
        return np.linspace(-1, 1, n)[:, None]

    p, _ = sequential_p(np.array([0.0]), looks(99, 9999), groups)
    assert p[0] > 0.9
    assert asked == [99]
    sequential_p(np.array([2.0]), looks(99, 9999), groups)  # control
    assert asked[1:] == [99, 199, 399, 799, 1599, 3199, 6399, 9999]


def test_p_values_in_words():
    assert shown_p(4e-5, 4e-5) == "p ≤ 4e-05"
    assert shown_p(0.0123, 4e-5) == "p = 0.012"
    assert upper_p(3.0, np.array([1.0, 2.0, 3.0, 4.0])) == 0.6


def groups_of_runs(rng, repeats, scale=1.0):
    """Whole values (1 + 99, 6, 2) of runs that share a rate, as under a posterior; scale : on the first group's."""
    for _ in range(repeats):
        rates = rng.gamma(20.0, 0.1, size=(100, 1, 1)) * np.ones((1, 6, 2))
        rates[0] *= scale
        yield rng.poisson(rates).astype(float)


@pytest.mark.parametrize(("scale", "holds"), [(1.0, True), (2.0, False)])
def test_single_runs_have_the_exact_p_value(scale, holds):
    """Runs of a group share their rate, so the textbook's Kolmogorov-Smirnov law would be wrong; the rank is not."""
    found = [
        judge_single_runs(("a", "b"), values[0], values[1:], seed=i)
        for i, values in enumerate(groups_of_runs(np.random.default_rng(3), 300, scale))
    ]
    assert (kstest([each.p_value for each in found], "uniform").pvalue > FALSE_ALARM) == holds
    textbook = [kstest(each.pit.ravel(), "uniform").pvalue for each in found]
    assert kstest(textbook, "uniform").pvalue < FALSE_ALARM
    assert all(each.pit.min() >= 0 and each.pit.max() <= 1 for each in found)


@pytest.mark.parametrize(("scale", "holds"), [(1.0, True), (2.0, False)])
def test_single_runs_of_all_sizes_have_the_exact_p_value(scale, holds):
    """Experiments share the rates, so their p-values go together, and Fisher's textbook law would be wrong."""
    rng = np.random.default_rng(5)
    together, textbook = [], []
    for i in range(200):
        rates = rng.gamma(20.0, 0.1, size=(60, 1, 1))
        rates[0] *= scale
        sizes = [rng.poisson(rates * cubes * np.ones((1, 6, 2))).astype(float) for cubes in (8, 16, 24)]
        found = [judge_single_runs(("a", "b"), values[0], values[1:], seed=i) for values in sizes]
        together.append(pooled_p(found))
        textbook.append(combine_pvalues([each.p_value for each in found]).pvalue)
        assert pooled_p(found[:1]) == found[0].p_value
    assert (kstest(together, "uniform").pvalue > FALSE_ALARM) == holds
    assert kstest(textbook, "uniform").pvalue < FALSE_ALARM


def test_shares_stand_beside_their_range():
    """Each point is inside its band in 95 %, but a share of 40 that go together ranges far wider."""
    rng = np.random.default_rng(4)
    together = rng.normal(size=(1000, 1)) + 0.1 * rng.normal(size=(1000, 40))
    low, high = np.quantile(together, [0.025, 0.975], axis=0)
    found = share_inside(together[0], together, low, high)
    assert found.high == 1.0
    assert found.low < 0.5
    apart = rng.normal(size=(1000, 40))
    low, high = np.quantile(apart, [0.025, 0.975], axis=0)
    assert share_inside(apart[0], apart, low, high).low > 0.85


def test_holm_and_the_sentence():
    check = partial(ConsistencyCheck, least=1e-4)
    some = [check("a", 0.004), check("b", 0.0049), check("c", 0.02), check("d", float("nan"))]
    verdict = judged(some)
    assert [each.what for each in verdict.checks] == ["a", "b", "c"]
    assert verdict.is_consistent  # 0.004 > 0.01 / 3, and nothing after it counts
    assert verdict.sentence.startswith("consistent with the prediction in all 3 checks at 1 % (closest: a, p = 0.004)")
    worse = judged([check("a", 0.003), *some[1:]])
    assert worse.sentence == "not consistent: a, p = 0.003; b, p = 0.0049"  # 0.01 / 3, then 0.01 / 2
    assert not worse.is_consistent
    powers = [Power("joins", 0.2, 0.95, 0.56)]
    assert judged(some, powers).sentence.endswith(
        "; this many runs would have shown joins off by 20 % with probability 95 % "
        "(p ≤ 0.01 in their row; 56 % by the verdict)"
    )
