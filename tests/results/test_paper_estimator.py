import numpy as np
import pytest
from synthetic_runs import line_network, restarted_run

from calibration import count, estimate
from kinetics.runs import JumpPath
from tests.results.paper_estimator import paper_estimate


def one_channel_runs(n_runs, mean_events, rng):
    """Restarted runs of 2 dimer -> quadmer alone, of one length."""
    network = line_network()
    only = np.array(network.channels) == "2+2->4"
    network = network.with_rates(network.known_rates * only)
    initial = network.state([0, 20, 0, 0])
    end = mean_events / network.propensities(initial).sum()
    runs = [restarted_run(network, initial, end, rng) for _ in range(n_runs)]
    return network, [JumpPath(network, initial, run.times, run.channels, end, only) for run in runs]


def test_papers_estimator_is_too_high_by_n_over_n_minus_1():
    """Given n >= 2 events, the last of n uniform moments is T max(U), and E[1 / max(U)] = n / (n - 1).

    The pooled estimate of the same runs, those without an event counted too, has no bias. 6 standard errors each:
    false alarms 4e-9. Control: the pooled value is not within 6 standard errors of the paper's.
    """
    network, runs = one_channel_runs(1500, 6.0, np.random.default_rng(5))
    true = network.rate_constants[3]
    pooled = np.array([estimate([run])["2+2->4"].rate for run in runs]) / true
    paper = np.array([paper_estimate([run])["2+2->4"] for run in runs]) / true
    events = np.array([count(run).events[3] for run in runs])
    expected = np.where(events >= 3, events / np.maximum(events - 1, 1), np.nan)
    ratio = np.where(events >= 3, paper / np.where(events > 0, pooled, 1), np.nan)  # at n = 2 the variance is infinite
    error = (ratio - expected)[events >= 3]
    assert abs(error.mean()) < 6 * error.std() / np.sqrt(error.size)
    assert abs(pooled.mean() - 1) < 6 * pooled.std() / np.sqrt(pooled.size)
    assert ratio[events >= 3].mean() > 1 + 6 * ratio[events >= 3].std() / np.sqrt(error.size)


def test_papers_estimator_by_hand():
    """Two initial states are averaged; the clock stops outside them, and the wait after the last event is dropped."""
    network = line_network()
    first = JumpPath(network, [2, 0, 0, 0], [3.0, 3.0, 8.0], [0, -1, 0], 50.0)  # waits 3 and 5
    second = JumpPath(network, [3, 0, 0, 0], [2.0, 4.0], [0, 1], 50.0)  # wait 2; then it is elsewhere
    found = paper_estimate([first, second])
    assert found["1+1->2"] == pytest.approx((1 / (4 * 4 * 1) + 1 / (2 * 4 * 3)) / 2)
    assert np.isnan(found["1+2->3"])
