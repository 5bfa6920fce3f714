import numpy as np
import pytest
from scipy.stats import kstest
from synthetic_runs import breaking_run, line_network, restarted_run

from calibration import Exposure, WaitingTimes, diagnose, homogeneity, waiting_times
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


@pytest.mark.parametrize("n", [3, 12, 100])
def test_p_values_are_uniform_for_exponential_waits(n):
    rng = np.random.default_rng(n)
    samples = [WaitingTimes("c", np.sort(rng.random(n)) * 7, 7.0) for _ in range(1000)]
    assert_uniform([sample.drift_test()[1] for sample in samples])
    shape = np.array([sample.shape_test()[1] for sample in samples])
    if n > 3:  # the fitted p-values are for larger samples; even here a 5 % test stays near 5 %
        assert_uniform(shape)
    assert np.count_nonzero(shape < 0.05) < 50 + 6 * np.sqrt(50)


def test_wrong_waits_are_seen():
    """Controls: too regular, clustered as after rebinding, and a rate that drifts."""
    rng = np.random.default_rng(1)
    regular = [waits_of(rng.gamma(2.0, 1.0, 200)).shape_test()[1] for _ in range(20)]
    clustered = [waits_of(rng.exponential(rng.choice([0.2, 2.0], 200))).shape_test()[1] for _ in range(20)]
    drifting = [waits_of(rng.exponential(np.linspace(0.5, 1.5, 200))).drift_test()[1] for _ in range(20)]
    assert np.max(regular) < 1e-3
    assert np.median(clustered) < 1e-6
    assert np.median(drifting) < 1e-2
    for p_values in (regular, clustered, drifting):
        assert_not_uniform(p_values)


def test_too_few_events_prove_nothing():
    empty = WaitingTimes("c", np.array([]), 5.0)
    assert empty.drift_test() == empty.shape_test() == (0.0, 1.0)
    assert empty.residuals.size == 0


def test_residuals_of_full_paths_are_unit_exponential():
    """Time rescaling: whatever the states on the way, and across runs of all kinds."""
    network = line_network()
    rng = np.random.default_rng(2)
    runs = [sample_path(network, [60, 0, 0, 0], 100.0, seed=2, run=i) for i in range(4)]
    runs += [restarted_run(network, network.state([14, 12, 6, 1]), 0.5, rng) for _ in range(100)]
    for channel in (*network.channels, None):
        residuals = waiting_times(runs, channel).residuals
        assert residuals.size > 50
        assert kstest(residuals, "expon").pvalue > FALSE_ALARM
    clock = np.diff(np.concatenate([run.times for run in runs[:4]]))  # control: plain waits, not rescaled
    assert kstest(clock / clock.mean(), "expon").pvalue < FALSE_ALARM
    with pytest.raises(ValueError, match="unknown channel"):
        waiting_times(runs, "9->1")


def groups_of(rates, exposure, rng):
    network = line_network()
    total = np.full(8, exposure)
    return {f"group {i}": Exposure(network, rng.poisson(rate * total), total) for i, rate in enumerate(rates)}


def test_homogeneity_has_its_size_and_power():
    """Size 5 % within 6 standard errors of 320 tests; 20 % between two arms of 650 events is seen in over 80 %."""
    rng = np.random.default_rng(4)
    same = [h.p_value for _ in range(40) for h in homogeneity(groups_of([1, 1, 1], 40.0, rng))]
    assert_uniform(same)
    assert abs(np.mean(np.array(same) < 0.05) - 0.05) < 6 * np.sqrt(0.05 * 0.95 / 320)
    different = [h.p_value for _ in range(10) for h in homogeneity(groups_of([1, 1.2], 650.0, rng))]
    assert np.mean(np.array(different) < 0.05) > 0.8


def test_homogeneity_by_hand():
    network = line_network()
    groups = {
        "a": Exposure(network, [4, 0, 0, 0, 0, 0, 0, 9], [2.0] * 8),
        "b": Exposure(network, [0, 0, 0, 0, 0, 0, 0, 0], [2.0] * 7 + [0.0]),
    }
    found = homogeneity(groups)
    assert found[0].dispersion == pytest.approx(4.0)  # expected 2 and 2
    assert found[0].p_value == pytest.approx(2 / 16, abs=0.03)  # all on one side
    np.testing.assert_allclose(found[0].rates, [2.0, 0.0])
    for j in (1, 7):  # no events; one group alone has exposure
        assert np.isnan(found[j].dispersion)
        assert found[j].p_value == 1.0
    low, high = found[7].intervals()
    assert (low[1], high[1]) == (0.0, np.inf)
    with pytest.raises(ValueError, match="no groups"):
        homogeneity({})


def test_diagnosis_of_calibration_runs():
    """Sound runs raise no doubt; a rate that is three times higher in one composition does, by name."""
    network = line_network()
    rng = np.random.default_rng(6)
    states = [network.state(s) for s in ([14, 12, 6, 1], [6, 20, 2, 2])]
    runs = [restarted_run(network, state, 20.0, rng) for state in states for _ in range(3)]
    runs.append(breaking_run(network, network.state([0, 0, 10, 20]), 20.0, seed=6))
    sound = diagnose(runs)
    assert sound.doubtful == []
    assert [row["channel"] for row in sound.table()] == list(network.channels)

    faster = network.with_rates(network.known_rates * np.where(np.arange(8) == 3, 3.0, 1.0))
    crowded = [restarted_run(faster, states[1], 20.0, rng) for _ in range(3)]
    doubtful = diagnose(runs[:3] + crowded).doubtful
    assert "2+2->4: initial" in doubtful
    assert all(name.startswith("2+2->4") for name in doubtful)


def test_what_one_run_or_too_few_events_leave_untested_is_said():
    network = line_network()
    one = diagnose([sample_path(network, [60, 0, 0, 0], 50.0, seed=2)])
    assert one.not_testable["between_runs"] == one.not_testable["initial"] == list(network.channels)
    assert "drift" not in one.not_testable
    assert all(np.isnan(row["p_between_runs"]) for row in one.table())
    short = diagnose([sample_path(network, [60, 0, 0, 0], 0.5, seed=2, run=run) for run in range(2)])
    assert "4->2+2" in short.not_testable["drift"]
    assert "4->2+2" in short.not_testable["between_runs"]
    assert not any("4->2+2" in name for name in short.doubtful)
    many = diagnose([sample_path(network, [60, 0, 0, 0], 50.0, seed=2, run=run) for run in range(4)])
    assert set(many.not_testable) == {"initial"}  # all began alike
