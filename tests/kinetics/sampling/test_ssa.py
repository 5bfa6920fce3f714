from itertools import count
from math import comb, exp, log

import numpy as np
import pytest
from known_systems import (
    assert_follows_cdf,
    assert_follows_table,
    bare_line,
    decay,
    line,
    network,
)
from numpy.testing import assert_allclose, assert_array_equal
from scipy.stats import binom, expon, nbinom

from kinetics import Transient, sample_path, simulate
from kinetics.kernels import ssa
from kinetics.network import Network
from kinetics.sampling import SAMPLING_METHODS, Direct
from kinetics.sampling.base import StalledClockError, stream_key
from kinetics.sampling.mass_action import mass_action

TIMES = [0.0, 50.0, 500.0, 2000.0]


@pytest.mark.parametrize("method", [method() for method in SAMPLING_METHODS])
def test_decay_is_binomial(method):
    counts = simulate(decay(1.0), method, [100], [1.0], runs=10_000, seed=1).counts[:, 0, 0]
    assert_follows_cdf(counts, binom(100, exp(-1.00)).cdf)
    with pytest.raises(AssertionError):  # a 3 % error in the rate is seen
        assert_follows_cdf(counts, binom(100, exp(-1.03)).cdf)


@pytest.mark.parametrize("combinations", ["distinct", "ordered", "product"])
@pytest.mark.parametrize("method", [method() for method in SAMPLING_METHODS])
def test_joint_law_of_the_line(method, combinations):
    def model(how):
        net = line()
        return Network(
            net.species, net.channels, net.reactants, net.stoichiometry, net.ways, 50 * net.rate_constants, how
        )

    counts = simulate(model(combinations), method, [8, 0, 0, 0], [20.0], runs=20_000, seed=3).counts[:, 0]
    for how in ("distinct", "ordered", "product"):
        exact = Transient().solve(model(how), [8, 0, 0, 0], [20.0])
        observed = np.bincount(exact.space.index_of(counts), minlength=len(exact.space))
        if how == combinations:
            assert_follows_table(observed, exact.probabilities[0])
        else:  # any other way to count the combinations is seen
            with pytest.raises(AssertionError):
                assert_follows_table(observed, exact.probabilities[0])


def test_third_order():
    net = network(("A", "B"), {"three": ((3, 0), (0, 1)), "back": ((0, 1), (3, 0))}, [0.02, 0.5])
    exact = Transient().solve(net, [12, 0], [2.0])
    counts = Direct().simulate(net, [12, 0], [2.0], runs=20_000, seed=4).counts[:, 0]
    observed = np.bincount(exact.space.index_of(counts), minlength=len(exact.space))
    assert_follows_table(observed, exact.probabilities[0])


def test_yule_process_is_negative_binomial():
    net = network(("X",), {"birth": ((1,), (2,))}, [1.0])
    counts = Direct().simulate(net, [3], [1.5], runs=10_000, seed=5).counts[:, 0, 0]
    assert_follows_cdf(counts, lambda x: nbinom(3, exp(-1.5)).cdf(x - 3))
    with pytest.raises(AssertionError):
        assert_follows_cdf(counts, lambda x: nbinom(3, exp(-1.55)).cdf(x - 3))


def test_runs_are_independent():
    net = network(("X",), {"decay": ((1,), (0,))}, [1.0])
    waits = np.array([sample_path(net, [1], 100.0, seed=6, run=run).times[0] for run in range(10_000)])
    assert_follows_cdf(waits, expon().cdf)
    assert abs(np.corrcoef(waits[1:], waits[:-1])[0, 1]) < 4.9 / np.sqrt(len(waits))  # 1e-6, both sides
    other = np.array([sample_path(net, [1], 100.0, seed=7, run=run).times[0] for run in range(10_000)])
    assert abs(np.corrcoef(waits, other)[0, 1]) < 4.9 / np.sqrt(len(waits))


def test_channels_twelve_decades_apart():
    net = network(("A", "B"), {"often": ((1, 0), (1, 0)), "rare": ((1, 0), (0, 1))}, [1e6, 1e-6])
    assert Direct().simulate(net, [1, 0], [1e-2], runs=2, seed=1).mean()[0, 1] == 0
    rare_first = network(("A", "B", "C"), {"rare": ((1, 0, 0), (0, 1, 0)), "often": ((1, 0, 0), (0, 0, 1))}, [1e-3, 1])
    turned = Direct().simulate(rare_first, [100_000, 0, 0], [1e3], runs=100, seed=2).counts[:, 0, 1]
    assert_follows_cdf(turned, binom(100_000, 1e-3 / 1.001).cdf)


def test_seed_threads_and_grid_do_not_matter():
    net = line()
    whole = simulate(net, Direct(), [60, 0, 0, 0], TIMES, runs=300, seed=9, threads=1).counts
    assert_array_equal(simulate(net, Direct(), [60, 0, 0, 0], TIMES, runs=300, seed=9, threads=3).counts, whole)
    assert_array_equal(simulate(net, Direct(), [60, 0, 0, 0], TIMES[1:3], runs=300, seed=9).counts, whole[:, 1:3])
    assert_array_equal(simulate(net, Direct(), [60, 0, 0, 0], TIMES, runs=7, seed=9).counts, whole[:7])
    later = Direct().simulate(net, [60, 0, 0, 0], TIMES, runs=10, seed=9, first_run=200)
    assert_array_equal(later.counts, whole[200:210])
    assert np.any(simulate(net, Direct(), [60, 0, 0, 0], TIMES, runs=300, seed=10).counts != whole)


def test_a_path_is_its_run_of_the_ensemble():
    net = line().with_rates(line().rate_constants * 100)  # more events than one buffer of the kernel holds
    ensemble = Direct().simulate(net, [6000, 0, 0, 0], TIMES, runs=3, seed=11)
    for run in range(3):
        path = sample_path(net, [6000, 0, 0, 0], 2000.0, seed=11, run=run)
        assert path.times.size > 4096
        assert np.all(np.diff(path.times) > 0)
        assert_array_equal(path.at(TIMES), ensemble.counts[run])


def xoshiro(words):
    """Reference xoshiro256++ in whole numbers of any size."""
    mask = 2**64 - 1
    s = list(words)
    while True:
        mixed = (s[0] + s[3]) & mask
        yield (((mixed << 23) | (mixed >> 41)) + s[0]) & mask
        shifted = (s[1] << 17) & mask
        s[2] ^= s[0]
        s[3] ^= s[1]
        s[1] ^= s[2]
        s[0] ^= s[3]
        s[2] ^= shifted
        s[3] = ((s[3] << 45) | (s[3] >> 19)) & mask


def test_random_words():
    published = [41943041, 58720359, 3588806011781223, 3591011842654386, 9228616714210784205, 9973669472204895162]
    state = [np.uint64(word) for word in (1, 2, 3, 4)]
    reference = xoshiro((1, 2, 3, 4))
    for i in range(1000):
        word, *state = ssa.next_word(*(np.uint64(word) for word in state))
        assert int(word) == next(reference)
        if i < len(published):
            assert int(word) == published[i]


def slow_direct(net, initial, end, words):
    """The direct method written from the definition, on the same random words."""
    state, t, events = list(initial), 0.0, []
    while True:
        rates = [
            k * n * np.prod([comb(x, m) for x, m in zip(state, needed, strict=True)])
            for k, n, needed in zip(net.rate_constants, net.ways, net.reactants, strict=True)
        ]
        if sum(rates) == 0:
            return events
        t -= log(1 - (next(words) >> 11) / 2**53) / sum(rates)
        if t > end:
            return events
        share = (next(words) >> 11) / 2**53
        channel = next(r for r in count() if sum(rates[: r + 1]) > share * sum(rates))
        state = [x + int(change) for x, change in zip(state, net.stoichiometry[channel], strict=True)]
        events.append((t, channel))


def test_kernel_against_the_definition():
    net = line()
    for run in range(5):
        stream = np.empty(4, dtype=np.uint64)
        ssa.start_stream(stream_key(12), run, stream)
        events = slow_direct(net, [60, 0, 0, 0], 2000.0, xoshiro([int(word) for word in stream]))
        path = sample_path(net, [60, 0, 0, 0], 2000.0, seed=12, run=run)
        assert_array_equal(path.channels, [channel for _, channel in events])
        assert_allclose(path.times, [t for t, _ in events], rtol=1e-12)


def test_kernels_equal_their_python(monkeypatch):
    model = (mass_action(line()), np.ascontiguousarray(line().stoichiometry))
    key, initial = stream_key(13), np.array([60, 0, 0, 0])

    def everything():
        stream, clock, counts = np.empty(4, dtype=np.uint64), np.zeros(1), np.append(initial, 1)
        times, channels = np.zeros(30), np.zeros(30, dtype=np.int64)
        ssa.start_stream(key, 5, stream)
        first = ssa.advance(*model, counts, clock, 2000.0, stream, times, channels)
        out = np.zeros((3, 4, 4), dtype=np.int64)
        last = ssa.ensemble(*model, initial, np.array(TIMES), key, 2, out)
        return (*first, *last, stream, clock, counts, times, channels, out)

    compiled = everything()
    for name in ("start_stream", "next_word", "exponential", "advance", "ensemble"):
        monkeypatch.setattr(ssa, name, getattr(ssa, name).py_func)
    with np.errstate(over="ignore"):  # plain numpy warns where 64-bit words wrap around
        python = everything()
    for one, other in zip(compiled, python, strict=True):
        assert_array_equal(one, other)


def test_nothing_left_to_happen():
    ensemble = Direct().simulate(decay(1.0), [3], [0.0, 1e3, 1e18], runs=50, seed=1)
    assert_array_equal(ensemble.counts[:, 0], np.full((50, 1), 3))
    assert_array_equal(ensemble.counts[:, 1:], np.zeros((50, 2, 1)))
    path = sample_path(decay(1.0), [3], 1e18)
    assert path.times.size == 3
    assert path.end == 1e18
    empty = Network(("A",), (), [], [], [], [])
    assert_array_equal(Direct().simulate(empty, [4], [1.0], runs=2).counts, [[[4]], [[4]]])


@pytest.mark.parametrize("combinations", ["distinct", "ordered", "product"])
def test_no_channel_fires_below_its_reactants(combinations):
    reactions = {"three": ((3, 0), (0, 1)), "pair": ((2, 0), (0, 0)), "both": ((1, 2), (0, 0))}
    net = network(("A", "B"), reactions, [1.0, 1.0, 1.0], combinations)
    for initial in ([2, 0], [7, 1], [10, 3], [1, 1], [0, 0]):
        for run in range(20):
            sample_path(net, initial, 1e6, seed=1, run=run)  # the path itself refuses an impossible event
    counts = Direct().simulate(net, [11, 5], [1e6], runs=500, seed=1).counts
    assert counts.min() >= 0


def test_empty_start_gives_a_poisson_law_on_any_grid():
    net = network(("X",), {"birth": ((0,), (1,)), "death": ((1,), (0,))}, [10.0, 1.0])
    few = Direct().simulate(net, [0], [20.0], runs=500, seed=3)
    many = Direct().simulate(net, [0], np.linspace(0, 20, 77)[1:], runs=500, seed=3)
    assert_array_equal(few.counts[:, -1], many.counts[:, -1])
    assert abs(few.mean()[0, 0] - 10) < 4.9 * np.sqrt(10 / 500)


def test_huge_counts_stay_exact():
    for copies in (5_000_000_000, 10**15):
        counts = Direct().simulate(decay(1e-18), [copies], [1.0], runs=2, seed=1).counts
        assert counts.max() == copies
        net = network(("A",), {"one": ((1,), (0,))}, [1.0 / copies])
        path = sample_path(net, [copies], 5.0, seed=2)
        assert path.times.size > 0
        assert path.states[-1, 0] == copies - path.times.size


def test_a_clock_that_stands_still_is_named():
    blow_up = network(("A",), {"burst": ((2,), (10**9,))}, [1.0])
    with pytest.raises(StalledClockError, match=r"run 0: events came so quickly that the clock stood still"):
        Direct().simulate(blow_up, [2], [100.0], runs=3, seed=1)
    with pytest.raises(StalledClockError, match="run 4"):
        sample_path(blow_up, [2], 100.0, seed=1, run=4)


def test_overflow_is_named():
    growing = network(("A", "B"), {"jump": ((1, 0), (1, 2**62))}, [1.0])
    with pytest.raises(ValueError, match="run 0: a count went beyond"):
        Direct().simulate(growing, [1, 0], [1e3], runs=1)
    steep = network(("A",), {"many": ((30,), (0,))}, [1.0], combinations="product")
    with pytest.raises(ValueError, match="or a propensity beyond 1e308"):
        sample_path(steep, [10**15], 1.0)


@pytest.mark.parametrize(
    ("change", "message"),
    [
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
    ],
)
def test_bad_input(change, message):
    good = {"network": line(), "initial": [60, 0, 0, 0], "times": [1.0]}
    with pytest.raises(ValueError, match=message):
        Direct().simulate(**(good | change))


@pytest.mark.parametrize("end", [-1.0, np.nan, np.inf])
def test_bad_end(end):
    with pytest.raises(ValueError, match="times holds"):
        sample_path(line(), [60, 0, 0, 0], end)
