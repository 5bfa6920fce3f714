"""Observables of a network file in conditions, rewards, passages and scans."""

import json

import numpy as np
import pytest
from click.testing import CliRunner

from kinetics import Chain, Network, first_passage, predict_passage, scan
from kinetics.formats import read
from kinetics.markov import sensitivity_to
from kinetics.markov.observing import observing
from wellmixed import main

MODEL = """
A + B <-> AB, 1e-3, 0.1
A = 50
B = 40
observable: total = A + 2 * AB
observable: half = 0.5 * A
observable: gap = AB - A
"""


@pytest.fixture
def path(tmp_path):
    file = tmp_path / "model.rxn"
    file.write_text(MODEL, encoding="utf-8")
    return file


def said(*words):
    done = CliRunner().invoke(main, [*map(str, words), "--json"])
    assert done.exit_code == 0, done.output
    return json.loads(done.stdout)


def test_the_passage_to_a_sum_is_that_to_what_it_counts(path):
    """total >= 60 is AB >= 10, as A + AB are 50."""
    model = read(path)
    by_sum, by_species = (first_passage(model.network, model.initial, *asked) for asked in
                          (({"A": 1, "AB": 2}, 60), ("AB", 10)))  # fmt: skip
    assert by_sum.mean == by_species.mean
    assert (by_sum.target, by_species.target) == ("A + 2 AB >= 60", "10 AB")
    assert predict_passage(model.network, None, model.initial, {"AB": 1}, 10).mean.value == by_species.mean
    questions = [sensitivity_to(model.network, model.initial, *asked) for asked in (({"AB": 2.0}, 20), ("AB", 10))]
    slopes = [asked.passage(goal) for asked, goal in questions]
    assert slopes[0].value.tolist() == slopes[1].value.tolist()
    for more in ([], ["--sensitivity"], ["--truncate", "300"]):
        found, expected = (
            said("passage", path, "--species", name, "--copies", n, *more) for name, n in (("total", 60), ("AB", 10))
        )
        assert found["mean"]["value"] == expected["mean"]["value"]
    wrong = CliRunner().invoke(main, ["passage", str(path), "--species", "totl"])
    assert wrong.exit_code == 2
    assert "'totl' is neither a species nor an observable; did you mean total?" in wrong.output
    with pytest.raises(ValueError, match="weight of 'A' is nan"):
        first_passage(model.network, model.initial, {"A": float("nan")})


def test_conditions_and_rewards_name_sums(path):
    model = read(path)
    chain = observing(Chain.of(model), model)
    assert chain.variables == ("A", "B", "AB", "total", "gap")  # half is no whole number
    assert set(chain.rewards) == {"total", "half"}  # gap may be negative
    a, _, ab = np.asarray(chain.counts)[:, :3].T
    expected = (ab - a > -30) & (a + 2 * ab >= 55)
    assert 0 < expected.sum() < expected.size
    assert chain.states("gap > -30 & total >= 55").tolist() == expected.tolist()
    by_sum, by_species = said("ask", path, "P=? [F<=10 total>=60]", "P=? [F<=10 AB>=10]")["answers"]
    assert by_sum["value"] == by_species["value"]


def test_scans_ask_about_sums_solved_and_sampled(path):
    model = read(path)
    asked = ["P=? [F<=10 total>=60]"]
    solved, sampled = (scan(model, {"A": [50]}, asked, max_states=most) for most in (1000, 0))
    assert sampled.numbers("low").item() <= solved.numbers("value").item() <= sampled.numbers("high").item()
    none = Network.from_text("A -> B, 1")
    assert scan(none, {"A": [3]}, ["P=? [F<=1 B>=1]"]).numbers("value").item() == pytest.approx(1 - np.exp(-3))
