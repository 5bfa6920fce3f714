import numpy as np
import pytest
from scipy.stats import kstest
from synthetic_runs import line_network, restarted_run

from calibration.estimating.diagnosing.diagnosed_runs import DiagnosedRuns
from calibration.estimating.diagnosing.renewal import WaitingTimes, waiting_times
from kinetics.sampling import sample_path

FALSE_ALARM = 1e-6


def assert_uniform(p_values):
    assert kstest(p_values, "uniform").pvalue > FALSE_ALARM


def assert_not_uniform(p_values):
    with pytest.raises(AssertionError):
        assert_uniform(p_values)


def waits_of(waits):
    """Waits end to end, the last one cut off in the middle of a further wait."""
    moments = np.cumsum(waits)
    return WaitingTimes("c", moments[:-1], float(moments[-1] - waits[-1] / 2))


@pytest.mark.parametrize("n", [5, 60])
def test_p_values_are_uniform_for_exponential_waits(n):
    rng = np.random.default_rng(n)
    samples = [WaitingTimes("c", np.sort(rng.random(n)) * 7, 7.0) for _ in range(400)]
    assert_uniform([sample.drift_test()[1] for sample in samples])
    assert_uniform([sample.shape_test(rng)[1] for sample in samples])


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
