"""A network as a model of PRISM, and what Storm finds of it, where it is installed (extra `oracle`)."""

from fractions import Fraction

import numpy as np
import pytest
from exact_distributions import DIMERS, TRIMERS
from known_systems import line, switch

from kinetics import Chain, Model, Network
from kinetics.markov import ask, prism_text
from kinetics.markov.prism.writing import prism_names

QUESTIONS = ("P=? [ F {0} >= {1} ]", "S=? [ {0} >= {1} ]", 'R{{"{0}"}}=? [ S ]')


def text_of(network, start, observables=None):
    chain = Chain.of(network, start)
    return chain, prism_text(Model(network, start, observables or {}), np.asarray(chain.counts).max(axis=0))


def test_the_text():
    _, text = text_of(line(), [8, 0, 0, 0], {"cubes": {"monomer": 1.0, "dimer": 2.0}})
    assert "  monomer : [0..8] init 8;" in text
    assert "[] monomer >= 2 -> 7.88e-05 * 2.0 * (monomer * (monomer - 1)) / 2.0 :" in text
    assert "(monomer' = monomer - 2) & (dimer' = dimer + 1);" in text
    assert 'rewards "cubes"\n  true : 1.0 * monomer + 2.0 * dimer;\nendrewards' in text


def test_rate_laws_in_its_language():
    reactions = {"make": ({}, {"Y": 1}), "go": ({"Y": 1}, {})}
    laws = ["piecewise(2*Y**2, Y < 3 and not Y == 1, sqrt(K))", "1.5 * min(Y, 4) / (K + Y)"]
    net = Network.from_reactions(reactions, laws, parameters={"K": 2.0})
    text = prism_text(Model(net, [1]), np.array([5]))
    assert "(((Y < 3.0) & !(Y = 1.0)) ? (2.0 * pow(Y, 2.0)) : pow(2.0, 0.5))" in text
    assert "(1.5 * min(Y, 4.0)) / (2.0 + Y)" in text
    for law in ("exp(-Y)", "Y % 2", "sin(Y)"):
        with pytest.raises(ValueError, match="PRISM's language cannot say"):
            prism_text(Model(Network.from_reactions(reactions, [law, 1.0]), [1]), np.array([5]))
    with pytest.raises(ValueError, match="depends on the time"):
        prism_text(Model(Network.from_reactions(reactions, ["1 + sin(t)", 1.0]), [1]), np.array([5]))


def test_names_that_are_words_of_the_language():
    names = prism_names(["S", "A(b!1)", "A_b_1_", "2x", "ok"])
    assert names == {"S": "n_S", "A(b!1)": "A_b_1__", "A_b_1_": "A_b_1_", "2x": "n_2x", "ok": "ok"}


@pytest.mark.parametrize(
    ("network", "start", "species", "copies"),
    [
        (DIMERS.net, DIMERS.start, "B", 4),
        (TRIMERS.net, TRIMERS.start, "B", 2),
        (switch(0.5, 0.25), (3, 0), "B", 2),
        (line(), (8, 0, 0, 0), "quadmer", 2),
    ],
)
def test_storm_reads_it_and_agrees(network, start, species, copies, tmp_path):
    stormpy = pytest.importorskip("stormpy", reason="Storm is an extra: pip install wellmixed[oracle]")
    chain, text = text_of(network, list(start))
    (tmp_path / "model.sm").write_text(text)
    program = stormpy.parse_prism_program(str(tmp_path / "model.sm"), prism_compatibility=True)
    own = prism_names(network.species)[species]
    for question in QUESTIONS:
        theirs = question.format(own if "R{" not in question else species, copies)
        parsed = stormpy.parse_properties(theirs, program)
        model = stormpy.build_model[stormpy.Rational](program, parsed)
        exact = Fraction(str(stormpy.model_checking(model, parsed[0]).get_value(model.initial_states[0])))
        answer = ask(chain, question.format(species, copies))
        # rates are decimal numbers there: as many roundings again
        slack = Fraction(1e-14) * exact
        assert Fraction(answer.low) - slack <= exact <= Fraction(answer.high) + slack
        if 0 < exact < 1:
            assert not Fraction(answer.low) <= exact * (1 + Fraction(1e-10)) <= Fraction(answer.high)  # the control
    timed = stormpy.parse_properties(f"P=? [ F<=2 {own} >= {copies} ]", program)
    model = stormpy.build_model(program, timed)
    found = stormpy.model_checking(model, timed[0]).get_value(model.initial_states[0])
    assert abs(found - ask(chain, f"P=? [ F<=2 {species} >= {copies} ]").value) < 1e-5  # its precision is 1e-6


def test_rewards_have_the_names_that_variables_would_have():
    """Of sites in brackets, of keywords, and of names that differ in what PRISM cannot have."""
    network = Network.from_reactions({"on": ({"A(b)": 1, "A[b]": 1}, {"max": 1})}, [0.01])
    text = prism_text(Model(network, [2, 1, 0], {"A-b": {"max": 1.0}, "init": {"A(b)": 2.0}}), np.array([2, 1, 1]))
    names = [line.split('"')[1] for line in text.splitlines() if line.startswith("rewards")]
    assert names == ["A_b_", "A_b__", "n_max", "A_b", "n_init"]
    assert 'rewards "n_init"\n  true : 2.0 * A_b_;\nendrewards' in text
