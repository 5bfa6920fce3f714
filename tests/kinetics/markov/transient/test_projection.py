import numpy as np
import pytest
from known_systems import decay, line, network, switch
from numpy.testing import assert_allclose
from scipy.stats import binom, poisson

from kinetics import Network, Transient
from kinetics.markov.transient import FiniteStateProjection, projection
from kinetics.markov.transient.search import TooManyStatesError
from kinetics.markov.transient.uniformisation import DiscreteChain
from kinetics.native import twins


def births_and_deaths(birth, death):
    return network("X", {"birth": ((0,), (1,)), "death": ((1,), (0,))}, [birth, death])


def distance(law, t, exact):
    """Summed absolute error of the distribution of one species; what it leaves out counts."""
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


def test_refusals():
    with pytest.raises(TooManyStatesError, match=r"over 100 states matter: \d+ held all .* \(X \d+ to \d+\), and more"):
        FiniteStateProjection(max_states=100).solve(births_and_deaths(1000.0, 1.0), [0], [5.0])
    # It settles, but what rounds until then is more than the tolerance and more than 5e6 steps would round.
    with pytest.raises(
        ValueError, match=r"too stiff or too large for a projection: 0\.0008\d* of 1 took .* take 1e\+08 or more"
    ):
        FiniteStateProjection().solve(switch(1e8, 1e8), [1, 0], [1.0])
    # Births in proportion to the square: infinitely many in a finite time.
    explosion = network("X", {"birth": ((2,), (3,))}, [1.0])
    with pytest.raises(ValueError, match=r"states matter|too stiff"):
        FiniteStateProjection(max_states=2000).solve(explosion, [2], [5.0])


@pytest.fixture
def steps(monkeypatch):
    """How many steps the kernel makes, call by call."""
    done, advance = [], twins.advance
    monkeypatch.setattr(twins, "advance", lambda *arrays: (done.append(len(arrays[-1])), advance(*arrays)))
    return done


def leak(fast, slow):
    """A <-> B, and B -> C slowly."""
    reactions = {"ab": ((1, 0, 0), (0, 1, 0)), "ba": ((0, 1, 0), (1, 0, 0)), "bc": ((0, 1, 0), (0, 0, 1))}
    return network("ABC", reactions, [fast, fast, slow])


def test_too_many_steps_are_foretold(steps, monkeypatch):
    message = r"took 1\.\d+e\+05 steps on up to 3 states, and all would take 1e\+09 or more, about .* at most 5000000"
    with pytest.raises(ValueError, match=message):
        FiniteStateProjection().solve(leak(1e9, 1e-3), [1, 0, 0], [1.0])
    assert 32 < sum(steps) < 0.04 * projection.MAX_STEPS
    # The control: refused only once they are done.
    steps.clear()
    monkeypatch.setattr(projection, "MAX_STEPS", 500_000)
    monkeypatch.setattr(projection, "TRIAL", 1.0)
    with pytest.raises(ValueError, match="too stiff"):
        FiniteStateProjection().solve(leak(1e9, 1e-3), [1, 0, 0], [1.0])
    assert sum(steps) > 0.98 * projection.MAX_STEPS


def test_too_many_seconds_are_foretold():
    net = births_and_deaths(1000.0, 1.0)
    with pytest.raises(ValueError, match=r"of 5 took .* take .* at most .* max_seconds = 0\.01, .* ask for earlier"):
        FiniteStateProjection(max_seconds=0.01).solve(net, [1000], [5.0])
    assert FiniteStateProjection(max_seconds=60.0).solve(net, [1000], [0.01]).error < 1e-8
    with pytest.raises(ValueError, match="max_seconds = nan"):
        FiniteStateProjection(max_seconds=np.nan)


def test_rates_that_fall_are_not_held_against_it(steps, monkeypatch):
    # 5000 copies die out in some 1e4 steps; at the first rate it would be 5e8, and the trial is over after 2000.
    monkeypatch.setattr(projection, "TRIAL", 4e-4)
    law = FiniteStateProjection(1e-6).solve(decay(), [5000], [1.0, 1e5])
    assert distance(law, 0, binom(5000, np.exp(-1.0))) < law.error + 1e-12
    assert law.probability([0])[1] > 1 - 1e-6
    assert sum(steps) > 3000
    # The control: the same rate, and it lasts.
    with pytest.raises(ValueError, match="too stiff"):
        FiniteStateProjection(1e-6).solve(leak(5000.0, 1e-3), [1, 0, 0], [1e5])


@pytest.mark.parametrize("tolerance", [1e-6, 1e-9, 1e-12])
def test_a_settled_distribution_takes_no_more_steps(steps, tolerance):
    times = [0.5, 5.0, 40.0, 4e4]
    law = FiniteStateProjection(tolerance).solve(births_and_deaths(10.0, 1.0), [0], times)
    for t, time in enumerate(times):
        assert distance(law, t, poisson(10 * -np.expm1(-time))) < law.error
    assert law.error < tolerance + 1e-8
    assert sum(steps) < 0.05 * 20 * times[-1]  # at no rate below 20


@pytest.mark.parametrize(("tolerance", "rests"), [(1e-12, False), (1e-3, True)])
def test_what_only_seems_to_rest(steps, tolerance, rests):
    # The leak is far below the rounding of a step: taken for rest only where its whole is within the tolerance.
    law = FiniteStateProjection(tolerance).solve(leak(1e3, 1e-9), [1, 0, 0], [200.0])
    gone = -np.expm1(-0.5e-9 * 200.0)
    assert (sum(steps) < 1e5) == rests
    assert (law.error > gone) == rests
    assert abs(law.probability([0, 0, 1])[0] - gone) <= law.error < tolerance + 1e-9


def test_tolerances_near_rounding():
    # A + B <-> C in windows that may lose less than a sum rounds.
    net = network("ABC", {"bind": ((1, 1, 0), (0, 0, 1)), "free": ((0, 0, 1), (1, 1, 0))}, [0.1, 1.0])
    law = FiniteStateProjection(1e-13).solve(net, [100, 100, 0], [0.01, 1.0])
    exact = Transient().solve(net, [100, 100, 0], [0.01, 1.0])
    off = abs(law.marginal("C") - exact.marginal("C")[:, : law.marginal("C").shape[1]]).sum(axis=1)
    assert off.max() < law.error + exact.error < 1e-10


def test_a_time_at_the_end_of_a_window():
    # The first window: two states, rate 4, 32 steps.
    law = FiniteStateProjection().solve(decay(), [4], [8.0, 9.0])
    for t, time in enumerate(law.times):
        assert distance(law, t, binom(4, np.exp(-time))) < law.error


def test_roundings_of_an_exit_count_what_leads_out_of_the_set(monkeypatch):
    """An exit of a state at the edge of the set sums its leaks too, however few of its channels stay inside."""
    seen = []
    make = DiscreteChain.from_rates

    def noted(*arguments, **named):
        seen.append(make(*arguments, **named))
        return seen[-1]

    monkeypatch.setattr(DiscreteChain, "from_rates", noted)
    ways_out = {f"out{i}": ({}, {"A": i + 1}) for i in range(30)}
    network = Network.from_reactions(ways_out | {"back": ({"A": 1}, {})}, [0.1] * 30 + [1.0])
    FiniteStateProjection(1e-6).solve(network, {"A": 0}, [0.5])
    assert seen
    assert all(chain.terms >= len(network.channels) for chain in seen)
