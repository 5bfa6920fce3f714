"""What held-out runs can tell."""

import math

import numpy as np
import pytest
from known_systems import decay
from synthetic_runs import line_network

from calibration.estimating.exposure import count
from calibration.estimating.joins_and_breaks import joins_and_breaks
from calibration.planning.forecast import Forecast
from calibration.planning.held_out import MOST_RUNS, group_powers, runs_for, widest_sd
from calibration.validating.power import LEVEL, GroupPower
from kinetics.rates.breaks import Expansion, break_model
from kinetics.sampling import sample_path

RUNS, END, SHIFT = 8, 8.0, 0.3
SEEN = np.array([60.0, 50, 40, 60, 100, 50, 30, 40])  # events of a calibration


def known(network, draws=60):
    return Forecast(Expansion.of(network, break_model("first-order")), np.tile(network.known_rates, (draws, 1)), 2)


def test_a_system_in_closed_form():
    """Copies that decay on their own."""
    groups = {"all": np.array([True])}
    (found,) = group_powers(known(decay(), 400), [100], groups, [50], 0.7, 0.2)
    assert found.expected == pytest.approx(50 * (1 - math.exp(-0.7)), rel=0.02)
    assert found.rates_sd == pytest.approx(1 / math.sqrt(100.5))
    for factor, events in found.shifted:
        assert events == pytest.approx(50 * (1 - math.exp(-0.7 * factor)), rel=0.02)


@pytest.mark.parametrize("group", ["joins", "breaks"])
def test_power_is_the_share_of_studies_that_see_it(group):
    """Studies made by SSA under shifted rates, each with a calibration of its own."""
    network = line_network()
    start, groups = network.state({"monomer": 30}), joins_and_breaks(network)
    members = groups[group]
    (found,) = [each for each in group_powers(known(network), SEEN, groups, start, END, SHIFT) if each.group == group]
    rng, studies = np.random.default_rng(3), 4000
    factors = rng.gamma(SEEN + 0.5, 1 / (SEEN + 0.5), size=(studies, SEEN.size))
    limits = (0.0, math.inf)
    for true, events in ((1.0, found.expected), *found.shifted):
        shifted = network.with_rates(network.known_rates * np.where(members, true, 1.0))
        runs = [count(sample_path(shifted, start, END, seed=5, run=run)) for run in range(150)]
        picks = rng.integers(len(runs), size=(studies, RUNS))
        seen = np.array([run.events[members].sum() for run in runs])[picks].sum(axis=1)
        exposure = np.array([run.exposure * network.known_rates for run in runs])[picks].sum(axis=1)
        ratio = seen / (factors * exposure)[:, members].sum(axis=1)
        if true == 1.0:
            limits = np.quantile(ratio, [LEVEL / 2, 1 - LEVEL / 2])
            continue
        share = float(((ratio < limits[0]) | (ratio > limits[1])).mean())
        alone = GroupPower(group, found.expected, found.rates_sd, ((true, events),))
        assert alone.power(RUNS) == pytest.approx(share, abs=0.1)
        assert alone.power(2 * RUNS) > share + 0.02  # the control
        assert found.power(RUNS) <= alone.power(RUNS)


def test_more_runs_see_more_up_to_the_limit_that_the_calibration_sets():
    def of(events):
        return GroupPower("all", 30.0, 1 / math.sqrt(events), ((0.8, 25.0), (1.2, 34.0)))

    good, poor = of(5000), of(100)
    assert good.power(2) < good.power(10) < good.power(100) <= good.power(math.inf)
    assert good.power(math.inf) > 0.999
    runs = runs_for(good, 0.9)
    assert good.power(runs) >= 0.9 > good.power(runs - 1)
    assert poor.power(math.inf) < 0.5
    assert runs_for(poor, 0.9) is None
    assert poor.power(MOST_RUNS) == pytest.approx(poor.power(math.inf), abs=0.02)
    assert runs_for(GroupPower("never", 0.0, math.inf, ((0.8, 0.0),)), 0.9) is None
    widest = widest_sd(poor, 0.9)
    assert 1 / math.sqrt(5000) < widest < 1 / math.sqrt(100)
    assert GroupPower("all", 30.0, widest, poor.shifted).power(math.inf) == pytest.approx(0.9)
