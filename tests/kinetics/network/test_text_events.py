"""Events and constant species in a text of reactions: closed forms, what each word means, and what is refused."""

from dataclasses import replace
from math import exp

import numpy as np
import pytest
from known_systems import assert_follows_table
from numpy.testing import assert_array_equal
from scipy.stats import binom, poisson

from kinetics import simulate
from kinetics.network import Network
from kinetics.network.laws import Event

EVERY_WORD = """
A -> B, k
k = 0
n = 5
A = 3
at t = 20: A = A + 100
dose: at t = 2 * n, priority 2 * n: A = 0, B = n
when B > 30, delay 2 * A, also at 0: A = 0, B = B - 10   # two at once
'x y': when B > 3 and (A < n), from trigger, not persistent: A = max(A - 1, 0)
"""


def test_every_word_of_an_event():
    """The same events, made by hand."""
    n = {"n": 5.0}
    expected = [
        Event("event 1", "t >= 20", {"A": "A + 100"}, was_true=False),
        Event("dose", "2 * n <= t", {"A": "0", "B": "n"}, n, priority=10.0, was_true=False),
        Event("event 3", "B > 30", {"A": "0", "B": "B - 10"}, delay="2 * A", was_true=False),
        Event("x y", "B > 3 and A < n", {"A": "max(A - 1, 0)"}, n, from_trigger=True, persistent=False),
    ]
    found = Network.from_text(EVERY_WORD).events
    assert [str(event) for event in found] == [str(event) for event in expected]
    flags = ("was_true", "from_trigger", "persistent", "priority")
    for one, other in zip(found, expected, strict=True):
        assert [getattr(one, flag) for flag in flags] == [getattr(other, flag) for flag in flags]
    times = np.arange(0.0, 30, 0.5)
    counts = simulate(Network.from_text(EVERY_WORD), "general", None, times, runs=1, seed=1)
    by_hand = replace(Network.from_text("A -> B, k", k=0), events=expected)
    assert_array_equal(counts.counts, simulate(by_hand, "general", {"A": 3}, times, runs=1, seed=1).counts)
    assert counts["A"][0, [0, 19, 20, 39, 40]].tolist() == [3, 3, 0, 0, 100]


def test_a_dose_follows_its_closed_form():
    """Copies of the start and of the dose, each left with its own probability; a dose at 0.6 is told apart."""
    network = Network.from_text("X -> 0, 1\nX = 20\nat t = when: X = X + dose\nwhen = 0.7\ndose = 30")
    counts = simulate(network, "auto", None, [1.2], runs=4000, seed=51)["X"][:, 0]
    seen = np.bincount(counts, minlength=51)

    def law(time):
        return np.convolve(binom(20, exp(-1.2)).pmf(np.arange(21)), binom(30, exp(time - 1.2)).pmf(np.arange(31)))

    assert_follows_table(seen, law(0.7))
    with pytest.raises(AssertionError, match="chi-square"):
        assert_follows_table(seen, law(0.6))
    other = simulate(network.with_parameters(when=0.6), "auto", None, [1.2], runs=4000, seed=51)["X"][:, 0]
    assert_follows_table(np.bincount(other, minlength=51), law(0.6))


def test_a_dose_at_0_happens_and_a_condition_that_holds_at_0_waits():
    text = "A -> B, 0\nA = 3\n{}: A = 20"
    for moment, expected in (("at t = 0", 20), ("when A < 5", 3), ("when A < 5, also at 0", 20)):
        network = Network.from_text(text.format(moment))
        assert simulate(network, "auto", None, [0.0, 1.0], runs=1, seed=1)["A"][0].tolist() == [expected] * 2


@pytest.mark.parametrize("method", ["ssa", "lockstep", "partial", "rejection", "leaping"])
def test_methods_without_events_say_so(method):
    network = Network.from_text("A -> B, 1\nat t = 1: A = 3")
    with pytest.raises(ValueError, match="event"):
        simulate(network, method, times=[2.0], runs=1, seed=1)


def test_results_that_follow_from_counts_are_judged_when_they_happen():
    network = Network.from_text("A -> B, 0\nA = 3\nat t = 1: A = A - 4")
    with pytest.raises(ValueError, match=r"event 'event 1' sets 'A' to A - 4 = -1 at A = 3.*whole number"):
        simulate(network, "auto", None, [2.0], runs=1, seed=1)


# text, what is told of it
WRONG = {
    "no colon": ("at t = 20 A = 5", r"column 16, 'at t = 20 A = 5': no colon behind 'at'; expected an event such as"),
    "no time": ("at 20: A = 5", "column 4, .*'20' came where 't = ...' was expected"),
    "another time": ("at s = 20: A = 5", "column 4, .*'s = 20' came where 't = ...' was expected"),
    "early": ("at t = 0 - k: A = 5", "column 8, .*the time of the event is -2; expected at least 0"),
    "time of counts": ("at t = A: A = 5", "column 8, .*'A' is a species; expected parameters"),
    "time of the time": ("at t = t: A = 5", "column 8, .*comes to no finite number"),
    "one =": ("when B = 3: A = 5", "column 8, .*= gives a value; write == to compare"),
    "no condition": ("when B + 3: A = 5", r"column 6, .*event 'event 1': 'B \+ 3' is no condition"),
    "unknown in a condition": ("when Bb > 3: A = 5", r"column 6, .*unknown name 'Bb' \(did you mean B"),
    "unknown target": ("when B > 3: Aa = 5", r"column 13, .*unknown species 'Aa' \(did you mean A.*events set counts"),
    "unknown in a count": ("when B > 3: A = 5 * kk", r"column 21, .*unknown name 'kk' \(did you mean k"),
    "a parameter": ("when B > 3: k = 5", "column 13, .*'k' is a parameter, which stays as it is; events set counts"),
    "a constant": ("when B > 3: S = 5", "column 13, .*'S' is held constant; leave out this assignment, or the line"),
    "twice": ("when B > 3: A = 5, A = 6", "column 20, .*'A' has two new counts in one event; expected one"),
    "no count": ("when B > 3: A", "column 13, .*'A' came where a new count was expected, such as 'A = A . 100'"),
    "nothing": ("when B > 3:", "column 12, .*'' came where a new count was expected"),
    "half": ("at t = 3: A = 1 / 2", "column 15, .*1 / 2 = 0.5 copies of 'A'; expected a whole number of at least 0"),
    "negative": ("at t = 3: A = 7, B = 1 - k", "column 22, .*1 - k = -1 copies of 'B'"),
    "infinite": ("at t = 3: A = 1 / 0", "column 15, .*1 / 0 copies of 'A'"),
    "a word": (
        "at t = 3, soon: A = 1",
        "column 11, .*'soon' came behind the moment of an event; expected one of delay",
    ),
    "at 0 already": ("at t = 3, also at 0: A = 1", "column 11, .*'also at 0' came behind"),
    "delay twice": ("at t = 3, delay 1, delay 2: A = 1", "column 20, .*'delay 2' comes twice"),
    "negative delay": ("at t = 3, delay 0 - k: A = 1", "column 17, .*the delay is -2; expected at least 0"),
    "name twice": ("d: at t = 3: A = 1\nd: at t = 4: A = 1", "line 6, column 1, .*an event is called 'd' already"),
    "reserved": ("at t = 3: t = 1", "column 11, .*'t' is reserved in formulas"),
    "constant twice": ("const S", "column 7, .*'S' is held constant already"),
    "constant parameter": (
        "const q = 3",
        "column 7, .*no reaction has 'q' on a side; a parameter is constant as it is",
    ),
    "two constants": ("const A, B", "column 8, .*',' came; expected one species"),
}


@pytest.mark.parametrize("name", WRONG)
def test_a_slip_is_told_with_line_and_cure(name):
    text, why = WRONG[name]
    with pytest.raises(ValueError, match=rf"line [56], {why}" if not why.startswith("line") else why):
        Network.from_text(f"A + S -> B, k\nconst S\nk = 2\n\n{text}")


def test_names_that_events_and_constants_use_stay_names():
    """Nothing that was read before means something else."""
    network = Network.from_text("at: at + when -> const, k\nwhen -> at, at\nk = 2\nconst = 4\nat = 3\nwhen = k")
    assert network.species == ("at", "when", "const")
    assert network.initial == {"const": 4, "at": 3, "when": 2}
    assert not network.events


def test_constant_species_are_neither_taken_nor_made():
    """Propensities as if they were counted, and no change of them: by hand, and by the law of a run."""
    network = Network.from_text("a: S + A -> 2 B, 0.5\nb: 2 S <-> A, 3, 4\nc: B -> S + B + A, 1\nconst S = 6\nA = 5")
    assert_array_equal(network.propensities([6, 5, 7]), [0.5 * 6 * 5, 3 * 6 * 5 / 2, 4 * 5, 7])
    assert_array_equal(network.stoichiometry, [[0, -1, 2], [0, 1, 0], [0, -1, 0], [0, 1, 0]])
    assert_array_equal(network.reactants, [[1, 1, 0], [2, 0, 0], [0, 1, 0], [0, 0, 1]])
    text = "S -> A, 0.5\nA -> 0, 1\nS = 10"
    fed = simulate(Network.from_text(f"{text}\nconst S"), "auto", None, [2.0], runs=4000, seed=3)
    assert (fed["S"] == 10).all()
    seen, law = np.bincount(fed["A"][:, 0], minlength=40)[:40], poisson(5 * (1 - exp(-2))).pmf(np.arange(40))
    assert_follows_table(seen, law)
    used_up = simulate(Network.from_text(text), "auto", None, [2.0], runs=4000, seed=3)["A"][:, 0]
    with pytest.raises(AssertionError, match="chi-square"):
        assert_follows_table(np.bincount(used_up, minlength=40)[:40], law)
