"""Networks as people write them: what each line means, what is refused, and how it is told."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from kinetics.network import Network
from kinetics.network.laws import michaelis_menten

EVERYTHING = """
# a comment, and an empty line

time unit: min
bind: A + B <-> AB, k1, k2   # both ways
2 A -> 'D-#1', 3*k1
0 -> A, 5
turn: AB -> AB + 2B, v * AB / (K + AB)
'D-#1' -> ∅, 0.5 * (1 + sin(t))
k1 = 1e-3
k2 = 100*k1
v = 2; # not a comment's business
K = 10
A = 100
B = 2 * K
""".replace(";", "")


def test_every_kind_of_line():
    """The same network by reactions, parameter for parameter."""
    network = Network.from_text(EVERYTHING)
    sides = [
        ({"A": 1, "B": 1}, {"AB": 1}),
        ({"AB": 1}, {"A": 1, "B": 1}),
        ({"A": 2}, {"D-#1": 1}),
        ({}, {"A": 1}),
        ({"AB": 1}, {"AB": 1, "B": 2}),
        ({"D-#1": 1}, {}),
    ]
    names = ["bind", "bind backward", "r3", "r4", "turn", "r6"]
    law = michaelis_menten("AB", vmax=2, K=10)
    rates = [1e-3, 0.1, 3e-3, 5, law, "0.5 * (1 + sin(t))"]
    expected = Network.from_reactions(dict(zip(names, sides, strict=True)), rates)
    assert network.channels == expected.channels
    assert network.species == expected.species
    states = np.random.default_rng(0).integers(0, 30, (50, 4))
    for time in (0.0, 1.3):
        assert_allclose(network.propensities(states, time), expected.propensities(states, time), rtol=1e-15)
    assert network.time_unit == "min"
    assert network.initial == {"A": 100, "B": 20}
    assert network.parameters == {"k1": 1e-3, "k2": 0.1, "v": 2.0, "K": 10.0}
    assert "k (1/min)" in str(Network.from_text("time unit: min\nA -> B, 1"))
    assert "k  " not in str(Network.from_text("A -> B, 1")).splitlines()[1].removesuffix("k")


def test_other_parameters_are_another_text():
    """Constants, laws, counts and formulas of parameters follow; a network of plain numbers would not."""
    text = EVERYTHING.replace("k1 = 1e-3\n", "")
    network, other = (Network.from_text(text, k1=k1) for k1 in (1e-3, 0.7))
    changed = Network.from_text(EVERYTHING).with_parameters(k1=0.7, K=3, v=5)
    other = other.with_parameters(K=3, v=5)
    states = np.random.default_rng(0).integers(0, 30, (50, 4))
    assert_array_equal(changed.propensities(states, 1.0), other.propensities(states, 1.0))
    assert not np.allclose(changed.propensities(states, 1.0), network.propensities(states, 1.0))
    assert changed.parameters == {"k1": 0.7, "k2": 70.0, "v": 5.0, "K": 3.0}
    assert changed.initial == {"A": 100, "B": 6}
    assert changed.fingerprint != network.fingerprint
    fixed = changed.with_parameters(k2=1.0).with_parameters(k1=2.0)  # a number from then on
    assert_array_equal(fixed.rate_constants[:3], [2.0, 1.0, 6.0])
    assert Network.from_text(EVERYTHING, k1=0.7).parameters["k1"] == 0.7  # before what the text says
    for wrong, why in (({"k3": 1}, "unknown parameter 'k3'.*did you mean k"), ({"k1": -1}, "'bind', k1, is -1")):
        with pytest.raises(ValueError, match=why):
            network.with_parameters(**wrong)
    with pytest.raises(ValueError, match="finite number"):
        network.with_parameters(k1=float("nan"))


def test_rate_constants_given_as_numbers_are_numbers_from_then_on():
    network = Network.from_text("A -> B, k\nk = 2").with_rates([7.0])
    assert_array_equal(network.with_parameters(k=3).rate_constants, [7.0])
    network = Network.from_text("A -> B, k\nB -> A, k\nk = 2")
    law = replace(network, laws={"r1": "3 * A"}, given=network.given.without_rates(["r1"]))
    assert_array_equal(law.with_parameters(k=5).propensities([2, 1]), [12.0, 5.0])


def test_a_name_means_one_thing():
    law = michaelis_menten("A", vmax=2, K=10)
    network = Network.from_text("A -> B, K\nK = 3")
    with pytest.raises(ValueError, match="'K' is 10 in the law of channel 'r1' and 3 elsewhere"):
        replace(network, laws={"r1": law}, given=network.given.without_rates(["r1"]))
    with pytest.raises(ValueError, match="'A' is a species"):
        Network.from_text("A -> B, 1", A=3)


# text, what is told of it
WRONG = {
    "no arrow": ("\nA + B, 3", r"line 2, column 6, 'A \+ B, 3': no arrow; expected a reaction such as"),
    "other arrow": ("A => B, k", "column 3, .*arrow '=>'; expected -> or <->"),
    "long arrow": ("A --> B, k", "column 3, .*arrow '-->'"),
    "backward arrow": ("A <- B, k", "column 3, .*arrow '<-'"),
    "no rate": ("A -> B", "column 7, .*no rates after the products; expected one, as in 'A -> B, k'"),
    "no comma": ("A -> B k", "column 8, .*'k' came after 'B', after the arrow; .*a comma and the rate"),
    "one of two": ("A <-> B, 1", "1 rate after the products; expected two"),
    "two of one": ("A -> B, 1, 2", "column 12, .*write <-> for both"),
    "unknown parameter": ("A -> B, kon\nkof = 2", r"line 1, column 9, .*unknown name 'kon' \(did you mean kof\?\)$"),
    "no value": ("A -> B, k", "unknown name 'k'; give it a value, as by a line 'k = 1e-3'"),
    "negative": ("A -> B, k\nk = -2", "line 1, .*the rate is -2; expected at least 0"),
    "infinite": ("A -> B, 1/0", "the rate, 1 / 0, comes to no finite number"),
    "double name": ("a: A -> B, 1\na: B -> A, 1", "line 2, .*a reaction is called 'a' already"),
    "double value": ("A -> B, k\nk = 1\nk = 2", "line 3, .*'k' has a value in line 2 already"),
    "below": ("A -> B, k\nk = q\nq = 1", "line 2, .*'q' is given in line 3, below"),
    "species in a parameter": ("A -> B, k\nk = A", "line 2, .*'A' is a species"),
    "unit": ("A -> B, 2 * k /s\nk = 1", "line 1, column 16, .*unknown name 's' .a unit stands behind a number alone"),
    "misspelt count": ("Aa -> B, 1\nAb = 5", r"line 2, .*'Ab' is neither .*\(did you mean Aa\?\)"),
    "half a copy": ("A -> B, 1\nA = 2.5", "line 2, column 5, .*2.5 copies of 'A'"),
    "less than nothing": ("A -> B, 1\nA = -2", "line 2, .*copies of 'A'; expected at least 0"),
    "half a species": ("2.5 A -> B, 1", "line 1, column 1, .*2.5 copies; expected a whole number"),
    "too many copies": ("1000001 A -> B, 1", "expected a whole number from 1 to 1000000"),
    "nothing": ("-> B, 1", "nothing came where a species before the arrow was expected; nothing is written 0"),
    "setting": ("tme unit: s\nA -> B, 1", r"line 1, .*did you mean time unit\?"),
    "combinations": ("A -> B, 1\ncombinations: order", r"line 2, .*did you mean ordered\?"),
    "the time": ("t -> B, 1", "'t' is reserved in formulas; quote it"),
    "quote": ("A -> B', 1", "column 7, .*this quote is never closed"),
    "formula": ("A -> B, k * \nk = 1", r"column 12, 'A -> B, k \*': a value is missing"),
    "species twice": ("species: A, A", "column 13, .*species 'A' comes twice"),
    "no reaction": ("# nothing", "no reaction came"),
    "no species": ("0 -> 0, 1", "no reaction has a species"),
    "missing arrow": ("A -> B, 1\n r: A + B AB, 1", "line 2, column 11, 'r: A . B AB, 1': no arrow"),
    "empty rate": ("A -> B, 1,", "column 11, .*nothing came behind a comma, where a rate was expected; expected one"),
    "a function": (
        "A -> B, exp",
        r"column 9, .*unknown name 'exp' \(the function wants its arguments, as in exp\(...\)",
    ),
    "the time's name": ("A -> B, A * time", r"column 13, .*unknown name 'time' \(the time is t\)"),
    "a choice": ("A -> B, if A > 3 then 1", r"column 9, .*\(a choice is written piecewise\("),
    "endless copies": ("1e999 A -> B, 1", "column 1, .*1e999 copies; expected a whole number"),
    "second direction": ("A <-> B, 1 , -2", "column 14, .*the rate is -2"),
    "negative in brackets": ("A -> B, 1 * (2 - 3)", "column 9, .*the rate is -1"),
    "odd sign": ("r: A -> B; 1", "column 10, .*';' means nothing"),
    "label": ("r s: A -> B, 1", "column 1, .*'r s' came where a reaction's name was expected"),
    "second setting": ("time unit: s\ntime unit: h\nA -> B, 1", "line 2, column 12, .*comes twice"),
    "long line": ("A -> B, 1 #" + "x" * 100_000, "100011 characters; a line may have at most 100000"),
}


@pytest.mark.parametrize("name", WRONG)
def test_a_slip_is_told_with_line_and_cure(name):
    text, why = WRONG[name]
    with pytest.raises(ValueError, match=why):
        Network.from_text(text)


def test_parameters_that_nothing_reads_are_refused():
    with pytest.raises(ValueError, match=r"'k2' is neither a species nor in any formula \(did you mean k\?\)"):
        Network.from_text("A -> B, k", k=1, k2=3)
    with pytest.raises(ValueError, match="None is no text of reactions"):
        Network.from_text(None)


def test_long_texts_and_formulas_are_read():
    """Thousands of reactions, terms and brackets, without recursion."""
    long = Network.from_text("\n".join(f"A{i} -> A{i + 1}, k" for i in range(3000)), k=2.0)
    assert_array_equal(long.with_parameters(k=3.0).rate_constants, np.full(3000, 3.0))
    deep = Network.from_text("A -> B, " + "(" * 5000 + "k" + ")" * 5000 + "+ k * A" * 5000, k=0.5)
    assert_allclose(deep.propensities([[2, 0]]), [[0.5 + 5000]])
