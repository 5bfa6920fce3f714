"""What runs are expected to show."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from known_systems import decay
from synthetic_runs import line_network

from calibration.estimating.joins_and_breaks import joins_and_breaks
from calibration.planning.candidates import candidates, wanted_rates
from calibration.planning.forecast import Forecast, whole_bodies
from kinetics.markov.transient import Transient, solve
from kinetics.network import Tank
from kinetics.rates import Rates
from kinetics.rates.breaks import Expansion, break_model

SIZES = [1, 2, 3, 4]


def known(network, draws=400, seed=3):
    """A forecast of rates that are known, breaks of first order."""
    expansion = Expansion.of(network, break_model("first-order"))
    return Forecast(expansion, np.tile(network.known_rates, (draws, 1)), seed)


def test_events_run_out_with_the_reactants():
    (events,) = known(decay(), draws=2000).events([20], 3.0)
    assert events == pytest.approx(20 * (1 - np.exp(-3.0)), rel=0.02)
    assert events < 0.5 * 20 * 3.0  # the control: as many as at the start, all the time


def test_the_path_is_that_of_the_exact_solution():
    network = line_network()
    start, times = network.state({"monomer": 12}), [0.0, 5.0, 40.0]
    mean = solve(network, Transient(), start, times).mean()
    found = known(network, draws=1500).composition(start, times)
    assert np.abs(found - mean).max() < 0.15
    assert found[0].tolist() == start.tolist()


def test_uncertain_rates_are_drawn():
    network = decay()
    rates = Rates(
        convention={"combinations": "distinct"},
        channels={"decay": {"rate": 1.0, "ways": 1.0, "events": 2, "exposure": 2.0}},
    )
    forecast = Forecast.of(rates, network, draws=4000, seed=1)
    # the mean of exp(-k t) under Gamma(2.5, 2) is (1 + t / 2)^-2.5
    assert forecast.events([20], 1.0)[0] == pytest.approx(20 * (1 - 1.5**-2.5), rel=0.03)
    with pytest.raises(ValueError, match="do not state their tank"):
        Forecast.of(rates, network, Tank((2.0, 2.0, 3.0)))


@given(st.lists(st.integers(0, 30), min_size=4, max_size=4), st.integers(1, 50))
def test_whole_bodies_use_all_cubes(totals, runs):
    """Means over runs of equal numbers of cubes: made by moving whole bodies about."""
    n = sum(totals) + 4
    split = np.array([[n % 2, (n // 2), 0, 0], [n, 0, 0, 0], [n % 3, 0, n // 3, 0], [n % 4, 0, 0, n // 4]], float)
    share = np.array([total + 1 for total in totals]) / (sum(totals) + 4)
    mean = share @ split
    counts = whole_bodies(mean, SIZES)
    assert counts @ np.array(SIZES) == n
    assert (counts >= 0).all()
    assert (counts >= np.floor(mean)).all()
    assert runs * counts[0] >= 0


def test_whole_bodies_without_single_ones():
    with pytest.raises(ValueError, match="1 parts are left over, and no species is as small"):
        whole_bodies([1.5, 0.0], [2, 3])


def test_candidates_lie_on_the_path_and_differ():
    network = line_network()
    found = candidates(known(network, draws=50), [{"monomer": 24}, {"monomer": 12}], SIZES, [0.0, 1e-9, 30.0], 10.0)
    assert [tank.along for tank in found] == [0.0, 30.0, 0.0, 30.0]
    sizes = dict(zip(network.species, SIZES, strict=True))
    assert [sum(sizes[name] * n for name, n in tank.composition.items()) for tank in found] == [24, 24, 12, 12]
    assert found[0].composition == {"monomer": 24}


def test_what_is_wanted():
    network = line_network()
    joins = [name for name in network.channels if "+" in name.split("->")[0]]
    assert list(wanted_rates(network)) == [*joins, "breaks"]
    assert list(wanted_rates(network, each_break=True)) == list(network.channels)
    groups = joins_and_breaks(network)
    assert groups["joins"].sum() == groups["breaks"].sum() == 4
    assert (wanted_rates(network)["breaks"] == groups["breaks"]).all()
