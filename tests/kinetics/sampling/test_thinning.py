"""Exact runs under laws beyond mass action: closed forms, the master equation, the direct method, and mutants."""

import numpy as np
import pytest
from known_systems import assert_follows_cdf, assert_follows_table, line
from numpy.testing import assert_array_equal
from sampled_networks import MIXED, PRODUCTS, THIRD_ORDER, ring
from scipy.stats import binom, nbinom, poisson

from kinetics import Direct, Transient, sample_path, verify
from kinetics.kernels import general, outcomes
from kinetics.network import Network
from kinetics.network.laws import hill, hill_repression, michaelis_menten, periodic, steps_in_count, steps_in_time
from kinetics.runs import TruncatedRunsError
from kinetics.sampling import General
from kinetics.sampling.base import stream_key
from kinetics.sampling.watch import Watch
from tests.kinetics.sampling.test_ssa_methods import plain_python

BIRTH_DEATH = {"birth": ({}, {"X": 1}), "death": ({"X": 1}, {})}
DECAY = {"death": ({"X": 1}, {})}
BORN, DEAD = 20.0, 0.7
PULSED = Network.from_reactions(BIRTH_DEATH, ["20 * (1 + 0.8 * sin(t))", DEAD])


def pulsed_mean(t):
    """Mean of the Poisson law of X, from 0: the integral of birth(s) exp(-0.7 (t - s))."""
    fade = np.exp(-DEAD * t)
    wave = (DEAD * np.sin(t) - np.cos(t) + fade) / (1 + DEAD**2)
    return BORN * ((1 - fade) / DEAD + 0.8 * wave)


def test_birth_at_a_changing_rate_is_poisson():
    times = [0.5, 2.0, 5.0, 11.0]
    counts = General().simulate(PULSED, [0], times, runs=6000, seed=41).counts[:, :, 0]
    for t, here in zip(times, counts.T, strict=True):
        assert_follows_cdf(here, poisson(pulsed_mean(t)).cdf)
    with pytest.raises(AssertionError, match="the laws differ"):  # birth at its mean rate
        assert_follows_cdf(counts[:, 1], poisson(BORN / DEAD * (1 - np.exp(-2 * DEAD))).cdf)


# Rates whose integral from 0 to T is known: text, T, integral.
INHOMOGENEOUS = [
    ("(1 + sin(2 * pi * t)) * X", 1.25, 1.25 + 1 / (2 * np.pi)),
    ("2 * t * X", 0.9, 0.81),
    ("exp(-t) * X", 3.0, 1 - np.exp(-3.0)),
    ("piecewise(0, t < 10, 5, t < 10.2, 0) * X", 20.0, 1.0),
    ("X / (1 + t)", 2.0, np.log(3.0)),
    (steps_in_time([1.0, 2.0], [0.1, 3.0, 0.5], {"X": 1}), 1.4, 0.1 + 1.2),
    (periodic(0.7, 1.0, 4.0, {"X": 1}, peak=1.0), 2.0, 1.4 + 0.7 * 4 / np.pi),
    ("X * (t % 1)", 2.5, 1.125),
]


@pytest.mark.parametrize(("law", "end", "integral"), INHOMOGENEOUS, ids=[str(law) for law, *_ in INHOMOGENEOUS])
def test_decay_at_a_changing_rate_is_binomial(law, end, integral):
    net = Network.from_reactions(DECAY, [law])
    counts = General().simulate(net, [40], [end], runs=3000, seed=42).counts[:, 0, 0]
    assert_follows_cdf(counts, binom(40, np.exp(-integral)).cdf)
    with pytest.raises(AssertionError, match="the laws differ"):
        assert_follows_cdf(counts, binom(40, np.exp(-1.15 * integral)).cdf)


def test_waits_are_exponential_in_the_integrated_rate():
    """Event times of a birth process, through the integral of the rate, are a Poisson process of rate 1."""
    net = Network.from_reactions({"birth": ({}, {"X": 1})}, ["50 * (1 + 0.9 * sin(3 * t))"])
    path = sample_path(net, [0], 60.0, seed=43)
    clock = 50 * (path.times + 0.3 * (1 - np.cos(3 * path.times)))
    assert_follows_cdf(np.diff(clock), lambda x: 1 - np.exp(-x))
    with pytest.raises(AssertionError, match="the laws differ"):
        assert_follows_cdf(np.diff(50 * path.times), lambda x: 1 - np.exp(-x))


# Laws without time: the master equation, and the direct method.

TURN = {"turn": ({"S": 1}, {"P": 1}), "back": ({"P": 1}, {"S": 1})}
STATIC = [
    ("Michaelis-Menten", TURN, [michaelis_menten("S", 6.0, 4.0), 0.2], [15, 0]),
    ("Hill", TURN, [hill("P", 5.0, 6.0, 3.0, basal=0.5), 0.3], [14, 0]),
    ("repression", TURN, [0.8, hill_repression("S", 3.0, 5.0, 2.0)], [4, 9]),
    ("steps", TURN, [steps_in_count("S", [4, 9], [0.5, 4.0, 1.0]), "0.3 * P"], [13, 0]),
    ("constant", TURN, ["3.0", "1.5"], [9, 1]),
]


SLOW = ("Hill", "repression", "steps")


@pytest.mark.parametrize(
    ("reactions", "rates", "initial"),
    [pytest.param(*c[1:], id=c[0], marks=[pytest.mark.validate] * (c[0] in SLOW)) for c in STATIC],
)
def test_laws_without_time_follow_the_master_equation(reactions, rates, initial):
    net = Network.from_reactions(reactions, rates)
    assert verify(net, General(), initial, [0.4, 2.5], runs=5000, seed=44).passed


def test_verification_sees_a_wrong_law():
    net = Network.from_reactions(TURN, [michaelis_menten("S", 6.0, 4.0), 0.2])
    other = Network.from_reactions(TURN, [michaelis_menten("S", 6.5, 4.0), 0.2])
    counts = General().simulate(other, [15, 0], [0.4, 2.5], runs=5000, seed=44).counts[:, 1]
    exact = Transient().solve(net, [15, 0], [2.5])
    observed = np.bincount(exact.space.index_of(counts), minlength=len(exact.space))
    with pytest.raises(AssertionError, match="chi-square"):
        assert_follows_table(observed, exact.probabilities[0])


SCHLOEGL = {
    "up": ({"X": 2}, {"X": 3}),
    "down": ({"X": 3}, {"X": 2}),
    "feed": ({}, {"X": 1}),
    "leak": ({"X": 1}, {}),
}


def test_mass_action_written_as_expressions_gives_the_same_runs_to_the_last_bit():
    rates = [0.06, 2e-4, 200.0, 3.5]
    texts = ["0.03 * X * (X - 1)", "2e-4 / 6 * X * (X - 1) * (X - 2)", "200", "3.5 * X"]
    plain, written = (Network.from_reactions(SCHLOEGL, given) for given in (rates, texts))
    one, other = (sample_path(net, [250], 2.0, seed=45) for net in (plain, written))
    assert one.times.size > 2000
    assert_array_equal(one.times, other.times)
    assert_array_equal(one.channels, other.channels)
    again = written.with_rates([2.0, 1.0, 1.0, 1.0])
    assert_array_equal(again.propensities([250]), written.propensities([250]) * [2, 1, 1, 1])


@pytest.mark.parametrize(
    ("net", "initial"),
    [(line(), [50, 0, 0, 0]), (ring(33), 33 * [4]), (MIXED, [20, 3, 5]), (THIRD_ORDER, [20, 4]), (PRODUCTS, [21, 0])],
    ids=["line", "ring", "mixed", "third order", "products"],
)
def test_mass_action_gets_the_runs_of_the_direct_method(net, initial):
    counts = [method.simulate(net, initial, [1.0, 8.0], runs=40, seed=46).counts for method in (General(), Direct())]
    assert_array_equal(*counts)


BOTH = Network.from_reactions(
    {**BIRTH_DEATH, "pair": ({"X": 2}, {"Y": 1}), "part": ({"Y": 1}, {"X": 2})},
    ["30 * (1 + cos(t))", "(0.5 + 0.5 * sin(7 * t)) * X", "0.05 * X * (X - 1) * exp(-t)", 0.4],
)


def test_long_quiet_times_cost_nothing_and_are_not_slept_through():
    """A pulse of 0.1 tu at a million tu, and none before: windows grow, and the bound sees it."""
    net = Network.from_reactions(DECAY, ["piecewise(0, t < 1e6, 5, t < 1e6 + 0.1, 0) * X"])
    counts = General().simulate(net, [40], [1e6, 2e6], runs=1000, seed=48).counts[:, :, 0]
    assert_array_equal(counts[:, 0], 40)
    assert_follows_cdf(counts[:, 1], binom(40, np.exp(-0.5)).cdf)


@pytest.mark.parametrize(
    ("law", "message"),
    [
        ("X / 1000 / (2 - t)", r"channel 'death', X / .*, has no finite bound right after t = (1\.99|2)"),
        (
            "X * (1 - t)",
            r"X \* \(1 - t\), is -.* at X = \d+, Y = \d+, t = 1\.\d+ tu; expected a finite number of at least 0",
        ),
        ("X / t", r"X / t, is inf at X = 40, Y = 0, t = 0 tu"),
        ("X * t / t", "is nan at X = 40, Y = 0, t = 0 tu"),
        ("log(t - 3)", "is nan at X = 40, Y = 0, t = 0 tu"),
        ("piecewise(X, X > 35, -1)", "is -1 at X = 35, Y"),
    ],
)
def test_laws_that_are_none_are_refused_with_channel_state_and_time(law, message):
    net = Network.from_reactions({**DECAY, "other": ({}, {"Y": 1})}, [law, 20.0])
    with pytest.raises(ValueError, match=message):
        General().simulate(net, {"X": 40}, [3.0], runs=2, seed=1)


def test_stalled_clock_and_overflow_are_named():
    burst = {"burst": ({"A": 2}, {"A": 10**9})}
    with pytest.raises(TruncatedRunsError, match="run 0: events came so fast"):
        General().simulate(Network.from_reactions(burst, ["A * A * (2 + sin(t))"]), [2], [100.0], runs=2)
    growing = Network.from_reactions({"jump": ({"A": 1}, {"A": 1, "B": 2**62})}, ["A * (2 + sin(t))"])
    with pytest.raises(ValueError, match="run 0: a count exceeded"):
        General().simulate(growing, [1, 0], [1e3], runs=2)
    with pytest.raises(ValueError, match="or a propensity exceeded 1e308"):
        General().simulate(Network.from_reactions(DECAY, [1e300]), [10**15], [1.0], runs=2)


# Mutants: the kernel's own text with one error put in, run as plain Python.

GUARD = ("if total > bound:", "if False:")
MUTANTS = [
    ("a bound a fifth too small", [("max(highs[r], 0.0)", "0.8 * max(highs[r], 0.0)"), GUARD]),
    ("no thinning", [("if is_timed and target >= total:", "target *= total / bound\n        if False:"), GUARD]),
    ("a redraw at the window's end too late", [("t = moment\n", "t = later\n"), GUARD]),
    ("a stale bound", [("elif model.is_reopening[chosen]:", "elif False:"), GUARD]),
    ("a stale law", [("values(model.programs, readers, first, last, counts, t, work.stack, results)", "pass")]),
]


def mutant_counts(net, changes, initial, end, runs):
    kernel = plain_python(general, *changes)
    sampler = General().sampler(net)
    sampler.advance = lambda work, *rest: kernel.advance(sampler.model, work, *rest)
    out = np.empty((runs, 1, len(net.species)), dtype=np.int64)
    watch = Watch(np.array([end]))
    sampler.ensemble(net.state(initial), watch.grid, stream_key(49), 0, out, watch)
    assert watch.n_times == 1, f"the laws differ: outcome {next(iter(watch.stops.values())).outcome}"
    return out[:, 0, 0]


def all_laws(changes):
    """Birth and death at changing rates, a decay, and growth, under a mutant."""
    counts = mutant_counts(PULSED, changes, [0], 1.5, 150)
    assert_follows_cdf(counts, poisson(pulsed_mean(1.5)).cdf)
    net = Network.from_reactions(BIRTH_DEATH, ["0", "piecewise(X / 2, t < 1, 3 * X)"])
    counts = mutant_counts(net, changes, [30], 1.4, 250)
    assert_follows_cdf(counts, binom(30, np.exp(-1.7)).cdf)
    growth = {"X * (1 + sin(60 * t))": 1.2 + (1 - np.cos(72.0)) / 60, "X * piecewise(1, t < 50, 2)": 1.2}
    for law, integral in growth.items():
        counts = mutant_counts(Network.from_reactions({"grow": ({"X": 1}, {"X": 2})}, [law]), changes, [5], 1.2, 400)
        yule = nbinom(5, np.exp(-integral))
        assert_follows_cdf(counts, lambda x, yule=yule: yule.cdf(x - 5))


@pytest.mark.parametrize("changes", [changes for _, changes in MUTANTS], ids=[name for name, _ in MUTANTS])
def test_mutants_are_caught(changes):
    with pytest.raises(AssertionError, match="the laws differ"):
        all_laws(changes)


def test_without_a_mutation_all_is_well():
    all_laws([])


def test_a_broken_bound_is_told():
    with pytest.raises(AssertionError, match=f"outcome {outcomes.BROKEN_BOUND}"):
        all_laws(MUTANTS[0][1][:1])
