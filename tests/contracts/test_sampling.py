"""What every sampling method must do: those of `SAMPLING_METHODS`, so that a new one is tested by adding its line.

Statistical checks have a false-alarm rate of 1e-6 each and a fixed seed.
"""

from math import exp

import numpy as np
import pytest
from crowded_networks import LINE as CROWDED
from known_systems import assert_follows_cdf, assert_follows_table, bare_line, decay, line, network, switch
from numpy.testing import assert_array_equal
from sampled_networks import ENZYME, MIXED, PRODUCTS, THIRD_ORDER, ring
from scipy.linalg import expm
from scipy.stats import binom, poisson

from kinetics import Transient, first_passage
from kinetics.network import Model, Network
from kinetics.network.laws import Event, hill
from kinetics.network.predicates import Condition
from kinetics.runs import TruncatedRunsError
from kinetics.sampling import SAMPLING_METHODS
from kinetics.sampling.base import SamplingMethod
from kinetics.sampling.cost_model import NetworkSize

METHODS = [method() for method in SAMPLING_METHODS]
named = pytest.mark.parametrize("method", METHODS, ids=lambda method: method.name)

TURN = {"turn": ({"S": 1}, {"P": 1}), "back": ({"P": 1}, {"S": 1})}
HILL = Network.from_reactions(TURN, [hill("P", 5.0, 6.0, 3.0, basal=0.5), 0.3])
BIRTH_DEATH = {"birth": ({}, {"X": 1}), "death": ({"X": 1}, {})}
WAVE = Network.from_reactions(BIRTH_DEATH, ["20 * (1 + 0.8 * sin(t))", 0.7])
DOSED = Network.from_reactions(BIRTH_DEATH, [0.0, 1e-9], events=[Event("dose", "t >= 1", {"X": "X + 10"})])
ORDERED = network(("A", "B"), {"pair": ((2, 0), (0, 1)), "back": ((0, 1), (2, 0))}, [0.1, 1.0], "ordered")
QUICK_LINE = line().with_rates(50 * line().rate_constants)
SMALL = {
    "enzyme": (ENZYME, [3, 9, 0, 0], 1.5),
    "mixed": (MIXED.with_rates([0.2, 0.4, 0.15, 0.3, 0.2, 0.5]), [9, 1, 2], 0.6),
    "line of four": (QUICK_LINE, [8, 0, 0, 0], 20.0),
    "line in a crowd": (CROWDED, [8, 0, 0, 0], 3.0),
    "third order": (THIRD_ORDER, [11, 2], 2.0),
    "ordered pairs": (ORDERED, [13, 0], 0.25),
    "squares": (PRODUCTS, [13, 0], 0.25),
    "Hill": (HILL, [14, 0], 0.4),
}


def refused(method, net):
    """Whether the traits do not allow the network; then it must be refused with the method's name, and what to do."""
    if method.supports(net):
        return False
    with pytest.raises(ValueError, match=rf"the method '{method.name}' takes .*: use .*'auto'"):
        method.simulate(net, np.zeros(len(net.species), dtype=int), [1.0], runs=2)
    return True


def final_states(net, method, initial, end, runs, seed):
    return method.simulate(net, initial, [end], runs=runs, seed=seed).counts[:, 0]


def assert_joint_distribution(net, initial, end, states):
    exact = Transient().solve(net, initial, [end])
    observed = np.bincount(exact.space.index_of(states), minlength=len(exact.space))
    assert_follows_table(observed, exact.probabilities[0])


@named
def test_a_decay_is_binomial(method):
    counts = final_states(decay(1.0), method, [40], 1.0, 2000, seed=1)[:, 0]
    assert_follows_cdf(counts, binom(40, exp(-1.00)).cdf)
    with pytest.raises(AssertionError, match="the laws differ"):  # a tenth in the rate is seen
        assert_follows_cdf(counts, binom(40, exp(-1.10)).cdf)


@named
def test_ways_of_a_channel_multiply_its_rate(method):
    """1000 ways of a rate constant of 1/1000 are a rate of 1."""
    net = Network(("X",), ("death",), [[1]], [[-1]], [1000.0], [1e-3])
    assert_follows_cdf(final_states(net, method, [40], 1.0, 500, seed=2)[:, 0], binom(40, exp(-1.0)).cdf)


@named
@pytest.mark.parametrize("order", [3, 5, 17])
def test_one_set_of_like_reactants_meets_at_its_rate(method, order):
    net = network(("A", "B"), {"meet": ((order, 0), (0, 1))}, [0.5])
    if refused(method, net):
        return
    met = final_states(net, method, [order, 0], 2.0, 400, seed=29)[:, 1]
    assert_follows_cdf(met, binom(1, 1 - exp(-1.0)).cdf)


@named
def test_an_order_beyond_floats_is_refused_before_it_runs(method):
    for order in (171, 2**40):
        net = network(("A", "B"), {"meet": ((order, 0), (0, 1))}, [0.5])
        assert not method.supports(net)
        with pytest.raises(ValueError, match="channel 'meet'"):
            method.simulate(net, [5, 0], [1.0], runs=2)


@named
@pytest.mark.parametrize("case", SMALL)
def test_the_joint_distribution_solves_the_master_equation(method, case):
    net, initial, end = SMALL[case]
    if refused(method, net):
        return
    states = final_states(net, method, initial, end, 2000, seed=21)
    assert_joint_distribution(net, initial, end, states)
    with pytest.raises(AssertionError, match="chi-square"):  # all rates a third too large is seen
        assert_joint_distribution(net, initial, 4 / 3 * end, states)


@named
def test_walkers_on_a_ring_are_multinomial(method):
    """Walkers are independent: the counts of all places have the distribution of one walker."""
    n, walkers = 200, 300
    step = np.roll(np.eye(n), 1, axis=1)
    distribution = expm((2.0 * step + step.T - 3.0 * np.eye(n)) * 2.0)[0]
    initial = walkers * np.eye(1, n, dtype=int)[0]
    assert_follows_table(final_states(ring(n), method, initial, 2.0, 16, seed=23).sum(axis=0), distribution)


@named
def test_birth_from_nothing_and_death_are_poisson(method):
    net = network(("X",), {"birth": ((0,), (1,)), "death": ((1,), (0,))}, [10.0, 1.0])
    counts = final_states(net, method, [0], 6.0, 400, seed=26)[:, 0]
    assert_follows_cdf(counts, poisson(10 * (1 - exp(-6.0))).cdf)


@named
def test_slow_channels_when_the_quick_ones_have_ended(method):
    """All that is left lies far below the first propensities, and below the rounding of their sums."""
    net = network(("A", "B", "C"), {"quick": ((1, 0, 0), (0, 0, 0)), "slow": ((0, 1, 0), (0, 0, 1))}, [1e9, 1e-6])
    turned = final_states(net, method, [50, 40, 0], 1e6, 400, seed=25)
    assert_array_equal(turned[:, 0], 0)
    assert_follows_cdf(turned[:, 2], binom(40, 1 - exp(-1.0)).cdf)


@named
def test_rates_that_depend_on_time_give_their_poisson_distribution(method):
    if refused(method, WAVE):
        return
    fade = exp(-0.7 * 2)
    mean = 20 * ((1 - fade) / 0.7 + 0.8 * (0.7 * np.sin(2) - np.cos(2) + fade) / 1.49)
    counts = final_states(WAVE, method, [0], 2.0, 1500, seed=41)[:, 0]
    assert_follows_cdf(counts, poisson(mean).cdf)
    with pytest.raises(AssertionError, match="the laws differ"):  # birth at its mean rate
        assert_follows_cdf(counts, poisson(20 * (1 - fade) / 0.7).cdf)


@named
def test_events_happen_when_they_are_due(method):
    if refused(method, DOSED):
        return
    counts = method.simulate(DOSED, [3], [0.5, 2.0], runs=20, seed=5).counts
    assert_array_equal(counts[:, :, 0], [[3, 13]] * 20)


@named
@pytest.mark.parametrize("net", [QUICK_LINE, CROWDED, ring(40), WAVE], ids=["line", "crowd", "ring", "wave"])
def test_a_run_is_the_same_however_it_is_asked_for(method, net):
    """For any threads, grid, number of runs and first run; and as a path."""
    if refused(method, net):
        return
    initial = np.zeros(len(net.species), dtype=int)
    initial[0] = 100
    times, fine = np.linspace(0, 3.0, 7), np.linspace(0, 3.0, 97)
    whole = method.simulate(net, initial, times, runs=40, seed=27, threads=1).counts
    assert_array_equal(method.simulate(net, initial, times, runs=40, seed=27, threads=3).counts, whole)
    assert_array_equal(method.simulate(net, initial, times[2:5:2], runs=40, seed=27).counts, whole[:, 2:5:2])
    assert_array_equal(method.simulate(net, initial, times, runs=3, seed=27).counts, whole[:3])
    assert_array_equal(method.simulate(net, initial, times, runs=5, seed=27, first_run=30).counts, whole[30:35])
    finely = method.simulate(net, initial, fine, runs=40, seed=27).counts
    for run in (0, 39):
        path = method.sample_path(net, initial, 3.0, seed=27, run=run)  # itself refuses impossible events
        assert np.all(np.diff(path.times) > 0)
        assert_array_equal(path.at(times), whole[run])
        assert_array_equal(path.at(fine), finely[run])
    assert np.any(method.simulate(net, initial, times, runs=40, seed=28).counts != whole)


def first_held(condition, path):
    """When a condition first holds on a path; nan where it does not."""
    held = np.append(0.0, path.times)[condition.holds(path.states)]
    return held[0] if held.size else np.nan


CONDITIONS = {
    "line": (QUICK_LINE, 3.0, "quadmer >= 2"),
    "line, all joined": (QUICK_LINE, 3.0, "!(monomer / 4 + 0.5 * dimer > 9.5) & trimer != 1 | tetra >= 9"),
    "line, no sums": (QUICK_LINE, 3.0, "dimer * trimer >= 6 & max(dimer, tetra) > 3"),
    "line in a crowd": (CROWDED, 3.0, "quadmer >= 2"),
    "ring": (ring(40), 3.0, "tetra == 2"),
    "wave": (WAVE, 3.0, "X >= 12"),
    "events": (DOSED, 2.0, "X >= 13"),
}
SUMS = {"tetra": {"quadmer": 4, "trimer": 3}}


@named
@pytest.mark.parametrize("case", CONDITIONS)
def test_a_run_ends_where_a_condition_first_holds(method, case):
    """With the events until then of the run that goes on; runs in which it never holds are censored."""
    net, end, text = CONDITIONS[case]
    initial = np.zeros(len(net.species), dtype=int)
    initial[0] = 3 if net is DOSED else 40
    condition = Condition(text, Model(net, initial, SUMS if net is QUICK_LINE else {"tetra": {net.species[-1]: 1}}))
    if refused(method, net) or not method.takes_until:
        return
    found = method.first_times(net, initial, condition, end, runs=40, seed=27)
    again = method.first_times(net, initial, condition, end, runs=12, seed=27, threads=1, first_run=9)
    assert_array_equal(again.times, found.times[9:21])
    assert (found.observed[~found.is_reached] == end).all()
    assert_array_equal(condition.holds(found.counts), found.is_reached)
    if net.events:
        assert_array_equal(found.times, 1.0)
        return
    paths = [method.sample_path(net, initial, end, seed=27, run=run) for run in range(40)]
    assert_array_equal(found.times, [first_held(condition, path) for path in paths])
    assert found.is_reached.any()
    for run in (0, 39):
        ended = method.sample_path(net, initial, end, seed=27, run=run, until=condition)
        assert ended.end == found.observed[run]
        assert_array_equal(ended.times, paths[run].times[: ended.times.size])
        assert_array_equal(ended.states[-1], found.counts[run])


@named
def test_first_times_have_the_law_of_the_passage(method):
    net, initial = network(("A", "B"), {"pair": ((2, 0), (0, 1)), "back": ((0, 1), (2, 0))}, [0.1, 1.0]), [20, 0]
    if not method.takes_until:
        with pytest.raises(ValueError, match=rf"the method '{method.name}' does not support a condition .*"):
            method.first_times(net, initial, "B >= 6")
        return
    found = method.first_times(net, initial, "B >= 6", runs=4000, seed=11)
    assert found.censored == 0
    assert_follows_cdf(found.times, first_passage(net, initial, "B", 6).cdf)
    with pytest.raises(AssertionError, match="the laws differ"):  # a back rate a third too large is seen
        assert_follows_cdf(found.times, first_passage(net.with_rates([0.1, 4 / 3]), initial, "B", 6).cdf)


@named
def test_conditions_at_the_start_never_and_wrong_ones(method):
    if not method.takes_until:
        return
    there = method.first_times(decay(), [3], f"{decay().species[0]} >= 3", 5.0, runs=4)
    assert (there.times == 0).all()
    assert (there.counts == 3).all()
    never = method.first_times(decay(), [3], f"{decay().species[0]} >= 4", runs=4)
    assert (never.censored, never.mean, never.median) == (4, np.inf, np.inf)
    for wrong, message in (
        ("Z >= 1", "unknown name 'Z'"),
        ("1 + 1", "neither true nor false"),
        ("t > 3", "the time t"),
    ):
        with pytest.raises(ValueError, match=message):
            method.first_times(decay(), [3], wrong, 5.0)


@named
def test_what_is_conserved_stays(method):
    for net, initial, weights in ((QUICK_LINE, [40, 0, 0, 0], [1, 2, 3, 4]), (switch(), [12, 0], [1, 1])):
        counts = method.simulate(net, initial, [0.0, 1.0, 9.0], runs=50, seed=3).counts
        assert counts.min() >= 0
        assert_array_equal(counts[:, 0], [initial] * 50)
        assert_array_equal(counts @ weights, np.dot(initial, weights))


@named
def test_nothing_left_to_happen(method):
    counts = method.simulate(decay(), [3], [0.0, 1e3, 1e18], runs=50, seed=1).counts
    assert_array_equal(counts[:, 0], np.full((50, 1), 3))
    assert_array_equal(counts[:, 1:], 0)
    path = method.sample_path(decay(), [3], 1e18)
    assert path.times.size == 3
    assert path.end == 1e18
    empty = Network(("A",), (), [], [], [], [])
    assert_array_equal(method.simulate(empty, [4], [1.0], runs=20).counts, 4)
    # Partners that can never meet: their propensity may be 0 only up to rounding.
    lonely = method.simulate(ENZYME, [0, 5, 0, 0], [1e18], runs=20).counts
    assert_array_equal(lonely[:, 0], [[0, 0, 0, 5]] * 20)


@named
def test_stalled_clock_and_overflow_are_named(method):
    blow_up = network(("A",), {"burst": ((2,), (10**9,))}, [1.0])
    with pytest.raises(TruncatedRunsError, match="run 0: events came so fast that the clock could not advance"):
        method.simulate(blow_up, [2], [100.0], runs=30, seed=1)
    with pytest.raises(TruncatedRunsError, match="run 4"):
        method.sample_path(blow_up, [2], 100.0, seed=1, run=4)
    growing = network(("A", "B"), {"jump": ((1, 0), (1, 2**62))}, [1.0])
    with pytest.raises(ValueError, match="run 0: a count exceeded"):
        method.simulate(growing, [1, 0], [1e3], runs=30)
    steep = network(("A",), {"one": ((1,), (0,))}, [1e300])
    with pytest.raises(ValueError, match="or a propensity exceeded 1e308"):
        method.simulate(steep, [10**15], [1.0], runs=30)


@named
def test_bad_input_is_refused(method):
    good = {"network": line(), "initial": [60, 0, 0, 0], "times": [1.0]}
    for change, message in (
        ({"runs": 0}, "runs = 0; expected a whole number of at least 1"),
        ({"runs": 2.5}, "runs = 2.5"),
        ({"runs": True}, "runs = True"),
        ({"runs": 10**10}, "at 1 times would take .* GB of memory.*simulate_statistics"),
        ({"threads": 0}, "threads = 0"),
        ({"seed": -1}, "seed = -1"),
        ({"seed": "one"}, "seed = 'one'"),
        ({"first_run": -1}, "first_run = -1"),
        ({"times": []}, "times is empty"),
        ({"times": [2.0, 1.0]}, "times must rise"),
        ({"times": [-1.0]}, "times holds -1.0"),
        ({"times": [np.nan]}, "times holds nan"),
        ({"times": [np.inf]}, "times holds inf"),
        ({"initial": [1, 0, 0]}, "state has shape"),
        ({"initial": [1.5, 0, 0, 0]}, "whole numbers"),
        ({"initial": [-1, 0, 0, 0]}, "at least 0"),
        ({"network": bare_line()}, "no rate constants"),
    ):
        with pytest.raises(ValueError, match=message):
            method.simulate(**(good | change))
    for end in (-1.0, np.nan, np.inf):
        with pytest.raises(ValueError, match="times holds"):
            method.sample_path(line(), [60, 0, 0, 0], end)


@named
def test_limits_are_where_the_traits_say(method):
    """A network at a limit is taken, and one beyond it is refused with both numbers."""
    size, net = NetworkSize(1, 1, 1, 1.0, 1), decay()
    for trait, field in (("max_species", "n_species"), ("max_channels", "n_channels")):
        most = getattr(method, trait)
        if most < np.inf:
            at, beyond = (NetworkSize(**(vars(size) | {field: most + more})) for more in (0, 1))
            assert method.unsupported_reason(net, at) == ""
            assert (
                f"has {most + 1} {field[2:]}; the method {method.name!r} takes at most {most}"
                in method.unsupported_reason(net, beyond)
            )
    assert method.supports(THIRD_ORDER) == (method.most_reactants >= 3)


@named
def test_costs_are_numbers(method):
    costs = [method.cost(NetworkSize(n, n, 2, 4.0, n)) for n in (1, 10, 100, 1000)]
    assert costs == sorted(costs)
    assert costs[0] > 0


@named
def test_an_interrupt_ends_all_threads(method, monkeypatch):
    """Ctrl-C in one piece of the runs: no piece that has not begun is made."""
    made, prepared = [], type(method).prepared

    class Interrupted:
        def __init__(self, sampler):
            self.sampler = sampler

        def ensemble(self, initial, grid, key, first_run, out, watch):
            made.append(first_run)
            if first_run == 0:
                raise KeyboardInterrupt
            self.sampler.ensemble(initial, grid, key, first_run, out, watch)

    monkeypatch.setattr(type(method), "prepared", lambda self, net: Interrupted(prepared(self, net)))
    with pytest.raises(KeyboardInterrupt):
        method.simulate(decay(), [1], [1e-9], runs=20_000, threads=1)
    assert made == [0]
    with pytest.raises(KeyboardInterrupt):
        method.simulate(decay(), [1], [1e-9], runs=4_000, threads=2)


def test_names_are_unique_and_each_is_a_sampling_method():
    assert len({method.name for method in METHODS}) == len(METHODS)
    assert all(issubclass(method, SamplingMethod) for method in SAMPLING_METHODS)
