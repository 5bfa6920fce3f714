import numpy as np
import pytest
from known_systems import decay, network, switch
from numpy.testing import assert_allclose, assert_array_equal
from scipy.stats import binom

from kinetics import first_passage
from kinetics.methods.rare import rare_event


def copies(states):
    return states[:, 0]


def births_and_deaths():
    return network("X", {"birth": ((0,), (1,)), "death": ((1,), (0,))}, [5.0, 1.0])


@pytest.mark.parametrize(("target", "chance"), [(15, 2.1e-3), (22, 2.4e-7)])
def test_against_the_exact_passage(target, chance):
    exact = float(first_passage(births_and_deaths(), [0], "X", target).cdf(4.0))
    assert_allclose(exact, chance, rtol=0.3)
    found = rare_event(births_and_deaths(), [0], copies, target, 4.0, runs=40_000, seed=1)
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
    assert found.levels[-1] == 0.0


def test_an_event_that_must_hurry_is_not_trusted():
    # Births alone, 1 expected: 14 of them. Whoever is late at one level is lost for all the next.
    net = network("X", {"birth": ((0,), (1,))}, [1.0])
    assert not rare_event(net, [0], copies, 14, 1.0, runs=2000, seed=2).is_trusted


def test_intervals_cover():
    exact = float(first_passage(births_and_deaths(), [0], "X", 16).cdf(3.0))
    covered = 0
    for seed in range(20):
        found = rare_event(births_and_deaths(), [0], copies, 16, 3.0, runs=1000, seed=seed)
        covered += found.low <= exact <= found.high
    # 11 or fewer of 20 at 95 % have a chance below 1e-6
    assert covered > 11


def test_common_and_certain_events():
    found = rare_event(decay(), [10], lambda states: -states[:, 0], -9.0, 1.0, runs=2000, seed=4)
    assert abs(found.probability - (1 - np.exp(-10.0))) < 4.9 * found.standard_error + 1e-3
    there = rare_event(decay(), [10], copies, 3, 1.0)
    assert (there.probability, there.low, there.high) == (1.0, 1.0, 1.0)


def test_seed():
    one, two = (rare_event(births_and_deaths(), [0], copies, 15, 2.0, runs=500, seed=5) for _ in range(2))
    assert one.probability == two.probability
    assert_array_equal(one.levels, two.levels)
    assert "levels of 500 runs (seed 5)" in str(one)


def test_untrusted_intervals_say_so():
    found = rare_event(births_and_deaths(), [0], copies, 25, 2.0, runs=200, seed=6)
    assert not found.is_trusted
    assert "scatter too widely" in str(found)


@pytest.mark.parametrize(
    ("level", "threshold", "message"),
    [
        (copies, 11, "no way to level 11: the pilot came to 10 and no further"),
        (lambda states: states, 5, r"level gives shape \(1, 2\) for one state"),
    ],
)
def test_refusals(level, threshold, message):
    with pytest.raises(ValueError, match=message):
        rare_event(switch(), [8, 2], level, threshold, 1.0, runs=1000)
