"""The direct method where it is hard: independence of runs, rates far apart, whole and huge counts.

Runs draw by draw are in test_direct_by_hand, what every method must do is in its contract.
"""

import numpy as np
import pytest
from known_systems import assert_follows_cdf, decay, network
from scipy.stats import binom, expon

from kinetics import sample_path
from kinetics.kernels import streams
from kinetics.sampling import Direct


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


def test_random_words_are_those_published():
    published = [41943041, 58720359, 3588806011781223, 3591011842654386, 9228616714210784205, 9973669472204895162]
    state = (1, 2, 3, 4)
    for expected in published:
        word, *state = streams.next_word(*map(np.uint64, state))
        assert int(word) == expected


@pytest.mark.parametrize("combinations", ["distinct", "ordered", "product"])
def test_no_channel_fires_below_its_reactants(combinations):
    reactions = {"three": ((3, 0), (0, 1)), "pair": ((2, 0), (0, 0)), "both": ((1, 2), (0, 0))}
    net = network(("A", "B"), reactions, [1.0, 1.0, 1.0], combinations)
    for initial in ([2, 0], [7, 1], [10, 3], [1, 1], [0, 0]):
        for run in range(20):
            sample_path(net, initial, 1e6, seed=1, run=run)  # the path itself refuses an impossible event
    counts = Direct().simulate(net, [11, 5], [1e6], runs=500, seed=1).counts
    assert counts.min() >= 0


def test_huge_counts_stay_exact():
    for copies in (5_000_000_000, 10**15):
        counts = Direct().simulate(decay(1e-18), [copies], [1.0], runs=2, seed=1).counts
        assert counts.max() == copies
        net = network(("A",), {"one": ((1,), (0,))}, [1.0 / copies])
        path = sample_path(net, [copies], 5.0, seed=2)
        assert path.times.size > 0
        assert path.states[-1, 0] == copies - path.times.size
