"""Breaks that are undone at once, taken out of a run."""

import numpy as np
import pytest
from doubtful_runs import broken

from calibration import estimate, net_path
from kinetics.network import Network
from kinetics.runs import RESTART, JumpPath

NETWORK = Network(("A", "B"), ("join", "break"), [[2, 0], [0, 1]], [[-2, 1], [2, -1]], [1, 1])
JOIN, BREAK = 0, 1


def run(channels, times):
    return JumpPath(NETWORK, [4, 1], times, channels, 30.0)


def test_only_the_same_cubes_within_the_window_and_before_a_restart():
    path = run([BREAK, JOIN, JOIN], [1.0, 2.0, 9.0])
    assert net_path(path, [[3, 4], [4, 3], [0, 1]], 2.0).times.tolist() == [9.0]
    for bonds, window in (([[3, 4], [4, 2], [0, 1]], 2.0), ([[3, 4], [4, 3], [0, 1]], 0.5)):
        assert net_path(path, bonds, window).times.tolist() == [1.0, 2.0, 9.0]
    cut = run([BREAK, RESTART, JOIN], [1.0, 1.0, 2.0])
    assert net_path(cut, [[3, 4], [-1, -1], [3, 4]], 5.0).times.tolist() == [1.0, 1.0, 2.0]


def test_a_pair_without_which_the_run_is_impossible_stays():
    """Two breaks of one B: the second needs the join before it, whose own pair would leave none."""
    path = JumpPath(NETWORK, [0, 1], [1.0, 2.0, 3.0], [BREAK, JOIN, BREAK], 9.0)
    assert net_path(path, [[0, 1], [0, 1], [0, 1]], 5.0).channels.tolist() == [BREAK]
    network = Network(("A", "B"), ("join", "break", "fade"), [[2, 0], [0, 1], [1, 0]],
                      [[-2, 1], [2, -1], [-1, 0]], [1, 1, 1])  # fmt: skip
    path = JumpPath(network, [1, 1], [1.0, 2.0, 3.0, 4.0], [BREAK, 2, JOIN, BREAK], 9.0)
    assert net_path(path, [[0, 1], [2, -1], [0, 1], [0, 1]], 5.0).times.size == 2  # one A was there to fade
    path = JumpPath(network, [0, 2], [1.0, 2.0, 2.5, 3.0, 4.0], [BREAK, 2, BREAK, JOIN, 2], 9.0)
    assert net_path(path, [[0, 1], [5, -1], [2, 3], [0, 1], [5, -1]], 5.0).times.size == 5  # none was


def test_a_mistake_is_named():
    path = run([BREAK], [1.0])
    with pytest.raises(ValueError, match="window = 0"):
        net_path(path, [[0, 1]], 0)
    with pytest.raises(ValueError, match="bonds"):
        net_path(path, [[0, 1], [1, 2]], 1.0)


def test_net_breaks_are_those_that_do_not_rebind():
    """A fifth of the breaks rebind 1 tu later on average: net rates of breaks are lower by the share undone in 10 tu,
    within 5 standard errors of the count that is taken out; states and conserved cubes stay."""
    paths, bonds = broken(0.2, np.random.default_rng(1), runs=20)
    net = [net_path(path, cubes, 10.0) for path, cubes in zip(paths, bonds, strict=True)]
    is_break = paths[0].network.stoichiometry.sum(axis=1) > 0
    before, after = (estimate(each).total.events[is_break].sum() for each in (paths, net))
    assert abs((before - after) - 0.2 * before) < 5 * np.sqrt(0.2 * before)
    for path, other in zip(paths, net, strict=True):
        assert path.times.size - other.times.size >= 0
        np.testing.assert_array_equal(path.states[-1], other.states[-1])
