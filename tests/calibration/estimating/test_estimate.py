import numpy as np
import pytest
from scipy.stats import poisson
from synthetic_runs import line_network, restarted_run

from calibration import Exposure, RateEstimate, count, estimate, exact_limits
from kinetics.rates import Rates, about_priors


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
    assert RateEstimate("c", 3, 50.0).posterior == (3.5, 50.0)


def test_closed_channel_is_not_measured():
    network = line_network()
    calibrated = estimate([Exposure(network, [5, 0, 1, 2, 3, 4, 0, 0], [9.0, 9, 9, 9, 9, 9, 9, 0])])
    closed = calibrated["4->2+2"]
    assert not closed.is_measured
    assert np.isnan(closed.rate)
    assert closed.interval() == (0.0, np.inf)
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
