from fractions import Fraction

import mpmath
import numpy as np
import pytest
from known_systems import FALSE_ALARM, assert_follows_cdf, decay, line, network, switch, walk
from matplotlib.figure import Figure
from numpy.testing import assert_allclose, assert_array_equal
from scipy.special import gammainc, gammaincc, gammaincinv

from kinetics import Chain, first_passage, sample_path
from kinetics.markov import ask
from kinetics.markov.passage import elimination


def erlang(stages, rate=2.0):
    return first_passage(walk(stages, rate, 0.0), np.eye(1, stages + 1, dtype=int)[0], f"place{stages}")


@pytest.mark.parametrize("stages", [1, 7, 400])
def test_erlang(stages):
    law = erlang(stages)
    assert_allclose([law.mean, law.sd], [stages / 2, np.sqrt(stages) / 2], rtol=1e-13)
    times = np.linspace(0.0, 2 * law.mean, 13).reshape(13, 1)
    assert_allclose(law.cdf(times), gammainc(stages, 2 * times), rtol=0, atol=1e-13)
    assert_allclose(law.survival(times), gammaincc(stages, 2 * times), rtol=0, atol=1e-13)
    q = np.array([0.001, 0.5, 0.99])
    assert_allclose(gammainc(stages, 2 * law.quantile(q)), q, rtol=1e-11)
    assert law.is_certain
    assert law.probability == 1.0


@pytest.mark.parametrize("n", [1, 5, 20, 60, 250])
def test_walk_against_a_drift(n):
    law = first_passage(walk(n), np.eye(1, n + 1, dtype=int)[0], f"place{n}")
    assert_allclose(law.mean, 2.0 ** (n + 1) - n - 2, rtol=1e-12)
    assert law.error < 2e-12
    if n == 60:  # such a remote target is reached at an exponential time
        assert_allclose(law.sd, law.mean, rtol=1e-9)
        assert_allclose(law.cdf(1e17), -np.expm1(-1e17 / law.mean), rtol=1e-9)
    if n == 250:
        with pytest.raises(ValueError, match=r"needs .* steps at 1e.17 tu, at most 5000000 with more than 200 states"):
            law.cdf(1e17)


@pytest.mark.parametrize("q", [0.01, 0.5, 0.999])
def test_quantiles_of_a_stiff_passage_are_bounded_too(q):
    """Two states that exchange 1e9 times a tu, of which one leads on at 0.001: 1e12 steps until the median."""
    fast, slow = mpmath.mpf(1e9), mpmath.mpf(1e-3)
    chain = Chain([[0, 1e9, 0], [1e9, 0, 1e-3], [0, 0, 0]], 0, {"done": [False, False, True]})
    answer = ask(chain, f'quantile(min T, P>={q} [ F<=T "done" ])')
    assert (answer.is_bound, answer.method) == (True, "matrix exponential")
    with mpmath.workdps(60):
        # alive(t) = (b exp(a t) - a exp(b t)) / (b - a) with a, b the roots of x^2 + (2 fast + slow) x + fast slow
        half = mpmath.sqrt((2 * fast + slow) ** 2 - 4 * fast * slow)
        a, b = (-(2 * fast + slow) + half) / 2, (-(2 * fast + slow) - half) / 2
        exact = mpmath.log((1 - mpmath.mpf(q)) * (b - a) / b) / a  # exp(b t) has long been 0
        assert answer.low <= exact <= answer.high
    assert answer.high - answer.low < 1e-7 * answer.value


@pytest.mark.parametrize("stages", [1, 7, 400])
def test_bounds_of_the_distribution(stages):
    law = erlang(stages)
    times = np.linspace(0.0, 2 * law.mean, 13).reshape(13, 1)
    for bounds, exact in (
        (law.cdf_bounds(times), gammainc(stages, 2 * times)),
        (law.survival_bounds(times), gammaincc(stages, 2 * times)),
    ):
        low, high = bounds
        assert (low <= exact).all()
        assert (exact <= high).all()
        assert (high - low).max() < 1e-11
    q = np.array([0.0, 0.001, 0.5, 0.99])
    low, high = law.quantile_bounds(q)
    exact = gammaincinv(stages, q) / 2
    assert (low <= exact * (1 + 1e-13)).all()
    assert (exact <= high * (1 + 1e-13)).all()
    assert_allclose(low, high, rtol=1e-10)
    assert abs(law.sd / (np.sqrt(stages) / 2) - 1) <= law.sd_error < 1e-11
    # The control: a rate that is wrong by 1e-9 falls outside.
    wrong = gammainc(stages, 2 * (1 + 1e-9) * times[6])
    assert not law.cdf_bounds(times[6])[0] <= wrong <= law.cdf_bounds(times[6])[1]


@pytest.mark.parametrize("stages", [7, 40])
def test_early_and_late_times_have_digits(stages):
    """Down to 1e-200, by the incomplete gamma function in a hundred digits."""
    law = erlang(stages)
    with mpmath.workdps(100):
        early = 10.0 ** np.linspace(-200 / stages, -1.0, 5)
        for bounds, values, times, ends in (
            (law.cdf_bounds, law.cdf, early, lambda t: (0, 2 * mpmath.mpf(t))),
            (law.survival_bounds, law.survival, np.linspace(3.0, 8.0, 4) * law.mean, lambda t: (2 * mpmath.mpf(t),)),
        ):
            exact = [mpmath.gammainc(stages, *ends(float(t)), regularized=True) for t in times]
            low, high = bounds(times)
            assert all(a <= truth <= b for a, truth, b in zip(low, exact, high, strict=True))
            assert (high / low - 1).max() < 2e-12
            assert float(min(exact)) < 1e-8
            assert_allclose(values(times), [float(truth) for truth in exact], rtol=1e-13)
            wrong = bounds(times * (1 + 1e-11))
            control = [a <= truth <= b for a, truth, b in zip(wrong[0], exact, wrong[1], strict=True)]
            assert not any(control)
    q = law.cdf(early[0])
    assert law.quantile(q) == pytest.approx(early[0], rel=1e-14, abs=0.0)
    low, high = law.quantile_bounds(q)
    assert low <= early[0] <= high < low * (1 + 1e-12)


def test_bounds_of_quantiles_at_the_edge_of_what_is_ever_reached():
    reactions = {"good": ((1, 0, 0), (0, 1, 0)), "bad": ((1, 0, 0), (0, 0, 1))}
    law = first_passage(network("ABC", reactions, [1.0, 3.0]), [1, 0, 0], "B")
    low, high = law.quantile_bounds([0.125, 0.25, 0.3])
    assert low[0] < np.log(2) / 4 < high[0] < low[0] + 1e-12
    near = law.quantile_bounds(law.probability * (1 - 1e-14))
    assert near[0] < np.inf == near[1]
    assert 4.0 < low[1] < high[1] == np.inf  # exp(-4 t) = 1e-9 / 0.25 at 4.8
    assert low[2] == high[2] == np.inf
    assert first_passage(decay(), [3], "X", 2).quantile_bounds(0.5) == (0.0, 0.0)


@pytest.mark.parametrize("n", [3, 10, 30])
def test_bound_of_the_standard_deviation(n):
    # Moments by rational elimination on the walk against a drift.
    law = first_passage(walk(n), np.eye(1, n + 1, dtype=int)[0], f"place{n}")
    up1, up2 = [], []  # moments of the time from place k to k + 1, which are independent
    for k in range(n):
        down = Fraction(2 if k else 0)
        wait = 1 / (1 + down)
        back1, back2 = (up1[-1], up2[-1]) if k else (Fraction(0), Fraction(0))
        one = (wait + down * wait * back1) / (1 - down * wait)
        two = 2 * wait**2 + 2 * wait * down * wait * (back1 + one) + down * wait * (back2 + 2 * back1 * one)
        up1.append(one)
        up2.append(two / (1 - down * wait))
    first = sum(up1)
    variance = sum(b - a * a for a, b in zip(up1, up2, strict=True))
    assert abs(Fraction(law.mean) / first - 1) <= Fraction(law.error)
    assert abs(float(Fraction(law.sd) ** 2 / variance - 1)) / 2 <= law.sd_error < 1e-11 * n


@pytest.mark.parametrize(
    ("table", "mean", "sd"),
    [("table3", 95.44, 58.54), ("table3_geometric", 47.72, 29.29), ("table3_literal", 29.64, 18.44)],
)
def test_first_line_of_four(table, mean, sd):
    law = first_passage(line(table), [60, 0, 0, 0], "quadmer")
    assert_allclose([law.mean, law.sd], [mean, sd], atol=0.005)


def test_against_sampling():
    law = first_passage(line(), [24, 0, 0, 0], "quadmer", copies=2)
    end = float(law.quantile(1 - 1e-7))
    times = np.array(
        [sample_path(line(), [24, 0, 0, 0], end, seed=1, run=run).first_time("quadmer", 2) for run in range(600)]
    )
    assert_follows_cdf(times, law.cdf)
    z = (times.mean() - law.mean) / (law.sd / np.sqrt(times.size))
    assert abs(z) < 4.9  # 1e-6
    with pytest.raises(AssertionError):  # the first line instead of the second
        assert_follows_cdf(times, first_passage(line(), [24, 0, 0, 0], "quadmer").cdf)


def test_mean_is_the_integral_of_survival():
    law = first_passage(line(), [30, 0, 0, 0], "quadmer")
    times = np.linspace(0.0, float(law.quantile(1 - 1e-9)), 4001)
    assert_allclose(np.trapezoid(law.survival(times), times), law.mean, rtol=1e-5)


def test_a_passage_that_may_fail():
    reactions = {"good": ((1, 0, 0), (0, 1, 0)), "bad": ((1, 0, 0), (0, 0, 1))}
    law = first_passage(network("ABC", reactions, [1.0, 3.0]), [1, 0, 0], "B")
    assert_allclose(law.probability, 0.25, rtol=1e-14)
    assert law.mean == np.inf
    assert np.isnan(law.sd)
    assert not law.is_certain
    assert_allclose(law.cdf([0.5, 100.0]), [0.25 * (1 - np.exp(-2.0)), 0.25], rtol=1e-13)
    assert_allclose(law.quantile(0.125), np.log(2) / 4, rtol=1e-12)
    assert law.quantile(0.25) == np.inf
    assert "not certain, reached with probability 0.25" in str(law)


def test_gamblers_ruin_far_below_double_precision():
    # A walker between 0, which it never leaves, and n: probability of n from 1 is 1 / (2**n - 1) at odds 2 : 1.
    n = 80
    net = walk(n)
    rates = net.rate_constants.copy()
    rates[0] = 0.0
    law = first_passage(net.with_rates(rates), np.eye(1, n + 1, 1, dtype=int)[0], f"place{n}")
    assert_allclose(law.probability, 1 / (2.0**n - 1), rtol=1e-12)


def test_an_unreachable_target():
    law = first_passage(decay(), [3], "X", copies=4)
    assert law.probability == 0.0
    assert law.mean == np.inf
    assert law.quantile(0.5) == np.inf
    assert_array_equal(law.cdf([1.0, 10.0]), [0, 0])


def test_already_there():
    law = first_passage(line(), [0, 0, 0, 1], "quadmer")
    assert (law.mean, law.sd, law.probability) == (0.0, 0.0, 1.0)
    assert_array_equal(law.cdf([0.0, 3.0]), [1, 1])
    assert law.quantile(0.5) == 0.0


def test_too_remote():
    with pytest.raises(ValueError, match="too remote: a mean time until it is beyond 1e308"):
        first_passage(switch(1.0, 100.0), [2500, 0], "B", copies=2500)


def test_chains_too_large_to_eliminate(monkeypatch):
    narrow = first_passage(line(), [30, 0, 0, 0], "quadmer", 2)
    monkeypatch.setattr(elimination, "MAX_WORK", 0)
    sparse = first_passage(line(), [30, 0, 0, 0], "quadmer", 2)
    assert_allclose([sparse.mean, sparse.sd], [narrow.mean, narrow.sd], rtol=sparse.error + narrow.error)
    assert sparse.error < 1e-9
    with pytest.raises(ValueError, match="too remote: with 60 transient states, too many to eliminate"):
        first_passage(walk(60), np.eye(1, 61, dtype=int)[0], "place60")


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (([60, 0, 0, 0], "pentamer"), "unknown species 'pentamer'"),
        (([60, 0, 0, 0], "quadmer", -1), "copies = -1"),
        (([60, 0, 0, 0], "quadmer", 1.5), "copies = 1.5"),
        (([60, 0, 0], "quadmer"), "state has shape"),
    ],
)
def test_bad_input(arguments, message):
    with pytest.raises(ValueError, match=message):
        first_passage(line(), *arguments)


def test_bad_questions():
    law = erlang(3)
    for q in (-0.1, 1.0, np.nan):
        with pytest.raises(ValueError, match="expected probabilities from 0 to below 1"):
            law.quantile(q)
    for time in (-1.0, np.nan, np.inf):
        with pytest.raises(ValueError, match="times holds"):
            law.cdf(time)


def test_plot():
    ax = Figure().add_subplot()
    assert erlang(3).plot(ax) is ax
    assert [text.get_text() for text in ax.get_legend().get_texts()] == ["until 1 place3", "mean 1.5"]
    assert ax.get_xlabel() == "time"
    assert 0 < FALSE_ALARM < 1e-3
