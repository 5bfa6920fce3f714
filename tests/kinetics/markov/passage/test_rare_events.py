import numpy as np
import pytest
from known_systems import decay, network, switch
from numpy.testing import assert_allclose, assert_array_equal
from scipy.stats import binom, poisson
from verified_networks import enzyme, trimers

from kinetics import first_passage
from kinetics.markov.passage import RareEvent, rare_event


def copies(states):
    return states[:, 0]


def births_and_deaths():
    return network("X", {"birth": ((0,), (1,)), "death": ((1,), (0,))}, [5.0, 1.0])


def births():
    return network("X", {"birth": ((0,), (1,))}, [1.0])


@pytest.mark.parametrize(("target", "time", "chance"), [(15, 4.0, 2.1e-3), (22, 4.0, 2.4e-7), (16, 0.5, 5.8e-10)])
def test_against_the_exact_passage(target, time, chance):
    exact = float(first_passage(births_and_deaths(), [0], "X", target).cdf(time))
    assert_allclose(exact, chance, rtol=0.3)
    found = rare_event(births_and_deaths(), [0], copies, target, time, runs=12_000, seed=1)
    assert found.is_trusted
    assert found.low < found.probability < found.high
    # Student's law with 19 degrees of freedom leaves 1e-6 beyond 7.3
    assert abs(found.probability - exact) < 7.3 * found.standard_error < exact


def test_an_event_downwards():
    # All 6 gone from A by 1 tu at rate 0.5.
    net = network("AB", {"turn": ((1, 0), (0, 1))}, [0.5])
    found = rare_event(net, [6, 0], lambda states: -states[:, 0], 0.0, 1.0, runs=20_000, seed=3)
    exact = binom(6, 1 - np.exp(-0.5)).pmf(6)
    assert abs(found.probability - exact) < 7.3 * found.standard_error < exact
    assert found.chances[-1] == 1.0


def test_an_event_that_must_hurry():
    # Births alone, 1 expected: 14 of them. Whoever is late must be further to go on.
    exact = poisson(1.0).sf(13)
    found = rare_event(births(), [0], copies, 14, 1.0, runs=20_000, seed=2)
    assert found.is_trusted
    assert exact == pytest.approx(4.5e-12, rel=0.01, abs=0.0)
    assert abs(found.probability - exact) < 7.3 * found.standard_error < exact


def estimates(net, start, level, threshold, time, runs, seeds):
    return [rare_event(net, start, level, threshold, time, runs=runs, seed=seed) for seed in range(seeds)]


def covering(found, exact):
    """How many of the intervals hold the exact chance, and how many of the estimates are trusted."""
    return sum(one.low <= exact <= one.high for one in found), sum(one.is_trusted for one in found)


def test_intervals_cover():
    exact = poisson(1.0).sf(8)
    found = estimates(births(), [0], copies, 9, 1.0, 8000, 20)
    covered, trusted = covering(found, exact)
    # 11 or fewer of 20 at 95 % have a chance below 1e-6
    assert covered > 11
    assert trusted > 10
    assert covering(found, 1.5 * exact)[0] <= 11  # the control: another chance is not covered


def by_product(states):
    """Products, and a complex as half of one; nine products are the event."""
    return np.where(states[:, 3] >= 9, 10.0, states[:, 3] + 0.5 * states[:, 2])


HARD = {
    "1e-7": (births_and_deaths(), [0], copies, 22, 4.0, ("X", 22), 10_000),
    "6e-10": (births_and_deaths(), [0], copies, 16, 0.5, ("X", 16), 40_000),
    "5e-12": (births(), [0], copies, 14, 1.0, ("X", 14), 40_000),
    "enzyme": (enzyme(), [3, 12, 0, 0], by_product, 10.0, 1.0, ("P", 9), 40_000),
    # The level does not tell how many monomers are left, so this one needs more runs.
    "trimers": (trimers(), [14, 0, 0], lambda states: states[:, 1], 4, 0.02, ("B", 4), 160_000),
}


@pytest.mark.validate
@pytest.mark.parametrize("name", HARD)
def test_intervals_cover_down_to_1e_12(name):
    net, start, level, threshold, time, (species, count), runs = HARD[name]
    exact = float(first_passage(net, start, species, count).cdf(time))
    covered, trusted = covering(estimates(net, start, level, threshold, time, runs, 40), exact)
    # 27 or fewer of 40 at 95 % have a chance below 1e-7
    assert covered > 27
    assert trusted > 20


def test_a_hidden_way_keeps_the_lower_limit():
    # Switched on, by a rate of 1e-9, 20 births are common; without, they are far rarer still than 1e-9. Nobody is
    # switched on in the pilot or in the replicates: `low` holds, `high` need not.
    net = network(
        ("off", "on", "X"),
        {
            "switch": ((1, 0, 0), (0, 1, 0)),
            "slow": ((1, 0, 0), (1, 0, 1)),
            "fast": ((0, 1, 0), (0, 1, 1)),
        },
        [1e-9, 1.0, 100.0],
    )
    found = rare_event(net, [1, 0, 0], lambda states: states[:, 2], 20, 1.0, runs=4000, seed=7)
    assert found.low < 0.8e-9


def test_common_and_certain_events():
    found = rare_event(decay(), [10], lambda states: -states[:, 0], -9.0, 1.0, runs=2000, seed=4)
    assert abs(found.probability - (1 - np.exp(-10.0))) < 4.9 * found.standard_error + 1e-3
    there = rare_event(decay(), [10], copies, 3, 1.0)
    assert (there.probability, there.low, there.high) == (1.0, 1.0, 1.0)


def test_seed():
    one, two = (rare_event(births_and_deaths(), [0], copies, 8, 2.0, runs=500, seed=5) for _ in range(2))
    assert one.probability == two.probability
    assert_array_equal(one.chances, two.chances)
    assert "stages of 500 runs (seed 5)" in str(one)


def test_untrusted_intervals_are_lower_limits():
    exact = float(first_passage(births_and_deaths(), [0], "X", 25).cdf(2.0))
    found = rare_event(births_and_deaths(), [0], copies, 25, 2.0, runs=200, seed=6)
    assert not found.is_trusted
    assert found.low == pytest.approx(0.05 * found.probability, rel=1e-12, abs=0.0)
    assert found.low < exact < found.high == 1.0
    assert "scatter too widely" in str(found)


def test_none_found_is_not_never():
    nothing = RareEvent(0.0, 0.0, 0.0, 1.0, (1.0,), 200, 0)
    assert not nothing.is_trusted
    assert rare_event(births(), [0], copies, 2, 0.0).high == 0.0  # in no time nothing happens


@pytest.mark.parametrize(
    ("level", "threshold", "message"),
    [
        (copies, 11, "the event was not reached: the pilot runs got to level 10"),
        (lambda states: states, 5, r"level gives shape \(1, 2\) for one state"),
    ],
)
def test_refusals(level, threshold, message):
    with pytest.raises(ValueError, match=message):
        rare_event(switch(), [8, 2], level, threshold, 1.0, runs=1000)
