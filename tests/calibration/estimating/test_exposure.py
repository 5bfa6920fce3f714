from itertools import pairwise

import numpy as np
import pytest
from synthetic_runs import breaking_run, line_network, restarted_run

from calibration import Exposure, count, pooled
from kinetics.network import Network, Tank
from kinetics.runs import RESTART, JumpPath
from kinetics.sampling import sample_path

ALL_AGES = (0.0, 0.4, 3.0, np.inf)


def pair_network(ways=4.0, combinations="distinct"):
    """A + A -> B and back."""
    return Network(("A", "B"), ("join", "break"), [[2, 0], [0, 1]], [[-2, 1], [2, -1]], [ways, 1], None, combinations)


def slow_count(path, lower=0.0, upper=np.inf):
    """The definition, wait by wait: the oracle of `count`."""
    network = path.network
    state, now, born = path.initial.copy(), 0.0, 0.0
    events, exposure = np.zeros(len(network.channels)), np.zeros(len(network.channels))
    for moment, channel in [*zip(path.times, path.channels, strict=True), (path.end, RESTART)]:
        seen = max(0.0, min(moment, born + upper) - max(now, born + lower))
        for j in range(len(network.channels)):
            if path.open_channels[j]:
                exposure[j] += seen * network.ways[j] * network.combinations_of(state)[j]
        if channel == RESTART:
            state, born = path.initial.copy(), moment
        else:
            events[channel] += lower <= moment - born < upper
            state = state + network.stoichiometry[channel]
        now = moment
    return events, exposure


def sample_runs():
    network = line_network()
    initial = network.state([14, 12, 6, 1])
    return [
        sample_path(network, initial, 20.0, seed=3),
        restarted_run(network, initial, 20.0, np.random.default_rng(3)),
        breaking_run(network, initial, 20.0, seed=3),
    ]


def test_by_hand():
    """Four A, joins at 1 and 3, a restart at 3.5, censored at 5: 6, 1, 0, 6 pairs of A and 0, 1, 2, 0 of B."""
    path = JumpPath(pair_network(), [4, 0], [1.0, 3.0, 3.5], [0, 0, RESTART], 5.0)
    found = count(path)
    assert found.events.tolist() == [2, 0]
    np.testing.assert_allclose(found.exposure, [4 * (6 * 1 + 1 * 2 + 0 + 6 * 1.5), 2 * 1 + 0.5 * 2])


def test_censored_wait_counts_in_full():
    path = JumpPath(pair_network(), [2, 0], [], [], 7.0)
    np.testing.assert_allclose(count(path).exposure, [28.0, 0.0])


def test_closed_channels_gather_nothing():
    path = JumpPath(pair_network(), [2, 3], [2.0], [1], 7.0, np.array([False, True]))
    np.testing.assert_allclose(count(path).exposure, [0.0, 2 * 3 + 5 * 2])


def test_events_within_one_step_share_their_time():
    path = JumpPath(pair_network(), [4, 0], [1.0, 1.0], [0, 0], 2.0)
    np.testing.assert_allclose(count(path).exposure, [24.0, 2.0])


@pytest.mark.parametrize("ages", [(0.0, np.inf), *pairwise(ALL_AGES)])
@pytest.mark.parametrize("kind", [0, 1, 2], ids=["full", "restarted", "breaking"])
def test_agrees_with_the_definition(kind, ages):
    path = sample_runs()[kind]
    events, exposure = slow_count(path, *ages)
    found = count(path, ages)
    np.testing.assert_array_equal(found.events, events)
    np.testing.assert_allclose(found.exposure, exposure, rtol=1e-12, atol=1e-12)


def test_refuses_to_mix():
    first = Exposure(pair_network(), [1, 0], [2.0, 1.0])
    np.testing.assert_array_equal((first + first).events, [2, 0])
    with pytest.raises(ValueError, match="two networks"):
        first + count(sample_runs()[0])
    with pytest.raises(ValueError, match="two conventions"):
        first + Exposure(pair_network(ways=2.0), [1, 0], [2.0, 1.0])
    with pytest.raises(ValueError, match="two conventions"):
        first + Exposure(pair_network(combinations="ordered"), [1, 0], [2.0, 1.0])


@pytest.mark.parametrize(
    ("events", "exposure", "message"),
    [
        ([1, 0], [0.0, 1.0], "events of join without exposure"),
        ([1], [1.0, 1.0], "events has shape"),
        ([-1, 0], [1.0, 1.0], "events holds -1"),
        ([1, 0], [np.nan, 1.0], "exposure holds nan"),
    ],
)
def test_refuses_what_cannot_be(events, exposure, message):
    with pytest.raises(ValueError, match=message):
        Exposure(pair_network(), events, exposure)


def test_wrong_calls():
    with pytest.raises(ValueError, match="no runs"):
        pooled([])
    with pytest.raises(ValueError, match="ages"):
        count(sample_runs()[0], (2.0, 1.0))


def test_the_order_of_runs_changes_no_digit():
    network = line_network()
    runs = [count(sample_path(network, [60, 0, 0, 0], 20.0, seed=9, run=run)) for run in range(20)]
    there, back = pooled(runs).exposure, pooled(runs[::-1]).exposure
    np.testing.assert_array_equal(there, back)
    one_by_one = [sum(run.exposure for run in order) for order in (runs, runs[::-1])]
    assert (one_by_one[0] != one_by_one[1]).any()  # the control: added one after the other they differ


def in_two_tanks():
    """The same pair, seen for 7 tu in a tank of volume 8 and in one of 64."""
    tanks = [Tank((2.0, 2.0, 2.0)), Tank((4.0, 4.0, 4.0))]
    return [count(JumpPath(pair_network(), [2, 1], [], [], 7.0, tank=tank)) for tank in tanks]


def test_exposures_are_those_of_the_first_tank():
    """Two bodies meet an eighth as often in eight times the volume; one breaks as often wherever it is."""
    small, large = in_two_tanks()
    np.testing.assert_allclose(small.exposure, [28.0, 7.0])
    np.testing.assert_allclose(large.in_tank(small.tank).exposure, [28.0 / 8, 7.0])
    np.testing.assert_allclose(pooled([small, large]).exposure, [28.0 * (1 + 1 / 8), 14.0])
    np.testing.assert_allclose(pooled([large, small]).exposure, [28.0 * (1 + 8), 14.0])
    assert small.in_tank(small.tank) is small


def test_a_tank_that_one_run_does_not_state():
    small, _ = in_two_tanks()
    unstated = count(JumpPath(pair_network(), [2, 1], [], [], 7.0))
    for first, second in ((small, unstated), (unstated, small)):
        with pytest.raises(ValueError, match="some runs state their tank and others do not"):
            pooled([first, second])
    assert unstated.in_tank(None) is unstated


def test_the_second_run_is_of_the_same_network_too():
    first = count(JumpPath(pair_network(), [2, 1], [], [], 7.0))
    with pytest.raises(ValueError, match="multiplicities"):
        pooled([first, count(JumpPath(pair_network(ways=3.0), [2, 1], [], [], 7.0))])


def test_an_event_on_the_edge_of_two_ages_belongs_to_the_older():
    path = JumpPath(pair_network(), [8, 0], [1.0, 3.0], [0, 0], 5.0)
    assert count(path, (0.0, 1.0)).events.tolist() == [0, 0]
    assert count(path, (1.0, 3.0)).events.tolist() == [1, 0]
    assert count(path, (3.0, 5.0)).events.tolist() == [1, 0]
    with pytest.raises(ValueError, match="ages"):
        count(path, (3.0, 3.0))
