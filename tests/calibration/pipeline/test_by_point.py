"""Rates at each point of a study, and first times predicted from the other points' rates."""

from dataclasses import replace

import numpy as np
import pytest
from matplotlib.figure import Figure
from synthetic_runs import line_network

from calibration.pipeline import by_point
from calibration.pipeline.by_point import PointRuns, most_seen, rates_by_point
from calibration.validating.first_times import compare_first_times
from kinetics import first_passage
from kinetics.sampling import sample_path

CAP = 40.0
SIZES = (10, 16, 24)


@pytest.fixture(autouse=True)
def cheaper(monkeypatch):
    """Half the draws of the rates, so p-values from 1 / 250, and a quarter of the runs behind the predicted limits."""
    monkeypatch.setattr(by_point, "GROUPS", 249)
    monkeypatch.setattr(by_point, "RUNS", 50)


def full_runs(network, cubes, n, seed):
    return [sample_path(network, {"monomer": cubes}, CAP, seed=seed, run=i) for i in range(n)]


def ended(path, species="quadmer"):
    """The run as it is when its first copy ends it."""
    time = path.first_time(species)
    if np.isnan(time):
        return path
    keep = path.times <= time
    return replace(path, times=path.times[keep], channels=path.channels[keep], end=time)


def points_of(factor_at_last=1.0, runs=60):
    network, points = line_network(), []
    for i, cubes in enumerate(SIZES):
        factor = factor_at_last if cubes == SIZES[-1] else 1.0
        paths = full_runs(network.with_rates(network.known_rates * factor), cubes, runs, seed=100 + i)
        known = tuple(replace(ended(path), network=network) for path in paths)
        points.append(PointRuns(f"number={cubes}", "one scene", known))
    return points


def test_rates_of_one_tank_agree_and_predict_the_others():
    found = rates_by_point(points_of(), "quadmer", CAP, seed=3)
    known = dict(zip(line_network().channels, line_network().known_rates, strict=True))
    level = 1 - 1e-6 / (len(SIZES) * len(known))  # so that one false alarm in a million runs of this test
    for point in found.points:
        for estimate in point.calibration.estimates:
            if estimate.is_measured:
                low, high = estimate.interval(level)
                assert low <= known[estimate.channel] <= high
        assert point.first.p_value > 1e-3  # a fixed seed
        assert point.low <= point.first.predicted_mean <= point.high
        assert point.title not in point.rates_from
        assert len(point.rates_from) == len(SIZES) - 1
    assert most_seen(found)[0] == "1+1->2"


def test_a_point_with_other_rates_stands_out():
    found = rates_by_point(points_of(factor_at_last=2.0), "quadmer", CAP, seed=3)
    assert found.points[-1].first.p_value < 0.005
    low = found.points[0].calibration["1+1->2"].interval(0.999)
    high = found.points[-1].calibration["1+1->2"].interval(0.999)
    assert low[1] < high[0]


def test_points_of_other_scenes_are_not_predicted():
    points = [replace(point, kin=point.title) for point in points_of(runs=3)]
    found = rates_by_point(points, "quadmer", CAP)
    assert all(point.first is None for point in found.points)
    assert found.first_table() == []
    assert {row["point"] for row in found.rates_table()} == {point.title for point in points}


def test_a_run_that_its_first_copy_ended_says_as_much_as_the_whole_run():
    network = line_network()
    paths = full_runs(network, 16, 20, seed=5)
    cut = [ended(path) for path in paths]
    assert any(path.end < CAP for path in cut)
    whole = compare_first_times(network, paths, "quadmer", seed=1)
    short = compare_first_times(network, cut, "quadmer", seed=1, horizon=CAP)
    np.testing.assert_array_equal(whole.observed, short.observed)
    assert (whole.p_value, whole.observed_mean, whole.horizon) == (short.p_value, short.observed_mean, CAP)
    # without the cap such runs would be cut to the quickest of them
    assert compare_first_times(network, cut, "quadmer", seed=1).horizon < CAP


def test_a_run_that_ends_too_soon_is_refused():
    network = line_network()
    paths = full_runs(network, 10, 20, seed=5)
    with pytest.raises(ValueError, match="horizon = 50, but a run without a copy ends at 40 tu"):
        compare_first_times(network, paths, "quadmer", horizon=50.0)


def test_what_the_rates_leave_open_is_what_exact_means_say(monkeypatch):
    """With 20 runs a draw, sampling alone would make the limits twice as wide: the control."""
    network, n = line_network(), 100
    rng = np.random.default_rng(8)
    draws = network.known_rates * rng.gamma(30.0, 1 / 30.0, (n, 8))
    grid = np.linspace(0, CAP, 401)
    means = []
    for drawn in draws:
        cdf = first_passage(network.with_rates(drawn), {"monomer": 12}, "quadmer").cdf(grid)
        means.append(np.trapezoid(1 - cdf, grid))
    monkeypatch.setattr(by_point, "RUNS", 20)
    low, high = by_point._left_open(network, network.state({"monomer": 12}), "quadmer", CAP, draws, seed=2)
    exact_low, exact_high = np.quantile(means, (0.025, 0.975))
    middle = np.mean(means)
    assert abs(low - exact_low) < 0.5 * (middle - exact_low)
    assert abs(high - exact_high) < 0.5 * (exact_high - middle)


def test_figures_show_what_the_tables_say(monkeypatch):
    monkeypatch.setattr(by_point, "GROUPS", 39)
    found = rates_by_point(points_of(runs=12), "quadmer", CAP)
    ax = found.plot(Figure().add_subplot(), "1+1->2")
    assert [label.get_text() for label in ax.get_yticklabels()] == [f"number={n}" for n in SIZES]
    ax = found.plot_first(Figure().add_subplot())
    assert [text.get_text()[:3] for text in ax.texts] == ["p ="] * len(SIZES)


STUDY = """name = "own"
title = "own"
scene = "line4"
cubes = 10
runs = 2
cap = 1.0
typical = 5.0

[[factors]]
name = "number"
label = "cubes"
setting = "number"
levels = [8.0, 12.0]
"""


def test_the_command_reads_what_the_study_made(wellmixed_here, tmp_path):
    (tmp_path / "own.toml").write_text(STUDY)
    common = ["own.toml", "--runs-folder", "runs", "--json"]
    assert wellmixed_here("study", "first-times", *common, "--seed", 4, cwd=tmp_path).code == 0
    done = wellmixed_here("study", "rates", *common, "--seed", 4, "--out", "told", cwd=tmp_path)
    told = done.json
    assert {row["point"] for row in told["rates"]} == {"number=8", "number=12"}
    assert [row["runs"] for row in told["first_times"]] == [2, 2]
    assert all((tmp_path / path).stat().st_size > 0 for path in told["written"])
    (tmp_path / "mine").mkdir()
    other = wellmixed_here("study", "rates", "own.toml", "--runs-folder", "mine", cwd=tmp_path)
    assert (other.code, list((tmp_path / "mine").iterdir())) == (2, [])
    assert "mine holds no runs" in other.err
    none = wellmixed_here("study", "rates", *common, "--seed", 5, cwd=tmp_path)
    assert none.code == 2
    assert "holds no run of own.toml at number=8 with seed 5; make them by: wellmixed study first-times" in none.err
