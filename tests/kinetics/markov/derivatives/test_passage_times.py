"""Derivatives of moments, sd and quantiles of passage times: closed forms, differences, limits in exact fractions."""

from fractions import Fraction
from math import gamma, sqrt

import mpmath
import numpy as np
import pytest
from exact_fractions import exact_moments
from known_systems import decay, line
from numpy.testing import assert_allclose
from random_chains import random_rates

from kinetics.markov import Chain, Sensitivity

Q = (1e-12, 0.03, 0.5, 0.97, 0.9999)
N = 5
LAST = np.arange(N) == N - 1


def holds(low, true, high):
    """Whether limits hold, which they do not of what is off by four times their width."""
    wrong = true + 4 * (Fraction(high) - Fraction(low)) + Fraction(1, 10**300)
    return Fraction(low) <= true <= Fraction(high) and not Fraction(low) <= wrong <= Fraction(high)


def test_erlang():
    """n waits at k: moments gamma(n + m) / gamma(n) / k**m, sd and quantiles all in proportion to powers of 1 / k."""
    n, k = 5, 0.7
    ahead = np.diag(np.full(n, k), 1)
    asked, last = Sensitivity(Chain(ahead, 0), {"k": ahead > 0}), np.arange(n + 1) == n
    for order in (1, 2, 3, 6):
        found = asked.passage_moment(last, order)
        assert found.answer.value == pytest.approx(gamma(n + order) / gamma(n) / k**order, rel=1e-12)
        low, high = found.elasticity_bounds
        assert low[0] <= -order <= high[0]
        assert high[0] - low[0] < 1e-10
    for found in (asked.passage_sd(last), *(asked.passage_quantile(last, q) for q in Q)):
        low, high = found.elasticity_bounds
        assert found.is_bound
        assert low[0] <= -1.0 <= high[0]
        assert high[0] - low[0] < 1e-6
        assert not low[0] <= -1.0 + 1e-6 <= high[0]  # the control
    assert asked.passage_sd(last).answer.value == pytest.approx(sqrt(n) / k, rel=1e-12)


def test_two_waits():
    """At a and then b: variance 1 / a**2 + 1 / b**2; the distribution is a difference of exponentials."""
    a, b = 0.8, 2.5
    rates = np.diag([a, b], 1)
    shares = {"a": np.diag([1, 0], 1), "b": np.diag([0, 1], 1)}
    asked, last = Sensitivity(Chain(rates, 0), shares), np.arange(3) == 2
    sd = sqrt(a**-2 + b**-2)
    assert_allclose(asked.passage_sd(last).value, [-(a**-2) / sd, -(b**-2) / sd], rtol=1e-12)

    def cdf(x, y, t):
        return 1 - (y * mpmath.exp(-x * t) - x * mpmath.exp(-y * t)) / (y - x)

    for q in Q:
        found = asked.passage_quantile(last, q)
        with mpmath.workdps(40):
            at = mpmath.findroot(
                lambda t, q=q: cdf(mpmath.mpf(a), mpmath.mpf(b), t) - mpmath.mpf(q), found.answer.value
            )
            parts = [mpmath.diff(cdf, (mpmath.mpf(a), mpmath.mpf(b), at), n) for n in ((1, 0, 0), (0, 1, 0), (0, 0, 1))]
            true = [-k * part / parts[2] for k, part in zip((a, b), parts[:2], strict=True)]
            for low, each, high in zip(found.low, true, found.high, strict=True):
                assert low <= each <= high
                assert not low <= each + 4 * (high - low) <= high
        assert (found.high - found.low).max() < 1e-6 * found.answer.value


def test_the_last_of_many_copies():
    """n copies that decay on their own: F = (1 - exp(-k t))**n, so the quantile is -ln(1 - q**(1/n)) / k."""
    n, k, q = 6, 0.4, 0.9
    asked = Sensitivity(Chain.of(decay(k), {"X": n}))
    found = asked.passage_quantile("X == 0", q)
    true = -np.log1p(-(q ** (1 / n))) / k
    assert found.answer.value == pytest.approx(true, rel=1e-10)
    assert found.by_constant[0] == pytest.approx(-true / k, rel=1e-8)
    sd = asked.passage_sd("X == 0")
    assert sd.by_constant[0] == pytest.approx(-sqrt(sum(1 / i**2 for i in range(1, n + 1))) / k**2, rel=1e-12)


@pytest.mark.parametrize("what", ["sd", 2, 0.05, 0.5, 0.95])
def test_differences_on_the_line_of_four(what):
    """By central differences, twice extrapolated, of the answers themselves."""
    target, initial = "quadmer >= 2", {"monomer": 10}

    def chain(moved):
        return Chain.of(line().with_rates(moved), initial)

    def answer(moved):
        found = chain(moved).passage(target)
        if what == "sd":
            return found.sd
        return found.sd**2 + found.mean**2 if what == 2 else float(found.quantile(what))

    rates = np.array(line().known_rates, dtype=float)
    asked = Sensitivity(chain(rates))
    found = {"sd": asked.passage_sd, 2: lambda goal: asked.passage_moment(goal, 2)}.get(
        what, lambda goal: asked.passage_quantile(goal, what)
    )(target)
    assert found.answer.value == pytest.approx(answer(rates), rel=1e-11)
    expected = []
    for r in range(rates.size):
        only = 4e-3 * (np.arange(rates.size) == r)
        one, two, four = (
            (answer(rates * np.exp(k * only)) - answer(rates * np.exp(-k * only))) / (8e-3 * k) for k in (1, 2, 4)
        )
        once, again = (4 * one - two) / 3, (4 * two - four) / 3
        expected.append((16 * once - again) / 15)
    assert_allclose(found.value, expected, rtol=1e-6, atol=1e-8 * found.answer.value)
    assert np.abs(found.value - np.roll(expected, 1)).max() > 1e-3 * np.abs(expected).max()  # the control
    scale = -2.0 if what == 2 else -1.0  # twice the rates are half the time
    assert found.elasticity.sum() == pytest.approx(scale, rel=1e-8)


@pytest.mark.parametrize("seed", range(12))
def test_limits_of_moments_hold_in_exact_fractions(seed):
    rng = np.random.default_rng(seed)
    rates = random_rates(7000 + seed, N, decades=3.0 * rng.random())
    rates[-1] = 0.0
    shares = {name: (rng.random((N, N)) < 0.5) * rng.choice([1.0, -2.0, 0.5], (N, N)) for name in "ab"}
    chain = Chain(rates, 0 if seed % 2 else [*rng.dirichlet(np.ones(N - 1)), 0.0])
    asked = Sensitivity(chain, shares)
    sd = asked.passage_sd(LAST)
    for p, name in enumerate(shares):
        (mean, square, cube), slopes = exact_moments(rates, shares[name], chain.initial, 3)
        for order, (moment, slope) in enumerate(zip((mean, square, cube), slopes, strict=True), start=1):
            found = asked.passage_moment(LAST, order)
            assert found.is_bound
            assert Fraction(found.answer.low) <= moment <= Fraction(found.answer.high)
            assert holds(found.low[p], slope, found.high[p])
        with mpmath.workdps(60):
            true = (slopes[1] - 2 * mean * slopes[0]) / 2
            root = mpmath.sqrt(mpmath.mpf((square - mean**2).numerator) / (square - mean**2).denominator)
            each = mpmath.mpf(true.numerator) / true.denominator / root
            assert sd.low[p] <= each <= sd.high[p]
            assert not sd.low[p] <= each + 4 * (sd.high[p] - sd.low[p]) <= sd.high[p]


def test_a_target_that_may_be_missed_has_quantiles_up_to_its_probability():
    """To 1 at a, or to 2 at b: reached by t with a probability of a / (a + b) (1 - exp(-(a + b) t))."""
    a, b, q = 0.6, 0.2, 0.5
    rates = np.zeros((3, 3))
    rates[0] = [0.0, a, b]
    asked = Sensitivity(Chain(rates, 0), {"a": rates == a, "b": rates == b})
    found = asked.passage_quantile([False, True, False], q)
    both, share = a + b, a / (a + b)
    t = -np.log1p(-q / share) / both
    grown, density = -np.expm1(-both * t), a * np.exp(-both * t)
    by_a = b / both**2 * grown + share * t * np.exp(-both * t)
    by_b = -a / both**2 * grown + share * t * np.exp(-both * t)
    assert_allclose(found.value, [-a * by_a / density, -b * by_b / density], rtol=1e-9)
    with pytest.raises(ValueError, match=r"reached with probability 0\.75 only, so q = 0\.8 is never reached"):
        asked.passage_quantile([False, True, False], 0.8)
    for question in (asked.passage_sd, lambda goal: asked.passage_moment(goal, 2)):
        with pytest.raises(ValueError, match="reached with probability"):
            question([False, True, False])


def test_what_is_no_quantile_or_moment():
    asked = Sensitivity(Chain.of(decay(), {"X": 3}))
    for q in (0.0, 1.0, -0.5, np.nan):
        with pytest.raises(ValueError, match="expected a probability between 0 and 1"):
            asked.passage_quantile("X == 0", q)
    for order in (0, 1.5, True):
        with pytest.raises(ValueError, match="expected a whole number of at least 1"):
            asked.passage_moment("X == 0", order)
    with pytest.raises(ValueError, match="moments are known up to 20"):
        asked.passage_moment("X == 0", 21)
    # already there: no rate matters
    for found in (asked.passage_sd("X == 3"), asked.passage_moment("X == 3", 2), asked.passage_quantile("X == 3", 0.5)):
        assert found.answer.value == 0.0
        assert not found.value.any()
