import json
from dataclasses import replace
from functools import partial
from itertools import count

import numpy as np
import pytest
from click.testing import CliRunner
from known_systems import decay, line, network
from matplotlib.figure import Figure
from numpy.testing import assert_allclose
from scipy.stats import binom, wasserstein_distance

from kinetics import Direct, Lockstep, Transient, simulate
from kinetics.commands import accuracy
from kinetics.network import Network
from kinetics.predicting.solved_ways import Projection
from kinetics.sampling import run_source
from kinetics.sampling.run_source import RunSource
from kinetics.trust.accuracy import diagram
from kinetics.trust.accuracy.curves import CURVES, Curve, Task, asked, sampled
from kinetics.trust.accuracy.diagram import measure
from kinetics.trust.accuracy.distances import Certainty, Marginals, sampling_floor
from kinetics.trust.accuracy.peers import ExpmMultiply, rate_equation
from kinetics.trust.accuracy.plot import draw
from wellmixed import main

TIMES = np.linspace(0.0, 200.0, 11)
START = [12, 0, 0, 0]
MANY = Network.from_text("A -> B, 1\nB -> A, 1"), np.array([10**6, 0])  # cannot be solved


@pytest.fixture(scope="module")
def small():
    """Line of four from 12 cubes, with up to a thousand runs."""
    few = [replace(c, settings=c.settings[:2]) if c.is_sampled else c for c in CURVES]
    return measure("line", line(), START, TIMES, seed=1, curves=few)


def ticking(seconds=0.001):
    """A clock that goes on by so much at each reading: everything costs the same, on any machine."""
    readings = count()
    return lambda: seconds * next(readings)


def binomial(n, p):
    return Marginals([binom.pmf(np.arange(n + 1), n, p)[None, :]])


def test_distances_in_closed_form():
    law, other = binomial(10, 0.3), binomial(10, 0.5)
    x = np.arange(11)
    found = law.distance(other)
    assert_allclose(found.copies, wasserstein_distance(x, x, law.tables[0][0], other.tables[0][0]), rtol=1e-12)
    assert_allclose(found.copies, 2.0, rtol=1e-12)  # one law lies above the other: the difference of the means
    assert_allclose(found.mean, 2.0, rtol=1e-12)
    assert_allclose(found.total_variation, abs(law.tables[0] - other.tables[0]).sum() / 2, rtol=1e-12)
    assert law.distance(law) == (0.0, 0.0, 0.0)


def test_tables_of_unequal_length_and_missing_probability():
    law = binomial(4, 0.5)
    shorter = Marginals([law.tables[0][:, :4]])  # 1/16 of the probability, that of 4 copies, is missing
    assert_allclose(shorter.distance(law), (0.0, 1 / 16, 0.0), atol=1e-15)
    cut = Marginals([np.array([[0.0, *law.tables[0][0, 1:]]])])  # that of no copies: taken to be at 4
    assert_allclose(cut.distance(law), (4 / 16, 1 / 16, 4 / 16), rtol=1e-12)


def test_largest_over_times_and_species():
    exact = Marginals([np.array([[1.0, 0.0], [0.5, 0.5]]), np.array([[1.0], [1.0]])])
    found = Marginals([np.array([[1.0, 0.0], [0.2, 0.8]]), np.array([[0.9, 0.1], [1.0, 0.0]])])
    assert_allclose(found.distance(exact).copies, 0.3)


def test_a_number_is_as_far_as_the_counts_are_from_it():
    law = binomial(10, 0.3)
    found = Certainty(np.array([[3.25]])).distance(law)
    assert_allclose(found.copies, law.tables[0][0] @ abs(np.arange(11) - 3.25), rtol=1e-12)
    assert_allclose(found.mean, 0.25, rtol=1e-12)
    assert np.isnan(found.total_variation)


def test_sampling_floor_is_the_mean_of_many_samples():
    law = Transient().solve(decay(), [20], [0.7])
    exact = Marginals([law.marginal("X")])
    samples = simulate(decay(), Lockstep(), [20], [0.7], runs=100_000, seed=3).counts[:, 0, 0].reshape(1000, 100)
    shares = np.array([np.bincount(row, minlength=21) for row in samples]) / 100
    distances = [Marginals([share[None, :]]).distance(exact).copies for share in shares]
    floor = sampling_floor(exact, 100)
    error = np.std(distances) / np.sqrt(1000)
    assert abs(np.mean(distances) - floor) < 4.9 * error
    # The control: the floor of a fifth fewer runs would be seen to be another.
    assert abs(np.mean(distances) - sampling_floor(exact, 80)) > 4.9 * error


def test_errors_of_sampling_fall_with_the_root_of_the_runs(small):
    for curve in ("SSA, direct", "SSA, lockstep", "SSA, leaping"):
        # 20 repeats each leave the exponent a standard error of about 0.05.
        assert abs(small.slopes()[curve] + 0.5) < 0.25
        for point in small.of(curve):
            assert point.low <= point.error.copies <= point.high
            assert point.bound is None
            # The largest over times and species is above the floor, and not by much.
            assert 1 < point.error.copies / small.floors[int(point.setting)] < 3
    direct, lockstep = (small.of(name) for name in ("SSA, direct", "SSA, lockstep"))
    assert [p.error for p in direct] == [p.error for p in lockstep]  # the same runs


def test_proven_bounds_hold_and_tolerances_are_kept(small):
    for curve in ("fsp", "transient"):
        points = small.of(curve)
        assert len(points) == 6
        for point in points:
            assert point.error.copies <= point.bound + small.reference_bound
            assert point.error.copies <= 12 * point.setting + small.reference_bound
    (dense,) = small.of("dense")
    assert dense.error.copies <= dense.bound + small.reference_bound
    assert small.is_proven
    assert 0 < small.reference_bound < 1e-10


def test_peers_agree_with_the_exact_distribution(small):
    (peer,) = small.of("scipy expm_multiply")
    assert peer.error.copies < 1e-11
    assert peer.bound is None
    (deterministic,) = small.of("rate equation")
    assert deterministic.error.copies > 0.5
    assert deterministic.error.mean < deterministic.error.copies


def test_rate_equation_in_closed_form():
    # 2 X -> nothing at rate k: dx/dt = -2 k x^2 / 2, so x = x0 / (1 + k x0 t)
    pair = network(("X",), {"meet": ((2,), (0,))}, [0.03])
    times = np.linspace(0.0, 5.0, 6)
    assert_allclose(rate_equation(pair, [100], times)[:, 0], 100 / (1 + 0.03 * 100 * times), rtol=1e-7)
    product = replace(pair, combinations="product")
    assert_allclose(rate_equation(product, [100], times)[:, 0], 100 / (1 + 2 * 0.03 * 100 * times), rtol=1e-7)


def test_no_run_is_used_twice(monkeypatch):
    used, counts = [], RunSource.counts

    def noted(source, grid, runs, first_run=0, threads=None, watch=None):
        used.extend(range(first_run, first_run + runs))
        return counts(source, grid, runs, first_run, threads, watch)

    monkeypatch.setattr(RunSource, "counts", noted)
    curve = Curve("ssa", "runs", (10.0, 100.0, 1000.0), sampled(Direct()))
    task = diagram.Task(decay(), np.array([1]), np.array([0.1]), 0)
    for setting in curve.settings:
        for repeat in range(curve.repeats(setting)):
            curve.make(task, setting, repeat)
    assert len(used) == 20 * 1110
    assert len(set(used)) == len(used)


def test_a_biased_sampler_stands_out():
    # The control: with a rate 5 % off, more runs do not help.
    class Biased(Direct):
        def prepared(self, network):
            return super().prepared(network.with_rates(1.05 * network.known_rates))

    times = np.linspace(0.0, 2.0, 6)
    curves = [Curve(m.name, "runs", (1e4,), sampled(m)) for m in (Direct(), Biased())]
    right, wrong = measure("decay", decay(), [100], times, curves=curves).points
    assert wrong.error.copies > 3 * right.error.copies


def test_what_does_not_fit_the_budget_is_left_out_and_reported():
    made = measure("line", line(), START, TIMES, budget=1e-9, clock=ticking())
    assert not made.points
    assert {x.curve for x in made.left_out} == {curve.name for curve in CURVES}
    assert all("over budget" in x.reason for x in made.left_out)
    assert "left out" in str(made)
    assert draw(made, Figure().add_subplot()).get_xlabel() == "CPU time (s), one thread"


def test_ctrl_c_leaves_what_was_finished():
    work = [0.0]

    def dear(task, setting, repeat):
        if task.times.size == TIMES.size:
            raise KeyboardInterrupt
        work[0] += 1.0
        return ExpmMultiply().solve(*task[:3])

    quick = CURVES[-1]
    curves = [Curve("dear", "", (0.0,), dear), quick]
    found = measure("line", line(), START, TIMES, curves=curves, clock=lambda: work[0])
    assert not found.is_complete
    assert [point.curve for point in found.points] == [quick.name]
    assert "interrupted" in str(found)


@pytest.mark.parametrize("curve", [curve for curve in CURVES if curve.is_sampled])
def test_ctrl_c_is_heard_from_methods_that_keep_what_they_have(curve, monkeypatch):
    """Fewer runs than were asked for are no point, and the rest is not begun."""
    counts, tried = RunSource.counts, []

    def interrupt(source, grid, runs, first_run=0, threads=None, watch=None):
        tried.append(runs)
        if len(tried) > 4:
            raise KeyboardInterrupt
        return counts(source, grid, runs, first_run, threads, watch)

    monkeypatch.setattr(RunSource, "counts", interrupt)
    monkeypatch.setattr(run_source, "BLOCK_BYTES", 1)
    with pytest.raises(KeyboardInterrupt):
        curve.make(Task(*MANY, TIMES / 1e4, 1), curve.settings[1], 0)
    assert len(tried) == 5


def test_ctrl_c_is_heard_from_a_prediction_that_has_made_some_runs(monkeypatch):
    made = []

    def interrupt(way):
        made.append(way)
        raise KeyboardInterrupt

    monkeypatch.setattr(Projection, "attempt", interrupt)
    with pytest.raises(KeyboardInterrupt):
        asked(Task(line(), np.array([1000, 0, 0, 0]), np.array([50.0]), 1), 1e-3, 0)
    assert made


def test_a_method_that_refuses_is_reported():
    def refuse(task, setting, repeat):
        raise ValueError("not this network")

    found = measure("line", line(), START, TIMES, curves=[Curve("picky", "", (0.0,), refuse)])
    assert found.left_out[0].reason == "not this network"


def test_table_plot_and_numbers(small):
    table = small.to_dataframe()
    assert len(table) == len(small.points) == 3 * 2 + 4 * 6 + 4 + 3
    asked = small.of("predict --accuracy")
    assert [point.chosen for point in asked] == ["solved"] * 4  # of 34 states
    assert all(point.chosen is None for point in small.points if point not in asked)
    assert json.loads(json.dumps(small.as_dict()["points"], default=float))[0]["method"] == "SSA, direct"
    ax = Figure().add_subplot()
    assert draw(small, ax) is ax
    labels = ax.get_legend_handles_labels()[1]
    assert "sampling floor of SSA" in " ".join(labels)
    assert "below the proven bound of the reference" in labels


def test_points_that_nearly_meet_share_a_label_and_others_do_not(small):
    def labels(spread):
        points = [
            replace(p, cpu_seconds=spread**i, error=small.points[0].error)
            for i, p in enumerate(small.of("SSA, direct"))
        ]
        twins = [replace(p, curve=name) for name in ("SSA, direct", "SSA, lockstep") for p in points]
        apart = [replace(p, cpu_seconds=p.cpu_seconds * (1 if p.curve == "SSA, direct" else spread)) for p in twins]
        axes = draw(replace(small, points=tuple(apart)), Figure().add_subplot())
        return sorted(text.get_text() for text in axes.texts)

    assert labels(1.5) == ["1e2", "1e3"]
    assert labels(10.0) == ["1e2", "1e2", "1e3", "1e3"]


def test_command(tmp_path, monkeypatch):
    # At 20 ms a call, a run seems to cost 1/8 ms: 20 times 1000 runs fit into 20 s, 20 times 10,000 do not.
    monkeypatch.setattr(accuracy, "measure", partial(measure, clock=ticking(0.02)))
    options = ["trust", "accuracy", "kinetics", "line4", "--rates", "table3", "--cubes", "8", "--duration", "20"]
    options += ["--budget", "0.33", "--csv", str(tmp_path / "a.csv"), "--plot", str(tmp_path / "a.svg"), "--json"]
    result = CliRunner().invoke(main, options)
    assert result.exit_code == 0, result.output
    data = json.loads(result.stdout)
    assert "predicted cost" in result.stderr
    assert data["complete"]
    assert {point["method"] for point in data["points"]} == {curve.name for curve in CURVES}
    assert {x["setting"] for x in data["left_out"]} == {"1e4", "1e5", "1e6"}
    assert (tmp_path / "a.csv").read_text(encoding="utf-8").startswith("method,knob,setting,repeats,cpu_seconds")
    assert "<svg" in (tmp_path / "a.svg").read_text(encoding="utf-8")


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--rates", "table3"], "either --cubes 60 or --initial"),
        (["--rates", "table3", "--cubes", "8", "--duration", "0"], "--duration 0; expected a positive number"),
        (["--rates", "table3", "--cubes", "8", "--duration", "nan"], "--duration nan; expected"),
        (["--rates", "table3", "--cubes", "8", "--budget", "0"], "0.0 is not in the range"),
        (["--rates", "table9", "--cubes", "8"], "unknown rates 'table9'"),
    ],
)
def test_bad_input(arguments, message):
    result = CliRunner().invoke(main, ["trust", "accuracy", "kinetics", "line4", *arguments])
    assert result.exit_code == 2
    assert message in result.output


def test_bad_times():
    with pytest.raises(ValueError, match="at least 6"):
        measure("line", line(), START, [0.0, 1.0])
    with pytest.raises(ValueError, match="evenly spaced"):
        ExpmMultiply().solve(line(), START, [0.0, 1.0, 3.0])
    with pytest.raises(ValueError, match="evenly spaced"):
        ExpmMultiply().solve(line(), START, [1.0, 2.0])


def test_a_space_without_end_is_refused_by_its_states(monkeypatch):
    birth = network(("X",), {"birth": ((0,), (1,))}, [1.0])
    monkeypatch.setattr(diagram, "REFERENCE", Transient(1e-16, max_states=100))
    with pytest.raises(ValueError, match="over 100 states"):
        measure("birth", birth, [0], TIMES, curves=CURVES[:1])
