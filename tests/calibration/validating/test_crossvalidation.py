"""SSA paths stand in for mechanics: with their own rates the prediction must hold, with others it must fail."""

import json
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from scipy.stats import kstest
from synthetic_runs import breaking_run, line_network, restarted_run

from calibration import compare_first_times, crossvalidate, estimate
from calibration.validating.first_times import censored_ks_test
from calibration.validating.scores import central_band, crps_table, mean_misfit
from kinetics import first_passage
from kinetics.network import Network
from kinetics.runs import JumpPath
from kinetics.sampling import sample_path

TIMES = np.array([0.0, 1.0, 3.0, 6.0, 10.0, 15.0, 25.0])
REPEATS = 40
FALSE_ALARM = 1e-6


@cache
def calibrated(i, length=60.0):
    """Rates from runs of moderate length: some 10 to 60 events of each channel, so their uncertainty matters."""
    network = line_network()
    rng = np.random.default_rng([3, i])
    restarted = restarted_run(network, network.state([14, 12, 6, 1]), length, rng)
    return estimate([restarted, breaking_run(network, network.state([0, 0, 12, 30]), length / 3, 4, i)]).rates()


@cache
def held_out(i, n=24, factor=1.0):
    """Runs of 30 cubes that calibration never saw; factor : on the rates of the joins."""
    network = line_network()
    joins = network.reactants.sum(axis=1) == 2
    true = network.with_rates(network.known_rates * np.where(joins, factor, 1.0))
    return [sample_path(true, [30, 0, 0, 0], TIMES[-1], seed=77, run=i * n + j) for j in range(n)]


def without_evidence(rates):
    bare = {name: c.replace(events=None, exposure=None) for name, c in rates.channels.items()}
    return rates.replace(channels=bare)


def repeated(repeats, rates_of=calibrated, **options):
    return [
        crossvalidate(rates_of(i), held_out(i, **options), TIMES, "quadmer", seed=i, groups=99, runs=20)
        for i in range(repeats)
    ]


def test_holds_where_the_rates_are_right():
    """Calibrated and cross-validated anew 40 times: coverage near 95 %, p-values uniform.

    The mean coverage of a repeat scatters by 0.1, so that of 40 by 0.016: the bounds are 6 of them below 95 %.
    """
    found = repeated(REPEATS)
    assert 0.86 < np.mean([cv.coverage.share for cv in found]) < 0.995
    assert 0.93 < np.mean([cv.run_coverage.share for cv in found]) < 0.995
    for p_values in (
        [cv.p_misfit for cv in found],
        [cv.scores[-1].p_value for cv in found],
        [cv.first.p_value for cv in found],
        [cv.single_runs.p_value for cv in found],
    ):
        assert kstest(p_values, "uniform").pvalue > FALSE_ALARM


@pytest.mark.parametrize(
    ("rates_of", "factor"),
    [
        pytest.param(calibrated, 1.5, id="joins half as fast again"),
        pytest.param(
            lambda i: without_evidence(calibrated(i)), 1.0, id="rate uncertainty left out", marks=pytest.mark.validate
        ),
    ],
)
def test_controls_are_seen(rates_of, factor):
    found = repeated(REPEATS // 2, rates_of, factor=factor)
    assert np.mean([cv.coverage.share for cv in found]) < 0.86
    assert kstest([cv.p_misfit for cv in found], "uniform").pvalue < FALSE_ALARM


def test_thirty_per_cent_are_seen_at_once_with_good_rates():
    """Long calibration runs and 100 held-out runs: one comparison decides."""
    rates = calibrated(0, length=3000.0)
    options = {"seed": 1, "groups": 399, "most_groups": 4999}  # the default resolves p-values that none here needs
    same = crossvalidate(rates, held_out(1, n=100), TIMES, "quadmer", **options)
    assert same.is_consistent
    assert same.coverage.share > 0.8
    assert np.nanmax(np.abs(same.z)) < 5
    off = crossvalidate(rates, held_out(1, n=100, factor=0.7), TIMES, "quadmer", **options)
    assert not off.is_consistent
    assert off.p_misfit == 1 / 400  # none of the 399 groups
    assert off.coverage.share < 0.6
    assert np.nanmax(np.abs(off.z)) > 5


@pytest.fixture(scope="module")
def comparison():
    return replace(
        crossvalidate(calibrated(5), held_out(5, n=10), TIMES, "quadmer", 50, 199), label="30 cubes", mechanics_cpu=12.5
    )


def test_both_sides_and_their_cost_in_one_table(comparison):
    row = comparison.figures()
    assert row["label"] == "30 cubes"
    assert row["cpu_mechanics_s"] == 12.5
    assert row["cpu_ssa_s"] >= 0
    assert row["cpu_exact_s"] > 0
    assert row["first_censored"] == 1
    assert row["first_low"] < row["first_observed"] < row["first_high"]
    assert row["first_predicted"] < row["first_mean"]  # the former stops at the horizon
    assert {score.species for score in comparison.scores} == {*line_network().species, "all"}
    table = comparison.table()
    assert len(table) == TIMES.size * 4
    assert table[0]["observed"] == table[0]["predicted"] == 30.0
    assert np.isnan(table[0]["z"])  # nothing varies at time 0
    np.testing.assert_allclose(comparison.ssa_mean, comparison.predicted_mean, atol=6 * 3 / np.sqrt(50))


def test_nothing_lies_beyond_what_is_possible(comparison):
    """Counts between 0 and all cubes in that species, waits between 0 and the horizon, shares between 0 and 1."""
    most = 30 // np.array([1, 2, 3, 4])
    assert (comparison.observed_low >= 0).all()
    assert (comparison.observed_high <= most).all()
    few = crossvalidate(calibrated(5), held_out(5, n=2), TIMES, "quadmer", runs=20, groups=99)
    assert (few.observed_low == 0).any()
    assert 0 <= few.first.low <= few.first.high <= TIMES[-1]
    for share in (few.coverage, few.run_coverage):
        assert 0 <= share.low <= share.high <= 1


def test_channels_without_events_predict_neither_infinity_nor_what_their_band_excludes():
    """Only the first join was seen: at the point rates no quadmer ever comes."""
    seen = calibrated(5)
    channels = {
        name: rate if name == "1+1->2" else rate.replace(rate=0.0, events=0, low=None, high=None)
        for name, rate in seen.channels.items()
    }
    rates = seen.replace(channels=channels)
    assert first_passage(rates.apply(line_network()), held_out(5, n=1)[0].initial, "quadmer").mean == np.inf  # control
    found = crossvalidate(rates, held_out(5, n=5), TIMES, "quadmer", runs=20, groups=99)
    assert np.isfinite(found.first.mean)
    assert 0 <= found.first.predicted_mean <= found.first.horizon
    assert (found.low <= found.predicted_mean).all()
    assert (found.predicted_mean <= found.high).all()
    assert (found.high <= 30 // np.array([1, 2, 3, 4]) + 1e-9).all()
    assert (found.predicted_mean[-1] > 0).all()


def test_every_output_states_the_verdict(comparison):
    row = comparison.figures()
    assert row["verdict"] == comparison.verdict.sentence
    assert row["is_consistent"] == comparison.is_consistent
    assert {"p_joins", "p_breaks", "p_scatter_joins", "p_single_runs", "p_misfit", "p_crps", "p_first"} <= row.keys()
    assert all(np.isfinite(value) for value in row.values() if isinstance(value, float))
    told = comparison.to_dict()
    assert told["events"][0].keys() >= {"cubes", "tank", "group", "seen", "expected", "low", "high", "p"}
    assert told["events"][0]["cubes"] == 30


def test_is_json(comparison):
    text = json.dumps(comparison.to_dict(), allow_nan=False)
    again = json.loads(text)
    assert again["table"][0]["z"] is None
    assert len(again["first"]["observed"]) == 10


def test_same_seed_same_result(comparison):
    again = crossvalidate(calibrated(5), held_out(5, n=10), TIMES, "quadmer", 50, 199)
    np.testing.assert_array_equal(again.low, comparison.low)
    assert again.scores == comparison.scores
    assert again.first.p_value == comparison.first.p_value


def test_order_of_the_rates_file_does_not_matter(comparison):
    rates = calibrated(5)
    turned = rates.replace(channels=dict(reversed(rates.channels.items())))
    again = crossvalidate(turned, held_out(5, n=10), TIMES, runs=50, groups=399)
    assert np.abs(again.high - comparison.high).max() < 3
    assert again.first is None


def test_single_run_has_no_interval_but_a_score():
    single = crossvalidate(calibrated(0), held_out(0, n=1), TIMES, "quadmer", runs=50, groups=199)
    assert np.isnan(single.observed_low).all()
    assert np.isfinite(single.scores[-1].score)


def test_refuses_what_are_no_held_out_runs():
    network, rates, runs = line_network(), calibrated(0), held_out(0, n=2)
    restarted = restarted_run(network, runs[0].initial, TIMES[-1], np.random.default_rng(0))
    closed = breaking_run(network, runs[0].initial, TIMES[-1], seed=0)
    other = Network(("A",), ("decay",), [[1]], [[-1]], [1], [1.0])
    for paths, message in (
        ([], "no held-out runs"),
        ([*runs, replace(runs[0], initial=[34, 0, 0, 0])], "path 2 starts from"),
        ([restarted], "was restarted"),
        ([closed], "channels closed"),
        ([*runs, JumpPath(other, [3], [], [], 25.0)], "another network"),
    ):
        with pytest.raises(ValueError, match=message):
            crossvalidate(rates, paths, TIMES)
    with pytest.raises(ValueError, match="observed until 25"):
        crossvalidate(rates, runs, [0.0, 26.0])
    with pytest.raises(ValueError, match="cannot bound a band"):
        crossvalidate(rates, runs, TIMES, groups=20)
    with pytest.raises(ValueError, match="already holds a monomer"):
        crossvalidate(rates, runs, TIMES, "monomer", groups=99)
    with pytest.raises(ValueError, match="unknown species 'quad'"):
        crossvalidate(rates, runs, TIMES, "quad", groups=99)


# Scores


def test_crps_is_its_definition():
    """E|X - x| - E|X - X'| / 2 over the samples."""
    samples = np.random.default_rng(0).poisson([1.0, 4.0, 0.0], size=(50, 3))
    table = crps_table(samples, largest=20)
    for t in range(3):
        x = samples[:, t]
        half_spread = np.abs(x[:, None] - x[None, :]).mean() / 2
        expected = [np.abs(x - value).mean() - half_spread for value in range(table.shape[1])]
        np.testing.assert_allclose(table[t], expected, atol=1e-12)


def test_band_holds_one_more_sample_with_its_chance():
    """Continuous samples: exactly 95 %. 4,000 trials, 6 standard errors."""
    samples = np.random.default_rng(1).normal(size=(400, 4000))
    low, high = central_band(samples[1:])
    inside = (low <= samples[0]) & (samples[0] <= high)
    assert abs(inside.mean() - 0.95) < 6 * np.sqrt(0.95 * 0.05 / 4000)


def test_misfit_ranks_exactly():
    rng = np.random.default_rng(2)
    p_values = [mean_misfit(walks[0], walks[1:])[1] for walks in rng.normal(size=(400, 100, 20, 1)).cumsum(axis=2)]
    assert kstest(p_values, "uniform").pvalue > FALSE_ALARM
    assert mean_misfit(np.full((20, 1), 30.0), rng.normal(size=(99, 20, 1)))[1] == 0.01
    assert mean_misfit(np.zeros((5, 2)), np.zeros((99, 5, 2))) == (0.0, 1.0)


# First times


def exponential_runs(n, end, rate=0.1, seed=0):
    """Two A that join: the first B comes after an exponential time."""
    network = Network(("A", "B"), ("join",), [[2, 0]], [[-2, 1]], [1], [rate])
    times = np.random.default_rng(seed).exponential(1 / rate, n)
    paths = [JumpPath(network, [2, 0], [t] if t < end else [], [0] if t < end else [], end) for t in times]
    return network, times, paths


def test_censored_first_times_by_hand():
    network, times, paths = exponential_runs(50, 12.0)
    first = compare_first_times(network, paths, "B")
    assert first.censored == np.count_nonzero(times > 12) > 5
    assert first.observed_mean == pytest.approx(np.minimum(times, 12).mean())
    assert first.low < first.observed_mean < first.high
    assert first.predicted_mean == pytest.approx(10 * (1 - np.exp(-1.2)), rel=1e-4)
    assert (first.mean, first.sd) == pytest.approx((10.0, 10.0))
    np.testing.assert_allclose(first.curve, 1 - np.exp(-first.curve_times / 10), atol=1e-12)


def test_later_times_of_longer_runs_are_censored_too():
    """The shortest run sets the horizon, or the mean would favour the runs watched for longer."""
    network, _, paths = exponential_runs(20, 12.0)
    first = compare_first_times(network, [*paths, replace(paths[0], times=[30.0], channels=[0], end=40.0)], "B")
    assert first.horizon == 12.0
    assert np.isnan(first.observed[-1])


def test_without_censoring_it_is_kolmogorov_and_smirnovs():
    levels = np.random.default_rng(3).random(30)
    distance, p_value = censored_ks_test(levels, 1.0)
    expected = kstest(levels, "uniform")
    assert distance == pytest.approx(expected.statistic)
    assert p_value == pytest.approx(expected.pvalue, abs=0.03)


@pytest.mark.parametrize("limit", [0.3, 0.8])
def test_censored_test_has_its_size(limit):
    rng = np.random.default_rng(4)
    right, wrong = [], []
    for i in range(60):
        levels = rng.random(40)
        right.append(censored_ks_test(np.where(levels <= limit, levels, np.inf), limit, seed=i)[1])
        early = levels**2
        wrong.append(censored_ks_test(np.where(early <= limit, early, np.inf), limit, seed=i)[1])
    assert kstest(right, "uniform").pvalue > FALSE_ALARM
    assert kstest(wrong, "uniform").pvalue < FALSE_ALARM


def test_drawn_null_is_the_exact_one_where_the_rates_are_exact():
    network, _, paths = exponential_runs(25, 12.0, seed=9)
    exact = compare_first_times(network, paths, "B")
    drawn = compare_first_times(network, paths, "B", rate_draws=np.full((3000, 1), 0.1))
    assert drawn.p_value == pytest.approx(exact.p_value, abs=6 * 0.5 / np.sqrt(3000))


def test_uncertain_rates_excuse_what_exact_ones_do_not():
    network, _, paths = exponential_runs(100, 60.0, rate=0.17, seed=1)
    predicted = network.with_rates([0.1])
    draws = np.random.default_rng(5).gamma(3.5, 0.1 / 3.5, size=(999, 1))
    assert compare_first_times(predicted, paths, "B").p_value < 1e-3
    assert compare_first_times(predicted, paths, "B", rate_draws=draws).p_value > 0.05


def test_what_the_rates_call_impossible_is_seen():
    """No event in calibration gives the rate 0; if the species comes all the same, only that uncertainty excuses it."""
    network, _, paths = exponential_runs(30, 12.0, seed=1)
    never = network.with_rates([0.0])
    first = compare_first_times(never, paths, "B")
    assert first.mean == np.inf
    assert first.p_value < 1e-3
    excused = compare_first_times(never, paths, "B", rate_draws=np.random.default_rng(0).gamma(0.5, 0.5, (999, 1)))
    assert excused.p_value > 0.05


# Without an exact solution


@pytest.fixture(scope="module")
def both_ways():
    """The same comparison with the exact solution, and as where the states are too many for it."""
    made = [
        crossvalidate(calibrated(5), held_out(5, n=10), TIMES, "quadmer", groups=199, seed=3, exact_states=limit)
        for limit in (200_000, 50)
    ]
    assert [each.is_exact for each in made] == [True, False]
    return made


def test_sampled_predictions_say_how_well_they_are_known(both_ways):
    """Within 6 of their standard errors of the exact ones: 28 numbers, false alarm 6e-8 were the errors normal."""
    exact, sampled = both_ways
    np.testing.assert_array_equal(exact.predicted_error, 0.0)
    assert sampled.predicted_error[1:].max() > 0.01
    off = np.abs(sampled.predicted_mean - exact.predicted_mean)
    assert (off <= 6 * sampled.predicted_error + 1e-12).all()
    assert (off[1:] > 0).any()
    np.testing.assert_allclose(sampled.predicted_sd[1:], exact.predicted_sd[1:], rtol=0.2, atol=0.05)
    held = (sampled.low < sampled.predicted_mean) & (exact.low < exact.predicted_mean)
    assert held.any()
    np.testing.assert_array_equal(sampled.low[held], exact.low[held])  # bands, misfit and scores never needed it
    assert sampled.p_misfit == exact.p_misfit
    finite = np.isfinite(exact.z) & np.isfinite(sampled.z)
    assert np.abs(sampled.z - exact.z)[finite].max() < 0.5


def test_sampled_first_times_say_how_well_they_are_known(both_ways):
    exact, sampled = (each.first for each in both_ways)
    assert (exact.samples, exact.curve_error, exact.predicted_error) == (0, 0.0, 0.0)
    assert not sampled.is_exact
    assert 0.004 < sampled.curve_error <= 0.005
    assert abs(sampled.predicted_mean - exact.predicted_mean) < 6 * sampled.predicted_error
    assert np.abs(sampled.curve - exact.curve).max() < 6 * sampled.curve_error
    assert np.isnan(sampled.mean)
    assert sampled.p_value == pytest.approx(exact.p_value, abs=0.15)  # another null sample of 199 groups


def test_sampled_predictions_see_wrong_rates_too():
    found = crossvalidate(
        calibrated(0, length=3000.0), held_out(1, n=100, factor=1.3), TIMES, "quadmer", seed=1,
        exact_states=50, groups=399, most_groups=4999,
    )  # fmt: skip
    assert not found.is_consistent
    assert np.nanmax(np.abs(found.z)) > 5
    assert found.first.p_value < 0.01


def test_sampled_predictions_in_tables_and_pictures(both_ways):
    from matplotlib.figure import Figure

    _, sampled = both_ways
    told = json.loads(json.dumps(sampled.to_dict(), allow_nan=False))
    assert told["is_exact"] is False
    assert told["summary"]["cpu_exact_s"] is None
    assert told["summary"]["first_predicted_error"] > 0
    assert told["first"]["samples"] == 10_000
    axes = [Figure().add_subplot() for _ in range(2)]
    sampled.plot(axes[:1], ["quadmer"])
    sampled.first.plot(axes[1])
    labels = [text.get_text() for ax in axes for text in ax.get_legend().get_texts()]
    assert labels[0] == "SSA, 1000 runs, 95 % band for 10 runs"
    assert not any("exact" in label for label in labels)
