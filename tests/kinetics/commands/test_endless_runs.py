"""Commands on networks whose runs explode, never end, or have waits too short for the clock."""

import json

import pytest
from command_line import run_here

from kinetics.support.cli.failures import INCOMPLETE

MODELS = {
    "explode": "2 A -> 3 A, 0.01\nA -> 0, 0.1\nA = 20\n",
    "yule": "A -> 2 A, 1\nA = 10\n",
    "hot": "0 -> A, 1e300\nA -> 0, 1e300\nA = 1\n",
    "steep": "A -> 0, 1e300\nA = 1000000000000000\n",
}


@pytest.fixture
def folder(tmp_path):
    for name, text in MODELS.items():
        (tmp_path / f"{name}.rxn").write_text(text, encoding="utf-8")
    return tmp_path


@pytest.mark.parametrize(
    ("words", "times", "reason"),
    [
        (["explode.rxn", "--times", 1, "--times", 5, "--times", 20], [1, 5], "forecast"),
        (["yule.rxn", "--times", 1, "--times", 60, "--max-events", 1000], [1], "events"),
        (["hot.rxn", "--times", 0, "--times", 1], [0], "forecast"),
    ],
)
@pytest.mark.parametrize("effort", [("--runs", 40), ("--accuracy", "20%")])
def test_figures_are_given_for_the_times_before(effort, words, times, reason, folder):
    done = run_here("predict", *words, *effort, "--seed", 1, "--json", cwd=folder)
    assert done.code == INCOMPLETE
    told = json.loads(done.out)
    assert told["times"] == times
    assert len(told["mean"]) == len(times)
    assert told["runs"] == 40 if effort[0] == "--runs" else told["accuracy"]["reached"]
    assert told["truncated"]["reason"] == reason
    assert told["truncated"]["share"] > 0
    assert any("was truncated at" in note for note in told["notes"])


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (["predict", "yule.rxn", "--times", 60, "--runs", 20], "ask for earlier times"),
        (["predict", "yule.rxn", "--times", 60, "--accuracy", "20%"], "ask for earlier times"),
        (["predict", "steep.rxn", "--times", 1, "--runs", 20], "a propensity exceeded 1e308"),
    ],
)
def test_a_command_without_any_figure_says_why(words, says, folder):
    done = run_here(*words, cwd=folder)
    assert done.code == 2
    assert says in done.err


def test_growth_without_a_network_is_truncated_alike(folder):
    """A line of four that joins and breaks without end; the same runs, as far as they go."""
    words = [
        "rules",
        "grow",
        "line4",
        "--cubes",
        20,
        "--join",
        0.1,
        "--break",
        0.1,
        "--runs",
        3,
        "--times",
        1,
        "--times",
        40,
    ]
    whole = run_here(*words, "--json", cwd=folder).json
    assert whole["truncated"] is None
    done = run_here(*words, "--max-events", 60, "--json", cwd=folder)
    assert done.code == INCOMPLETE
    told = json.loads(done.out)
    assert told["times"] == [1.0]
    for name, series in told["series"].items():
        assert series["mean"] == whole["series"].get(name, {"mean": series["mean"]})["mean"][:1]
    assert (told["truncated"]["reason"], told["truncated"]["beyond"]) == ("events", 40.0)
    assert 1.0 <= told["truncated"]["time"] < 40.0
    nothing = run_here(*words, "--max-events", 1, cwd=folder)
    assert nothing.code == 2
    assert "ask for earlier times" in nothing.err


def test_an_ordinary_prediction_is_not_truncated(folder):
    done = run_here("predict", "explode.rxn", "--times", 1, "--runs", 20, "--json", cwd=folder)
    assert done.json["truncated"] is None
