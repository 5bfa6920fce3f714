"""Power is one rule: it is what brute force finds, and plans and verdicts say the same of the same runs."""

import math
from functools import cache

import numpy as np
import pytest
from scipy.stats import poisson
from synthetic_runs import breaking_run, line_network, restarted_run

from calibration import estimate
from calibration.estimating.joins_and_breaks import joins_and_breaks
from calibration.planning.forecast import Forecast
from calibration.planning.held_out import group_powers
from calibration.validating.events import HeldOutEvents
from calibration.validating.groups import SimulatedGroups
from calibration.validating.overall import overall_verdict
from calibration.validating.power import LEVEL, Power, power, power_of_runs
from kinetics.sampling import sample_path

START, END, RUNS, OFF = np.array([30, 0, 0, 0]), 25.0, 3, 0.5


@cache
def calibrated():
    """Rates known to some 5 to 10 %."""
    network = line_network()
    restarted = restarted_run(network, network.state([14, 12, 6, 1]), 250.0, np.random.default_rng(3))
    return estimate([restarted, breaking_run(network, network.state([0, 0, 12, 30]), 30.0, 4)]).rates()


@cache
def held_out():
    network = line_network()
    paths = [sample_path(network, START, END, seed=7, run=i) for i in range(RUNS)]
    return HeldOutEvents.of(SimulatedGroups(network, calibrated(), START, RUNS, 5), paths, END, 3000, 3000)


@pytest.mark.parametrize("events", [0.5, 3.0, 400.0, math.inf])
@pytest.mark.parametrize("rates_sd", [0.0, 0.05, 0.3])
@pytest.mark.parametrize("level", [0.05, LEVEL])
def test_rates_that_are_right_are_doubted_at_the_level(events, rates_sd, level):
    """From above alone where runs without any event are no rarity."""
    shape = 1 / rates_sd**2 if rates_sd else math.inf
    none = math.exp(-events) if rates_sd == 0 else (1 + events / shape) ** -shape
    sides = 1 if none > level / 2 else 2
    assert power(events, 1.0, rates_sd, level) == pytest.approx(sides * level / 2, rel=1e-6)
    assert power(events, 1.5, rates_sd, level) > level  # the control


def test_known_rates_in_closed_form():
    """Twice the 4 events supposed: a Poisson count of mean 8 above 10, where 10 is a tie; none are no rarity."""
    supposed, true = poisson(4.0), poisson(8.0)
    high = true.sf(10) + (LEVEL / 2 - supposed.sf(10)) / supposed.pmf(10) * true.pmf(10)
    assert power(8.0, 2.0, 0.0) == pytest.approx(high)


@pytest.mark.parametrize(("events", "factor", "rates_sd"), [(20.0, 0.5, 0.2), (60.0, 1.4, 0.1), (2000.0, 1.2, 0.05)])
def test_it_is_the_share_of_small_p_values(events, factor, rates_sd):
    """By ranks as in `predictive_p`, among 19,999 simulated counts; 20,000 trials: five standard errors are 0.018."""
    rng, shape = np.random.default_rng(2), 1 / rates_sd**2

    def counts(mean, n):
        return rng.poisson(mean * rng.gamma(shape, 1 / shape, n))

    supposed = np.sort(counts(events / factor, 19_999))
    seen = counts(events, 20_000)
    below, above = np.searchsorted(supposed, seen, "left"), np.searchsorted(supposed, seen, "right")
    rank = 1 + below + rng.integers(0, above - below + 1)  # expected events, no two alike, tell equal numbers apart
    p = 2 * np.minimum(rank, supposed.size + 2 - rank) / (supposed.size + 1)
    assert power(events, factor, rates_sd) == pytest.approx((p <= LEVEL).mean(), abs=0.02)


def test_many_runs_reach_the_limit_of_the_calibration():
    assert power(1e7, 0.8, 0.1) == pytest.approx(power(math.inf, 0.8, 0.1), abs=1e-3)
    assert power(1e3, 0.8, 1e-6) == pytest.approx(power(1e3, 0.8, 0.0), abs=1e-9)
    assert power(math.inf, 0.8, 0.0) == 1.0
    assert power(0.0, 0.8, 0.1) == power(math.nan, 0.8, 0.1) == power(10.0, 0.8, math.inf) == 0.0


@pytest.mark.parametrize("group", ["joins", "breaks"])
def test_brute_force(group):
    """Runs simulated under rates that are off, ranked among those under rates that are right."""
    column = held_out().names.index(group)
    low, high = np.quantile(held_out().first_totals.ratio[:, column], [LEVEL / 2, 1 - LEVEL / 2])
    found = power_of_runs([held_out()], group, OFF)
    shares = []
    for part, (factor, events) in enumerate(found.shifted):
        off = held_out().totals_off(group, factor, 2000, 20 + part)
        assert events == pytest.approx(off.seen[:, column].mean(), rel=0.05)
        shares.append(((off.ratio[:, column] < low) | (off.ratio[:, column] > high)).mean())
        assert power(events, factor, found.rates_sd) == pytest.approx(shares[-1], abs=0.1)
    assert found.power() == pytest.approx(min(shares), abs=0.1)
    assert found.power(3) > min(shares) + 0.15  # the control: three times the runs


def test_plans_and_verdicts_say_the_same_of_the_same_runs():
    network, rates = line_network(), calibrated()
    events = np.array([rates.channels[name].events for name in network.channels])
    planned = group_powers(Forecast.of(rates, network), events, joins_and_breaks(network), START, END, OFF)
    for plan in planned:
        judged = power_of_runs([held_out()], plan.group, OFF)
        assert judged.rates_sd == pytest.approx(plan.rates_sd, rel=0.15)
        for level in (0.05, LEVEL):
            assert judged.power(level=level) == pytest.approx(plan.power(RUNS, level), abs=0.05)
        assert abs(judged.power() - plan.power(2 * RUNS)) > 0.1  # the control


def test_the_verdict_states_both_levels():
    joins, breaks = overall_verdict([held_out()], "here", []).powers
    assert (joins.group, breaks.group) == ("joins", "breaks")
    assert joins.in_row == pytest.approx(power_of_runs([held_out()], "joins").power())
    assert 0 < joins.in_verdict < joins.in_row + 0.2  # of 50 simulated groups for each sign
    assert Power("joins", 0.2, 0.95, 0.56).sentence == (
        "joins off by 20 % with probability 95 % (p ≤ 0.01 in their row; 56 % by the verdict)"
    )
