"""Single runs next to a prediction: exact, the same whatever else is asked, cut where they are too long."""

import json
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from command_line import run_here
from matplotlib.figure import Figure
from numpy.testing import assert_array_equal

from kinetics import Model, Network, predict, sample_path, simulate
from kinetics.network.laws import Event
from kinetics.predicting import Job, trajectories
from kinetics.predicting.observables import Observables
from kinetics.predicting.trajectories import sample_trajectories

PAIR = "bind: A + B <-> AB, 0.01, 0.1\nA = 20\nB = 10\n"
MODEL = Model(Network.from_text(PAIR))
COMMAND = ["predict", "pair.rxn", "--seed", 3]


@pytest.fixture
def folder(tmp_path):
    (tmp_path / "pair.rxn").write_text(PAIR, encoding="utf-8")
    (tmp_path / "growth.rxn").write_text("A -> 2 A, 1\nA = 10\n", encoding="utf-8")
    return tmp_path


def test_they_are_the_jump_paths_of_these_numbers():
    made = sample_trajectories(Job(MODEL, [5.0, 30.0], seed=3), 4)
    for run, path in enumerate(made.paths):
        expected = sample_path(MODEL, None, 30.0, seed=3, run=run)
        assert_array_equal(path.times, expected.times)
        assert_array_equal(made.steps(run)[1], expected.states)
    # the ensemble of ssa has the same runs, others have not
    grid = np.linspace(0.0, 30.0, 7)
    counts = simulate(MODEL, "ssa", None, grid, runs=4, seed=3).counts
    assert_array_equal([path.at(grid) for path in made.paths], counts)
    assert not np.array_equal(made.paths[0].at(grid), counts[1])
    other = sample_trajectories(Job(MODEL, [30.0], seed=4), 1)
    assert not np.array_equal(other.paths[0].times, made.paths[0].times)


def test_they_are_the_same_whatever_else_is_asked(folder):
    told = [
        run_here(*COMMAND, *more, "--json", cwd=folder).json["trajectories"]["runs"]
        for more in (
            ["--times", 9, "--trajectories", 3],
            ["--times", 1, 9, "--trajectories", 2, "--method", "lockstep", "--threads", 1],
            ["--duration", 9, "--trajectories", 2, "--accuracy", "5%"],
        )
    ]
    assert [len(runs) for runs in told] == [3, 2, 2]
    assert told[0][:2] == told[1] == told[2]
    shown = run_here(*COMMAND, "--times", 9, "--trajectories", 2, "--show", "AB", "--json", cwd=folder).json
    assert [run["times"] for run in shown["trajectories"]["runs"]] == [run["times"] for run in told[1]]
    assert shown["trajectories"]["runs"][0]["counts"] == [row[2:] for row in told[1][0]["counts"]]
    alone, among = (
        run_here(*COMMAND, "--times", 9, *more, "--json", cwd=folder).json for more in ((), ("--trajectories", 2))
    )
    assert alone["trajectories"] is None
    assert alone["mean"] == among["mean"]
    longer = run_here(*COMMAND, "--times", 20, "--trajectories", 1, "--json", cwd=folder).json["trajectories"]["runs"]
    n = len(told[0][0]["times"])
    assert longer[0]["times"][:n] == told[0][0]["times"]


def test_table_and_figure_hold_every_event(folder):
    options = ("--trajectories", 2, "--trajectories-csv", "runs.csv", "--csv", "means.csv", "--plot", "a.svg")
    told = run_here(*COMMAND, "--times", 9, *options, "--json", cwd=folder).json["trajectories"]["runs"]
    table = pd.read_csv(folder / "runs.csv")
    assert list(table.columns) == ["run", "time", "event", "species", "copies"]
    for run, each in enumerate(told):
        rows = table[(table.run == run) & (table.species == "AB")]
        assert_array_equal(rows["time"], [*each["times"], each["end"]])
        assert_array_equal(rows["copies"][:-1], np.array(each["counts"])[:, 2])
        gains = np.where(rows["event"][1:-1] == "bind", 1, -1)
        assert_array_equal(np.diff(rows["copies"][:-1]), gains)
    made = predict(MODEL, times=[0.0, 9.0], runs=20, seed=3, trajectories=2)
    ax = made.plot(Figure().add_subplot())
    steps = [line for line in ax.lines if line.get_drawstyle() == "steps-post"]
    assert len(steps) == 2 * 3
    means = [line for line in ax.lines if line.get_label() in MODEL.network.species]
    assert max(line.get_zorder() for line in steps) < min(line.get_zorder() for line in means)
    assert_array_equal(steps[2].get_ydata()[:-1], made.trajectories.steps(0)[1][:, 2])
    assert "single run" in [text.get_text() for text in ax.get_legend().get_texts()]
    assert not predict(MODEL, times=[9.0], runs=20).trajectories


def test_a_run_of_too_many_events_is_cut_and_that_is_said(folder, monkeypatch):
    monkeypatch.setattr(trajectories, "MOST_EVENTS", 40)
    growth = Job(Model(Network.from_text("A -> 2 A, 1"), {"A": 10}), [60.0], seed=1)
    made = sample_trajectories(growth, 2)
    assert made.cut == (0, 1)
    for run, path in enumerate(made.paths):
        assert path.times.size == 19
        expected = sample_path(growth.model, None, path.end, seed=1, run=run)
        assert_array_equal(path.times, expected.times)
    assert "2 of 2 trajectories cut before event 20" in made.notes[1]
    # control: within the limit nothing is cut
    assert sample_trajectories(Job(growth.model, [0.5], seed=1), 2).cut == ()
    told = run_here("predict", "growth.rxn", "--times", 0.5, 60, "--trajectories", 2, "--runs", 20, cwd=folder)
    assert told.code == 4
    assert "trajectories cut before event 20" in told.out


def test_sums_of_counts_are_those_of_the_paths():
    sums = Observables.of(MODEL.network, {"all A": {"A": 1, "AB": 1}, "AB": {"AB": 1}})
    made = sample_trajectories(Job(MODEL, [9.0], sums, seed=3), 1)
    _, counts = made.steps(0)
    assert (counts[:, 0] == 20).all()
    assert_array_equal(counts[:, 1], made.paths[0].states[:, 2])


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (["pair.rxn", "--trajectories", 3, "--method", "transient"], "--method transient solves the master equation"),
        (["pair.rxn", "--trajectories", 101], "101 trajectories; expected at most 100"),
        (["pair.rxn", "--trajectories", -1], "--trajectories"),
        (["pair.rxn", "--trajectories-csv", "a.csv"], "--trajectories-csv, but no --trajectories"),
    ],
)
def test_what_cannot_be_is_refused(words, says, folder):
    done = run_here("predict", *words, "--times", 3, cwd=folder)
    assert (done.code, done.out) == (2, "")
    assert says in done.err
    assert not (folder / "a.csv").exists()


def test_events_that_set_counts_are_in_no_jump_path():
    dosed = replace(MODEL.network, events=(Event("dose", "t >= 2", {"A": "A + 5"}),))
    with pytest.raises(ValueError, match="event 'dose' sets counts; leave them out"):
        predict(Model(dosed), times=[3.0], runs=5, trajectories=1)
    assert predict(Model(dosed), times=[3.0], runs=5).runs == 5


def test_json_ends_where_a_run_does(folder):
    done = run_here(*COMMAND, "--times", 9, "--trajectories", 1, "--json", cwd=folder)
    (run,) = json.loads(done.out)["trajectories"]["runs"]
    assert (run["end"], run["cut"]) == (9.0, False)
    assert run["times"][0] == 0.0
    assert run["counts"][0] == [20, 10, 0]
    assert np.all(np.diff(run["times"]) > 0)
