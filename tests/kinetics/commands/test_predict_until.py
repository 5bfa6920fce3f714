"""`predict --until`: first times of a condition next to the counts, from runs that end there."""

import json

import numpy as np
import pytest
from command_line import run_here
from numpy.testing import assert_array_equal

from kinetics import Model, Network, simulate
from kinetics.commands import until as until_module

PAIR = "bind: A + B <-> AB, 0.01, 0.1\nA = 20\nB = 10\n"
COMMAND = ["predict", "pair.rxn", "--seed", 3, "--times", 5, 20]


@pytest.fixture
def folder(tmp_path):
    (tmp_path / "pair.rxn").write_text(PAIR, encoding="utf-8")
    (tmp_path / "decay.rxn").write_text("A -> 0, 0.1\nA = 1\n", encoding="utf-8")
    (tmp_path / "growth.rxn").write_text("A -> 2 A, 1\nA = 10\n", encoding="utf-8")
    return tmp_path


def test_first_times_are_those_of_runs_that_end_there(folder):
    told = run_here(*COMMAND, "--runs", 300, "--until", "AB >= 8", "--json", cwd=folder).json
    found = simulate(Network.from_text(PAIR), "auto", None, 20.0, 300, 3, until="AB >= 8")
    first = told["first_time"]
    assert (first["runs"], first["censored"], first["horizon"]) == (300, found.censored, 20.0)
    assert first["mean"]["value"] == found.mean
    assert first["quantiles"]["0.5"]["value"] == found.median
    assert first["probability"]["value"] == 1 - found.censored / 300
    # the counts are those of runs that go on
    plain = run_here(*COMMAND, "--runs", 300, "--json", cwd=folder).json
    assert plain["first_time"] is None
    assert plain["mean"] == told["mean"]
    other = run_here(*COMMAND, "--runs", 300, "--until", "AB >= 7", "--json", cwd=folder).json["first_time"]
    assert other["mean"]["value"] < first["mean"]["value"]


def test_a_decay_has_its_exponential_time(folder):
    words = ["predict", "decay.rxn", "--times", 40, "--runs", 4000, "--until", "A == 0", "--json"]
    first = run_here(*words, cwd=folder).json["first_time"]
    median = first["quantiles"]["0.5"]
    assert median["low"] < 10 * np.log(2) < median["high"]
    assert first["probability"]["low"] < 1 - np.exp(-4) < first["probability"]["high"]


def test_it_is_said_briefly(folder):
    out = run_here(*COMMAND, "--runs", 300, "--until", "AB >= 5 & A < 16", cwd=folder).out
    assert "AB >= 5 & A < 16 first held at " in out
    assert "quantiles of 2.5, 50 and 97.5 %: " in out
    none = run_here(*COMMAND, "--runs", 20, "--until", "AB >= 11", cwd=folder).out
    assert "held in none of 20 runs until 20; quantiles of 2.5, 50 and 97.5 %: later than 20, later" in none
    start = run_here(*COMMAND, "--runs", 20, "--until", "A >= 1", cwd=folder).out
    assert "A >= 1 first held at 0 on average, in 20 of 20 runs" in start


def test_runs_that_explode_are_followed_as_far_as_the_figures(folder):
    words = ["predict", "growth.rxn", "--times", 1, 60, "--runs", 20, "--until", "A >= 1000000", "--json"]
    done = run_here(*words, cwd=folder)
    assert done.code == 4
    assert json.loads(done.out)["first_time"]["horizon"] == 1.0


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (["--until", "AC >= 8"], "unknown name 'AC'"),
        (["--until", "AB"], "AB"),
        (["--until", "AB >= 8", "--method", "transient"], "--method transient makes none"),
        (["--until", "AB >= 8", "--method", "mean-field"], "--method mean-field makes none"),
        (["--until", "AB >= 8", "--method", "leaping"], "'leaping' does not support a condition that ends runs"),
    ],
)
def test_what_cannot_be_is_refused_before_any_work(words, says, folder, monkeypatch):
    monkeypatch.setattr("kinetics.commands.predict.predict_job", None)
    done = run_here(*COMMAND, *words, cwd=folder)
    assert (done.code, done.out) == (2, "")
    assert says in done.err


def test_ctrl_c_among_these_runs_keeps_the_counts(folder, monkeypatch):
    def interrupted(*_):
        raise KeyboardInterrupt

    monkeypatch.setattr(until_module.EndingRuns, "first_times", interrupted)
    done = run_here(*COMMAND, "--runs", 20, "--until", "AB >= 8", "--json", cwd=folder)
    assert done.code == 130
    told = json.loads(done.out)
    assert (told["complete"], told["first_time"], len(told["mean"])) == (False, None, 2)


def test_observables_may_be_named():
    model = Model(Network.from_text(PAIR), observables={"bound": {"AB": 1}})
    made = until_module.EndingRuns.of(until_module.Job(model, [5.0], seed=1), None, "bound >= 3")
    expected = simulate(model, "auto", None, 5.0, 10, 1, until="AB >= 3")
    assert_array_equal(made.first_times(10, 5.0).times, expected.times)
