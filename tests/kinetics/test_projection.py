import numpy as np
import pytest
from known_systems import bare_line, decay, line, network, switch
from numpy.testing import assert_allclose
from scipy.stats import binom, poisson

from kinetics import Transient
from kinetics.methods.projection import FiniteStateProjection
from kinetics.states import TooManyStatesError


def births_and_deaths(birth, death):
    return network("X", {"birth": ((0,), (1,)), "death": ((1,), (0,))}, [birth, death])


def distance(law, t, exact):
    """Summed absolute error of a law of one species; what the law leaves out counts."""
    found = law.marginal("X")[t]
    kept = np.arange(found.size)
    return abs(found - exact.pmf(kept)).sum() + exact.sf(kept[-1])


@pytest.mark.parametrize("tolerance", [1e-3, 1e-9, 1e-12])
def test_births_and_deaths_are_poisson(tolerance):
    times = np.array([0.0, 0.3, 2.0, 40.0])
    law = FiniteStateProjection(tolerance).solve(births_and_deaths(10.0, 1.0), [0], times)
    assert_allclose(law.marginal("X")[0, 0], 1.0)
    for t in (1, 2, 3):
        exact = poisson(10 * (1 - np.exp(-times[t])))
        assert distance(law, t, exact) < law.error + 1e-14 < tolerance + 1e-11
    low, high = law.mean_bounds()
    assert low[3, 0] < 10.0 < high[3, 0]
    assert len(law.space) < 60


@pytest.mark.parametrize("start", [1, 3])
def test_yule_process_is_negative_binomial(start):
    from scipy.stats import nbinom

    net = network("X", {"birth": ((1,), (2,))}, [1.0])
    law = FiniteStateProjection(1e-8).solve(net, [start], [0.5, 3.0])
    for t, time in enumerate(law.times):
        found = law.marginal("X")[t]
        exact = nbinom(start, np.exp(-time)).pmf(np.arange(found.size) - start)
        assert abs(found - exact).sum() + (1 - exact.sum()) < law.error + 1e-12 < 1.1e-8


def test_a_closed_space():
    times = np.linspace(0.0, 2000.0, 21)
    law = FiniteStateProjection(1e-10).solve(line(), [40, 0, 0, 0], times)
    exact = Transient().solve(line(), [40, 0, 0, 0], times)
    rows = exact.space.index_of(law.space.states)
    assert rows.min() >= 0
    everything = np.zeros_like(exact.probabilities)
    everything[:, rows] = law.probabilities
    assert abs(everything - exact.probabilities).sum(axis=1).max() < law.error + exact.error < 1.1e-10


def test_the_states_move_along():
    # 2000 copies die out; at no time are more than some hundred counts likely.
    law = FiniteStateProjection(1e-9, max_states=2001).solve(decay(), [2000], [0.7])
    assert distance(law, 0, binom(2000, np.exp(-0.7))) < law.error + 1e-12
    assert len(law.space) < 700


def test_bottlenecks_stay():
    # B never holds more than 1e-6 of the probability, and all of it goes through.
    reactions = {"in": ((1, 0, 0), (0, 1, 0)), "through": ((0, 1, 0), (0, 0, 1))}
    net = network("ABC", reactions, [1.0, 1e6])
    law = FiniteStateProjection(1e-4).solve(net, [1, 0, 0], [2.0])
    assert_allclose(law.mean()[0, 2], 1 - np.exp(-2.0), atol=law.error)
    assert law.error < 1.01e-4


def test_several_species_without_end():
    # Two independent births and deaths: a product of Poisson laws.
    reactions = {
        "a": ((0, 0), (1, 0)),
        "a gone": ((1, 0), (0, 0)),
        "b": ((0, 0), (0, 1)),
        "b gone": ((0, 1), (0, 0)),
    }
    law = FiniteStateProjection(1e-7).solve(network("AB", reactions, [5.0, 1.0, 6.0, 2.0]), [0, 0], [1.5])
    a, b = law.space.states.T
    exact = poisson(5 * (1 - np.exp(-1.5))).pmf(a) * poisson(3 * (1 - np.exp(-3.0))).pmf(b)
    assert abs(law.probabilities[0] - exact).sum() + 1 - exact.sum() < law.error + 1e-12 < 1.1e-7


def test_nothing_happens():
    law = FiniteStateProjection().solve(decay(), [0], [1.0, 5.0])
    assert_allclose(law.probabilities, [[1.0], [1.0]])


def test_refusals():
    with pytest.raises(
        TooManyStatesError, match=r"over 100 states matter: \d+ held all .* tu \(X \d+ to \d+\), and more"
    ):
        FiniteStateProjection(max_states=100).solve(births_and_deaths(1000.0, 1.0), [0], [5.0])
    with pytest.raises(ValueError, match=r"too stiff for a projection: over 5000000 steps, and only .* of 1 tu done"):
        FiniteStateProjection().solve(switch(1e8, 1e8), [1, 0], [1.0])
    # Births in proportion to the square: infinitely many in a finite time.
    explosion = network("X", {"birth": ((2,), (3,))}, [1.0])
    with pytest.raises(ValueError, match=r"states matter|too stiff"):
        FiniteStateProjection(max_states=2000).solve(explosion, [2], [5.0])


@pytest.mark.parametrize("tolerance", [0.0, 1e-15, np.nan, 1.0])
def test_bad_tolerance(tolerance):
    with pytest.raises(ValueError, match="tolerance ="):
        FiniteStateProjection(tolerance)


def test_bad_input():
    with pytest.raises(ValueError, match="no rate constants"):
        FiniteStateProjection().solve(bare_line(), [4, 0, 0, 0], [1.0])
    with pytest.raises(ValueError, match="times is empty"):
        FiniteStateProjection().solve(line(), [4, 0, 0, 0], [])
