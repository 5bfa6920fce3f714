import numpy as np
import pytest
from known_systems import assert_follows_cdf, assert_follows_table, line, network, switch, walk
from numpy.testing import assert_allclose
from scipy.linalg import expm

from kinetics import Chain, committor, first_passage


def at_least(index, copies):
    return lambda states: states[:, index] >= copies


def ruin(n, up=1.0, down=2.0):
    """A gambler who stops at 0 or n."""
    net = network("X", {"win": ((1,), (2,)), "lose": ((1,), (0,))}, [up, down])
    fair = {"ruin": lambda states: states[:, 0] == 0, "rich": at_least(0, n)}
    return net, fair


@pytest.mark.parametrize("n", [2, 10, 100, 1000])
def test_gamblers_ruin(n):
    # The stakes in proportion to the coins change the times, not the odds: 1 / (2**n - 1).
    found = committor(ruin(n)[0], [1], ruin(n)[1])
    assert_allclose(found.probabilities[1], 1 / (2.0**n - 1), rtol=1e-13)
    assert_allclose(found.probabilities.sum(), 1.0, rtol=1e-13)
    assert found.never == 0.0
    assert abs(found.probabilities[1] * (2.0**n - 1) - 1) <= found.error < 2e-11


def test_conditional_times_and_occupation():
    # Fair steps at rate 1 each way on 0..n from i: rich with i/n, E[T] = i (n - i) / 2, E[T | rich] = (n*n - i*i) / 6.
    n, i = 12, 5
    species = tuple(f"place{k}" for k in range(n + 1))
    here = np.eye(n + 1, dtype=int)
    steps = {f"up{k}": (here[k], here[k + 1]) for k in range(1, n)}
    steps |= {f"down{k}": (here[k], here[k - 1]) for k in range(1, n)}
    net = network(species, steps, np.ones(2 * n - 2))
    found = committor(net, here[i], {"low": at_least(0, 1), "high": at_least(n, 1)})
    assert_allclose(found.probabilities, [1 - i / n, i / n], rtol=1e-13)
    assert_allclose(found.mean_times[1], (n * n - i * i) / 6, rtol=1e-12)
    assert_allclose(found.probabilities @ found.mean_times, i * (n - i) / 2, rtol=1e-12)
    assert_allclose(found.occupation.sum(), i * (n - i) / 2, rtol=1e-12)
    place = found.space.states.argmax(axis=1)
    green = np.minimum(place, i) * (n - np.maximum(place, i)) / n  # Green's function over the exit rate of 2
    assert_allclose(found.occupation, green, rtol=1e-12, atol=1e-15)


def test_expected_times_against_a_drift():
    n = 60
    found = committor(walk(n), np.eye(1, n + 1, dtype=int)[0], {"top": at_least(n, 1)})
    assert_allclose(found.mean_times, [2.0 ** (n + 1) - n - 2], rtol=1e-13)
    # Place k is left upwards once more than it is come back to: 2**(n-k) - 1 over k = 0..n-1.
    place = found.space.states.argmax(axis=1)
    assert_allclose(found.occupation, 2.0 ** (n - place) - 1, rtol=1e-13)


def test_ends_that_are_no_target():
    reactions = {
        "good": ((1, 0, 0, 0), (0, 1, 0, 0)),
        "bad": ((1, 0, 0, 0), (0, 0, 1, 0)),
        "on": ((0, 0, 1, 0), (0, 0, 0, 1)),
    }
    net = network("ABCD", reactions, [1.0, 3.0, 1.0])
    found = committor(net, [1, 0, 0, 0], {"B": at_least(1, 1)})
    assert_allclose([*found.probabilities, found.never], [0.25, 0.75], rtol=1e-14)
    assert_allclose(found.mean_times, [0.25], rtol=1e-13)
    nowhere = committor(net, [0, 0, 1, 0], {"B": at_least(1, 1)})
    assert nowhere.never == 1.0
    assert np.isnan(nowhere.mean_times[0])
    with pytest.raises(ValueError, match="'B' is never reached first"):
        nowhere.sample_path("B")
    there = committor(net, [0, 1, 0, 0], {"B": at_least(1, 1)})
    assert_allclose([there.probabilities[0], there.never, there.mean_times[0]], [1.0, 0.0, 0.0])
    assert there.sample_path("B").times.size == 0


def test_committors_of_all_states_from_a_start_in_a_target():
    rates = np.zeros((5, 5))
    rates[[1, 1, 2, 2, 3], [0, 2, 1, 4, 4]] = [1.0, 1.0, 1.0, 2.0, 1.0]
    ends = {"low": np.arange(5) == 0, "high": np.arange(5) == 4}
    for start in (0, 4, 1):
        found = Chain(rates, start).committor(ends)
        assert_allclose(found.committors[0], [1.0, 0.6, 0.2, 0.0, 0.0], rtol=1e-15)
        assert_allclose(found.probabilities, found.committors[:, start], rtol=1e-15)
        assert found.occupation.any() == (start == 1)
        assert found.probability_bounds("low", 1)[0] <= 0.6 <= found.probability_bounds("low", 1)[1]


def test_one_target_is_a_first_passage():
    found = committor(line(), [20, 0, 0, 0], {"two": at_least(3, 2)})
    assert_allclose(found.mean_times[0], first_passage(line(), [20, 0, 0, 0], "quadmer", 2).mean, rtol=1e-11)


def test_conditioned_paths_take_as_long_as_selected_ones():
    net, ends = ruin(4, 2.0, 3.0)
    found = committor(net, [2], ends)
    drawn = [found.sample_path("rich", seed=1, run=run) for run in range(1000)]
    assert all(path.states[-1, 0] == 4 for path in drawn)
    times = np.array([path.end for path in drawn])
    # From 2 of 0, ..., 4 coins, both ends kept: who is at 4 by then, over who ever is.
    coins = np.array([0.0, 1, 2, 3, 0])
    generator = np.diag(2.0 * coins[:-1], 1) + np.diag(3.0 * coins[1:], -1) - np.diag(5.0 * coins)

    def by(when):
        return expm(generator * when[:, None, None])[:, 2, 4]

    ever = by(np.array([200.0]))[0]
    assert_allclose(ever, found.probabilities[1], rtol=1e-12)
    assert_follows_cdf(times, lambda when: by(when) / ever)
    with pytest.raises(AssertionError):  # the control: those of all paths, whichever end they come to
        assert_follows_cdf(times, lambda when: by(when) + expm(generator * when[:, None, None])[:, 2, 0])
    assert_allclose(times.mean(), found.mean_times[1], rtol=5 * times.std() / times.mean() / np.sqrt(len(times)))


def test_paths_to_an_end_of_chance_1e_30():
    net, ends = ruin(100)
    found = committor(net, [1], ends)
    path = found.sample_path("rich", seed=3)
    assert path.states[-1, 0] == 100
    assert (path.states[:-1, 0] > 0).all()
    again = found.sample_path("rich", seed=3)
    assert_allclose(path.times, again.times, rtol=0)


def test_waits_of_a_conditioned_chain_of_one_step():
    # A -> B at 1 or A -> C at 3: which one says nothing about when; the wait has rate 4 either way.
    net = network("ABC", {"b": ((1, 0, 0), (0, 1, 0)), "c": ((1, 0, 0), (0, 0, 1))}, [1.0, 3.0])
    found = committor(net, [1, 0, 0], {"B": at_least(1, 1), "C": at_least(2, 1)})
    waits = np.array([found.sample_path("B", 5, run).end for run in range(2000)])
    assert_follows_cdf(waits, lambda t: 1 - np.exp(-4 * t))
    assert_follows_table([500, 1500], found.probabilities)


@pytest.mark.parametrize(
    ("targets", "message"),
    [
        ({}, "no targets"),
        ({"a": at_least(0, 2), "b": at_least(0, 3)}, "belongs to two targets"),
        ({"a": lambda states: states >= 2}, r"gives shape \(1, 2\); expected one truth a state, \(1,\)"),
    ],
)
def test_bad_targets(targets, message):
    with pytest.raises(ValueError, match=message):
        committor(switch(), [3, 0], targets)


def test_unknown_target():
    with pytest.raises(ValueError, match="unknown target 'poor'; there are ruin, rich"):
        committor(ruin(4)[0], [1], ruin(4)[1]).sample_path("poor")
