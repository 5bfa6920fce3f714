import numpy as np
import pytest
from scipy.stats import gamma, poisson
from synthetic_runs import line_network, restarted_run

from calibration import Exposure, RateEstimate, count, estimate, exact_limits, paper_estimate
from kinetics.rates import Rates, about_priors
from kinetics.runs import JumpPath


def test_golden_values():
    """Waits known in number: n = 12, sum T = 1297; chi-square quantiles with 90 degrees of freedom."""
    low, high = RateEstimate("c", 12, 1297.0).interval(fixed="events")
    assert (low, high) == pytest.approx((0.00478, 0.01518), abs=5e-6)
    low, high = exact_limits(45, 0.5, level=0.8, fixed="events")  # 2 n rate E is chi-square with 90 degrees of freedom
    assert (low, high) == pytest.approx((73.2911, 107.5650), abs=5e-5)


@pytest.mark.parametrize("events", [0, 1, 2, 17, 400])
def test_limits_are_garwoods(events):
    """At the lower limit so many events or more have the chance 2.5 %, at the upper one so many or fewer."""
    low, high = RateEstimate("c", events, 250.0).interval()
    assert poisson.cdf(events, high * 250) == pytest.approx(0.025, rel=1e-9)
    if events:
        assert poisson.sf(events - 1, low * 250) == pytest.approx(0.025, rel=1e-9)
    else:
        assert low == 0.0
        assert high == pytest.approx(-np.log(0.025) / 250)


def test_posterior_is_jeffreys():
    estimated = RateEstimate("c", 3, 50.0)
    assert estimated.posterior == (3.5, 50.0)
    assert estimated.credible_interval() == pytest.approx(gamma(3.5, scale=1 / 50).ppf([0.025, 0.975]))


def test_closed_channel_is_not_measured():
    network = line_network()
    calibrated = estimate([Exposure(network, [5, 0, 1, 2, 3, 4, 0, 0], [9.0, 9, 9, 9, 9, 9, 9, 0])])
    closed = calibrated["4->2+2"]
    assert not closed.is_measured
    assert np.isnan(closed.rate)
    assert closed.interval() == closed.credible_interval() == (0.0, np.inf)
    assert calibrated.not_measured == ("4->2+2",)
    assert calibrated.table()[-1]["note"] == "not measured"
    assert calibrated["1+2->3"].rate == 0.0  # watched, but never seen: an upper limit


def test_what_was_not_measured_gets_a_prior_from_its_kind():
    """Half an event at the mean rate of all breaks; as wide as that is, and marked."""
    network = line_network()
    known = [400.0, 400, 400, 400, 100, 100, 200, 0]
    rates = estimate([Exposure(network, [5, 0, 1, 2, 3, 4, 1, 0], known)]).rates()
    prior = rates.channels["4->2+2"]
    assert rates.not_measured == ["4->2+2"]
    assert (prior.rate, prior.low, prior.events, prior.prior) == (0.0, 0.0, 0, "breaks")
    assert prior.exposure == pytest.approx(0.5 * 400 / 8.5)  # eight breaks of the others, and Jeffreys' half
    assert rates.posterior(network).mean[-1] == pytest.approx(8.5 / 400)
    draws = rates.draw_constants(network, np.random.default_rng(1), 20_000)[:, -1]
    assert np.quantile(draws, [0.025, 0.975]) == pytest.approx(8.5 / 400 * np.array([0.00098, 5.02]), rel=0.15)
    assert about_priors(rates.not_measured).startswith("Not measured: 4->2+2. No run held the reactants")
    whole = estimate([Exposure(network, [5, 0, 1, 2, 3, 4, 1, 0], [400.0] * 8)]).rates()  # the control
    assert (whole.not_measured, about_priors(whole.not_measured)) == ([], "")
    none = Exposure(network, [5, 0, 1, 2, 0, 0, 0, 0], [400.0] * 4 + [0.0] * 4)
    with pytest.raises(ValueError, match="no run could fire 2->1\\+1, or another channel of its kind"):
        estimate([none]).rates()


def test_rates_file_round_trip(tmp_path):
    network = line_network()
    calibrated = estimate([Exposure(network, [5, 0, 1, 2, 3, 4, 7, 9], np.arange(1.0, 9.0) * 100)])
    rates = calibrated.rates({"scene": "line4", "seeds": [1, 2]})
    rates.save(tmp_path / "rates.toml")
    again = Rates.load(tmp_path / "rates.toml")
    assert again == rates
    assert again.without_evidence() == []
    assert again.network == network.fingerprint
    np.testing.assert_allclose(again.apply(network).rate_constants, calibrated.total.events / calibrated.total.exposure)
    assert again.channels["1+2->3"].low == again.channels["1+2->3"].rate == 0.0


def test_pools_runs_of_all_kinds():
    network = line_network()
    path = restarted_run(network, network.state([14, 12, 6, 1]), 20.0, np.random.default_rng(0))
    calibrated = estimate([path, count(path)])
    np.testing.assert_array_equal(calibrated.total.events, 2 * count(path).events)
    assert len(calibrated.runs) == 2
    with pytest.raises(ValueError, match="no runs"):
        estimate([])
    with pytest.raises(ValueError, match="unknown channel '5->6'"):
        calibrated["5->6"]


@pytest.mark.parametrize(("arguments", "message"), [((1.2,), "level = 1.2"), ((0.9, "waits"), "fixed = 'waits'")])
def test_wrong_interval(arguments, message):
    with pytest.raises(ValueError, match=message):
        RateEstimate("c", 3, 50.0).interval(*arguments)
    with pytest.raises(ValueError, match="at least one event"):
        RateEstimate("c", 0, 50.0).interval(fixed="events")


def one_channel_runs(n_runs, mean_events, rng):
    """Restarted runs of 2 dimer -> quadmer alone, of one length."""
    network = line_network()
    only = np.array(network.channels) == "2+2->4"
    network = network.with_rates(network.known_rates * only)
    initial = network.state([0, 20, 0, 0])
    end = mean_events / network.propensities(initial).sum()
    runs = [restarted_run(network, initial, end, rng) for _ in range(n_runs)]
    return network, [JumpPath(network, initial, run.times, run.channels, end, only) for run in runs]


def test_papers_estimator_is_too_high_by_n_over_n_minus_1():
    """Given n >= 2 events, the last of n uniform moments is T max(U), and E[1 / max(U)] = n / (n - 1).

    The pooled estimate of the same runs, those without an event counted too, has no bias. 6 standard errors each:
    false alarms 4e-9. Control: the pooled value is not within 6 standard errors of the paper's.
    """
    network, runs = one_channel_runs(1500, 6.0, np.random.default_rng(5))
    true = network.rate_constants[3]
    pooled = np.array([estimate([run])["2+2->4"].rate for run in runs]) / true
    paper = np.array([paper_estimate([run])["2+2->4"] for run in runs]) / true
    events = np.array([count(run).events[3] for run in runs])
    expected = np.where(events >= 3, events / np.maximum(events - 1, 1), np.nan)
    ratio = np.where(events >= 3, paper / np.where(events > 0, pooled, 1), np.nan)  # at n = 2 the variance is infinite
    error = (ratio - expected)[events >= 3]
    assert abs(error.mean()) < 6 * error.std() / np.sqrt(error.size)
    assert abs(pooled.mean() - 1) < 6 * pooled.std() / np.sqrt(pooled.size)
    assert ratio[events >= 3].mean() > 1 + 6 * ratio[events >= 3].std() / np.sqrt(error.size)


def test_papers_estimator_agrees_where_events_are_many():
    network = line_network()
    rng = np.random.default_rng(8)
    runs = [restarted_run(network, network.state(s), 4000.0, rng) for s in ([14, 12, 6, 1], [6, 20, 2, 2])]
    paper = paper_estimate(runs)
    np.testing.assert_allclose([paper[c] for c in network.channels], network.rate_constants, rtol=0.12)


def test_papers_estimator_by_hand():
    """Two initial states are averaged; the clock stops outside them, and the wait after the last event is dropped."""
    network = line_network()
    first = JumpPath(network, [2, 0, 0, 0], [3.0, 3.0, 8.0], [0, -1, 0], 50.0)  # waits 3 and 5
    second = JumpPath(network, [3, 0, 0, 0], [2.0, 4.0], [0, 1], 50.0)  # wait 2; then it is elsewhere
    found = paper_estimate([first, second])
    assert found["1+1->2"] == pytest.approx((1 / (4 * 4 * 1) + 1 / (2 * 4 * 3)) / 2)
    assert np.isnan(found["1+2->3"])


def test_papers_estimator_needs_runs():
    with pytest.raises(ValueError, match="no runs"):
        paper_estimate([])
