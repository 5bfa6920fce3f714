"""What Python users hand over by mistake is told in words, not by the line where it failed."""

import pytest

from kinetics import Chain, Model, Network, committor, first_passage, scan, simulate, solve
from kinetics.markov import ask

MODEL = Model(Network.from_text("A -> B, k\nA = 2", k=1.0), {"A": 2})
RUNS = simulate(MODEL, "ssa", times=[1.0], runs=3)
WRONG = {
    "a file for its model": (lambda: solve("a.net", "exact", times=[1]), "expected a Network or a Model"),
    "no times": (lambda: simulate(MODEL, "ssa"), "times is empty; give at least one"),
    "times that are none": (lambda: RUNS["A":"B"], "time = 'A'; expected a number"),
    "a run by its number": (lambda: RUNS[0], "0: expected a species, as in"),
    "reactions in a list": (lambda: Network.from_reactions([("A", "B")], [1.0]), "expected channel -> reaction"),
    "no text": (lambda: ask(Chain.of(MODEL.network, {"A": 1}), 3), "3 is no question; expected text"),
    "targets in a list": (lambda: committor(MODEL.network, {"A": 1}, ["B"]), "targets are .*; give at least one, as"),
    "a count of nothing": (lambda: first_passage(MODEL.network, {"A": 1}, 3), "3 is neither a species nor a sum"),
    "values without names": (lambda: scan(MODEL.network, [1, 2], "E[A] @ 1"), "expected a mapping of names to values"),
    "one number asked": (lambda: scan(MODEL.network, {"A": [1]}, 3), "3 is no question; expected text"),
    "a count as a parameter": (lambda: MODEL.with_parameters(A=3), "'A' is a species; counts at time 0 are given by"),
}


@pytest.mark.parametrize("use", WRONG)
def test_wrong_use_says_what_was_expected(use):
    act, said = WRONG[use]
    with pytest.raises((ValueError, TypeError, AttributeError), match=said):
        act()


def test_runs_hold_their_species():
    assert list(RUNS) == ["A", "B"]
    assert "A" in RUNS
    assert "C" not in RUNS
