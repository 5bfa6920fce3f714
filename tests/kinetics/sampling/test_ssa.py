from itertools import count
from math import comb, exp, log

import numpy as np
import pytest
from known_systems import (
    assert_follows_cdf,
    decay,
    line,
    network,
)
from numpy.testing import assert_allclose, assert_array_equal
from scipy.stats import binom, expon, nbinom

from kinetics import sample_path
from kinetics.kernels import direct, streams
from kinetics.kernels.ensemble_work import ensemble_work
from kinetics.sampling import Direct
from kinetics.sampling.base import stream_key
from kinetics.sampling.merging import Merging

TIMES = [0.0, 50.0, 500.0, 2000.0]


def test_yule_process_is_negative_binomial():
    net = network(("X",), {"birth": ((1,), (2,))}, [1.0])
    counts = Direct().simulate(net, [3], [1.5], runs=10_000, seed=5).counts[:, 0, 0]
    assert_follows_cdf(counts, lambda x: nbinom(3, exp(-1.5)).cdf(x - 3))
    with pytest.raises(AssertionError):
        assert_follows_cdf(counts, lambda x: nbinom(3, exp(-1.55)).cdf(x - 3))


def test_runs_are_independent():
    net = network(("X",), {"decay": ((1,), (0,))}, [1.0])
    waits = np.array([sample_path(net, [1], 100.0, seed=6, run=run).times[0] for run in range(1500)])
    assert_follows_cdf(waits, expon().cdf)
    assert abs(np.corrcoef(waits[1:], waits[:-1])[0, 1]) < 4.9 / np.sqrt(len(waits))  # 1e-6, both sides
    other = np.array([sample_path(net, [1], 100.0, seed=7, run=run).times[0] for run in range(1500)])
    assert abs(np.corrcoef(waits, other)[0, 1]) < 4.9 / np.sqrt(len(waits))


def test_channels_twelve_decades_apart():
    net = network(("A", "B"), {"often": ((1, 0), (1, 0)), "rare": ((1, 0), (0, 1))}, [1e6, 1e-6])
    assert Direct().simulate(net, [1, 0], [1e-2], runs=2, seed=1).mean()[0, 1] == 0
    rare_first = network(("A", "B", "C"), {"rare": ((1, 0, 0), (0, 1, 0)), "often": ((1, 0, 0), (0, 0, 1))}, [1e-3, 1])
    turned = Direct().simulate(rare_first, [100_000, 0, 0], [1e3], runs=100, seed=2).counts[:, 0, 1]
    assert_follows_cdf(turned, binom(100_000, 1e-3 / 1.001).cdf)


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
        word, *state = streams.next_word(*(np.uint64(word) for word in state))
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
        streams.start_stream(stream_key(12), run, stream)
        events = slow_direct(net, [60, 0, 0, 0], 2000.0, xoshiro([int(word) for word in stream]))
        path = sample_path(net, [60, 0, 0, 0], 2000.0, seed=12, run=run)
        assert_array_equal(path.channels, [channel for _, channel in events])
        assert_allclose(path.times, [t for t, _ in events], rtol=1e-12)


def test_kernels_equal_their_python(monkeypatch):
    model = (Merging.of(line()).model(), np.ascontiguousarray(line().stoichiometry))
    key, initial = stream_key(13), np.array([60, 0, 0, 0])

    def everything():
        stream, clock, counts = np.empty(4, dtype=np.uint64), np.zeros(3), np.append(initial, 1)
        times, channels = np.zeros(30), np.zeros(30, dtype=np.int64)
        streams.start_stream(key, 5, stream)
        first = direct.advance(*model, counts, clock, 2000.0, stream, times, channels)
        out = np.zeros((3, 4, 4), dtype=np.int64)
        work, limits = ensemble_work(4), np.array([4, 4, 0, 1000])
        last = direct.ensemble(*model, work, initial, np.array(TIMES), key, 2, limits, out, 10**6)
        return (*first, last, *work, stream, clock, counts, times, channels, out)

    compiled = everything()
    for name, function in vars(direct).items():
        if hasattr(function, "py_func"):
            monkeypatch.setattr(direct, name, function.py_func)
    with np.errstate(over="ignore"):  # plain numpy warns where 64-bit words wrap around
        python = everything()
    for one, other in zip(compiled, python, strict=True):
        assert_array_equal(one, other)


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


def test_overflow_is_named():
    growing = network(("A", "B"), {"jump": ((1, 0), (1, 2**62))}, [1.0])
    with pytest.raises(ValueError, match="run 0: a count went beyond"):
        Direct().simulate(growing, [1, 0], [1e3], runs=1)
    steep = network(("A",), {"many": ((30,), (0,))}, [1.0], combinations="product")
    with pytest.raises(ValueError, match="or a propensity exceeded 1e308"):
        sample_path(steep, [10**15], 1.0)
