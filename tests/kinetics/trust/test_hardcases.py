from pathlib import Path

import numpy as np
import pytest
from scipy.sparse import csr_array, triu

from kinetics import Chain, Network, Transient
from kinetics.markov.transient import SOLVING_METHODS
from kinetics.sampling import SAMPLING_METHODS
from kinetics.trust.hardcases import CASES, Attempt, Case, chains
from kinetics.trust.hardcases.case import attempt, refusal, relative

SLOW = ("reversible binding", "stiff and large", "slow leak")  # two to five seconds each


@pytest.mark.parametrize(
    "case", [pytest.param(c, id=c.name, marks=[pytest.mark.validate] * (c.name in SLOW)) for c in CASES]
)
def test_hard_case(case: Case):
    attempts = list(case.attempts())
    assert attempts
    assert [found for found in attempts if not found.passed] == []
    assert all(isinstance(found, Attempt) for found in attempts)


def test_names_differ_and_every_method_is_tried():
    assert len({case.name for case in CASES}) == len(CASES)
    (nothing,) = [case for case in CASES if case.name == "nothing to do"]
    tried = {found.method.split(",")[0] for found in nothing.attempts()}
    assert tried == {method.name for method in (*SAMPLING_METHODS, *SOLVING_METHODS)}


def test_the_page_counts_the_cases():
    page = (Path(__file__).parents[3] / "docs" / "kinetics.md").read_text(encoding="utf-8")
    assert f" at {len(CASES)} cases in " in page


def test_wrong_answers_are_seen():
    assert not attempt("wrong", lambda: relative([1.0, 2.0], [1.0, 2.1]), 1e-3).passed
    assert relative([1e-9], [0.0]) == float("inf")
    assert relative([0.0], [0.0]) == 0.0
    assert not attempt("nan", lambda: float("nan"), 1.0).passed
    assert not refusal("answers", lambda: 1, "anything").passed
    assert refusal("refuses", lambda: int("x"), "invalid literal").passed
    assert not refusal("says something else", lambda: int("x"), "too stiff").passed


def test_chains_whose_rates_are_a_little_off_are_seen(monkeypatch):
    """The control: rates to later states are too high by 1e-9, or the start by as much, where nothing moves."""

    def off(generator, initial, *names):
        rates = csr_array(generator, dtype=float)
        if not rates.nnz and rates.shape[0] > 1:
            initial = initial + 1e-9 * np.array([1.0, 0.0, -1.0])
        return Chain(rates + 1e-9 * triu(rates), initial, *names)

    monkeypatch.setattr(chains, "Chain", off)
    unseen = {case.name for case in chains.CHAINS if all(found.passed for found in case.attempts())}
    assert unseen == {"nowhere"}  # whatever the rates


def test_reactions_without_effect_are_warned_of():
    with pytest.warns(UserWarning, match="channel 'idle' changes nothing"):
        Network.from_reactions({"idle": ({"X": 2}, {"X": 2}), "death": ({"X": 1}, {})}, [1.0, 1.0])


def test_a_space_that_does_not_close_says_how_it_grows():
    growth = Network.from_reactions({"birth": ({}, {"X": 1}), "move": ({"X": 1}, {"Y": 1})}, [1.0, 1.0])
    with pytest.raises(
        ValueError, match=r"over 500 states are reachable: \d+ events away .*X up to \d+, Y up to \d+ and rising"
    ):
        Transient(max_states=500).solve(growth, [0, 0], [1.0])


def test_command(wellmixed, tmp_path):
    told = wellmixed("trust", "hardcases", "--only", "ruin", "--json", cwd=tmp_path).json
    assert told["failed"] == 0
    assert {one["case"] for one in told["attempts"]} == {"gambler's ruin"}
    text = wellmixed("trust", "hardcases", "--only", "bad rates", cwd=tmp_path).out
    assert 'refused: "' in text
    assert "3 attempts at 1 cases; 0 failed" in text
    unknown = wellmixed("trust", "hardcases", "--only", "nonsense", cwd=tmp_path)
    assert unknown.code == 2
    assert "no hard case has 'nonsense'" in unknown.err
