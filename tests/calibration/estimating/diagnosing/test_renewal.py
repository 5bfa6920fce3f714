"""Waits on the clock of their hazard: their p-values, whatever ends the clock, and what they see."""

import numpy as np
import pytest
from scipy.stats import binom, kstest
from synthetic_runs import line_network, restarted_run
from used_up import used_up_run

from calibration.estimating.diagnosing.conditional import spacing_test
from calibration.estimating.diagnosing.diagnosed_runs import DiagnosedRuns
from calibration.estimating.diagnosing.renewal import WaitingTimes, waiting_times
from kinetics.sampling import sample_path

FALSE_ALARM = 1e-6


def assert_uniform(p_values):
    assert kstest(p_values, "uniform").pvalue > FALSE_ALARM


def assert_not_uniform(p_values):
    with pytest.raises(AssertionError):
        assert_uniform(p_values)


def assert_valid(p_values):
    """No level has more p-values at or below it than chance allows."""
    for level in (0.1, 0.01, 0.001):
        assert binom.sf(np.sum(np.array(p_values) <= level) - 1, len(p_values), level) > FALSE_ALARM


def waits_of(waits):
    """Waits end to end, the last one cut off in the middle of a further wait."""
    moments = np.cumsum(waits)
    return WaitingTimes("c", moments[:-1], float(moments[-1] - waits[-1] / 2))


@pytest.mark.parametrize("n", [5, 60])
def test_p_values_of_exponential_waits(n):
    """On a clock of known length, and up to an event: exact for the shape, at least valid for the drift."""
    rng = np.random.default_rng(n)
    samples = [WaitingTimes("c", np.sort(rng.random(n)) * 7, 7.0) for _ in range(100)]
    moments = [np.cumsum(rng.exponential(size=n)) for _ in range(100)]
    samples += [WaitingTimes("c", each, float(each[-1])) for each in moments]
    assert_valid([sample.drift_test()[1] for sample in samples])
    assert_uniform([sample.shape_test(rng)[1] for sample in samples])


@pytest.mark.parametrize("runs", [1, 3, 6])
def test_an_event_may_end_its_own_clock(runs):
    """Runs with one B each, which most of them break: sound, as both tests now say. The controls are the tests as they
    were, which fail too many: uniform on the whole clock, and with the last gap taken for a wait."""
    rng = np.random.default_rng(runs)
    judged = [
        waiting_times(DiagnosedRuns(tuple(used_up_run(rng) for _ in range(runs))), 0)
        for _ in range(300 if runs < 6 else 150)
    ]
    judged = [waits for waits in judged if waits.positions.size]
    assert_valid([waits.drift_test()[1] for waits in judged])
    if runs < 6:
        with pytest.raises(AssertionError):
            assert_valid([kstest(waits.positions / waits.total, "uniform").pvalue for waits in judged])
        return
    judged = [waits for waits in judged if waits.positions.size >= 5]
    assert_valid([waits.shape_test(rng)[1] for waits in judged])
    gaps = [np.diff(waits.positions, prepend=0.0, append=waits.total) for waits in judged]
    with pytest.raises(AssertionError):
        assert_valid([spacing_test(each, rng)[1] for each in gaps])


def test_one_event_at_the_end_of_its_exposure_is_no_sign():
    """What whole assemblies show: p was 0 for the only event of a channel, which had used up its reactant."""
    (waits,) = [waiting_times(DiagnosedRuns((used_up_run(np.random.default_rng(1), end=99.0),)), 0)]
    assert waits.positions[-1] == waits.total
    assert waits.drift_test()[1] == 1.0
    assert kstest(waits.positions / waits.total, "uniform").pvalue == 0.0


def test_a_rate_that_stops_is_seen():
    """Though what follows the last event is no wait: ten events in the first half of the clock are too early."""
    assert WaitingTimes("c", np.linspace(0.05, 0.5, 10), 1.0).drift_test()[1] < 0.02
    assert WaitingTimes("c", np.linspace(0.5, 1.0, 11), 1.0).drift_test()[1] < 0.02


def test_wrong_waits_are_seen():
    """Controls: too regular, clustered as after rebinding, and a rate that drifts."""
    rng = np.random.default_rng(1)
    regular = [waits_of(rng.gamma(2.0, 1.0, 200)).shape_test(rng)[1] for _ in range(20)]
    clustered = [waits_of(rng.exponential(rng.choice([0.2, 2.0], 200))).shape_test(rng)[1] for _ in range(20)]
    drifting = [waits_of(rng.exponential(np.linspace(0.5, 1.5, 200))).drift_test()[1] for _ in range(20)]
    assert np.max(regular) < 1e-3
    assert np.median(clustered) < 1e-6
    assert np.median(drifting) < 1e-2
    for p_values in (regular, clustered, drifting):
        assert_not_uniform(p_values)


def test_residuals_of_full_paths_are_unit_exponential():
    """Time rescaling: whatever the states on the way, and across runs of all kinds."""
    network = line_network()
    rng = np.random.default_rng(2)
    runs = [sample_path(network, [60, 0, 0, 0], 100.0, seed=2, run=i) for i in range(4)]
    runs += [restarted_run(network, network.state([14, 12, 6, 1]), 0.5, rng) for _ in range(100)]
    diagnosed = DiagnosedRuns(tuple(runs))
    for channel in (*range(len(network.channels)), None):
        residuals = waiting_times(diagnosed, channel).residuals
        assert residuals.size > 50
        assert kstest(residuals, "expon").pvalue > FALSE_ALARM
    clock = np.diff(np.concatenate([run.times for run in runs[:4]]))  # control: plain waits, not rescaled
    assert kstest(clock / clock.mean(), "expon").pvalue < FALSE_ALARM
