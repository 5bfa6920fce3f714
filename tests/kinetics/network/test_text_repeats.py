"""Repeated lines: what they are written out to, and what is refused."""

import numpy as np
import pytest
from numpy.testing import assert_array_equal

from kinetics.network import Network
from kinetics.network.text_repeats import MOST_LINES, expanded


def test_a_chain_and_a_ring_are_those_written_by_hand():
    text = """
    for i in 1..3: hop[i]: A[i] -> A[i+1], k * i   # forward
    for n in 0..2: A[n + 1] + E -> E + A[(n + 1) % 3 + 1], c[n]
    for i in 0..2: c[i] = 2 ** i
    for i in 2..4: A[i] = 10 * i
    A[1] = 7
    k = 0.5
    observable: ends = A[1] + A_4
    for i in 1..2: at t = 5 * i: A[i] = A[i] + i
    """
    by_hand = """
    hop_1: A_1 -> A_2, k * 1
    hop_2: A_2 -> A_3, k * 2
    hop_3: A_3 -> A_4, k * 3
    A_1 + E -> E + A_2, c_0
    A_2 + E -> E + A_3, c_1
    A_3 + E -> E + A_1, c_2
    c_0 = 1
    c_1 = 2
    c_2 = 4
    A_2 = 20
    A_3 = 30
    A_4 = 40
    A_1 = 7
    k = 0.5
    at t = 5: A_1 = A_1 + 1
    at t = 10: A_2 = A_2 + 2
    """
    found, expected = Network.from_text(text), Network.from_text(by_hand)
    assert found.species == expected.species
    assert found.channels == expected.channels == ("hop_1", "hop_2", "hop_3", "r4", "r5", "r6")
    states = np.random.default_rng(0).integers(0, 9, (20, 5))
    assert_array_equal(found.propensities(states, 0.0), expected.propensities(states, 0.0))
    assert_array_equal(found.stoichiometry, expected.stoichiometry)
    assert found.initial == expected.initial
    assert [event.assign["A_2"].text for event in found.events[1:]] == ["A_2 + 2"]
    assert [str(event.condition) for event in found.events] == ["5 * 1 <= t", "5 * 2 <= t"]


def test_quoted_names_and_other_lines_stay():
    lines = ["'A[1]' -> B, 1", "# for i in 1..3: A[i] -> B, 1", "i -> 'for', 2  # i[2]", ""]
    assert [line.text for line in expanded("\n".join(lines))][:1] == lines[:1]
    network = Network.from_text("\n".join(lines))
    assert network.species == ("A[1]", "B", "i", "for")
    made = expanded("for i in 1..2: 'i' -> A[i], 1e2 * i2 + i  # i")
    assert [line.text.rstrip() for line in made] == ["'i' -> A_1, 1e2 * i2 + 1", "'i' -> A_2, 1e2 * i2 + 2"]


# text, what is told of it
WRONG = {
    "no range": (
        "for i in 5: A -> B, 1",
        "line 2, column 1, .*this repetition cannot be read; expected a repeated line",
    ),
    "no colon": ("for i in 1..5 A -> B, 1", "column 1, .*cannot be read"),
    "backwards": ("for i in 5..1: A -> B, 1", "column 10, .*5..1 holds no number; expected the smaller one first"),
    "many": (f"for i in 1..{MOST_LINES + 1}: A[i] -> B, 1", "column 10, .*over 10000 lines by repetition"),
    "endless": ("for i in 1..99999999999999: A[i] -> B, 1", "column 13, .*a number beyond 1000000000"),
    "many together": (
        "for i in 1..6000: A[i] -> B, 1\nfor i in 1..6000: A[i] -> C, 1",
        "line 3, column 10, .*over 10000",
    ),
    "long": ("for i in 1..10000: " + "A[i] + " * 200 + "A[i] -> B, 1", "over 10000000 characters by repetition"),
    "nested": ("for i in 1..3: for j in 1..3: A[i] -> B, 1", "column 16, .*another repetition to repeat"),
    "nothing": ("for i in 1..3:", "column 15, .*nothing to repeat"),
    "reserved": ("for t in 1..3: A[t] -> B, 1", "column 5, .*'t' is reserved in formulas"),
    "below 0": (
        "for i in 1..3: A[i] -> A[i-2], 1",
        "column 26, .*the index comes to -1; expected a whole number from 0",
    ),
    "half": ("for i in 1..3: A[i/2] -> B, 1", "column 18, .*the index comes to 0.5"),
    "another name": ("for i in 1..3: A[j] -> B, 1", "column 18, .*'j' in an index; expected 'i' and numbers alone"),
    "no number": ("A[j] -> B, 1", "column 3, .*'j' in an index; expected a number alone"),
    "the time": ("A[t] -> B, 1", "column 3, .*the time in an index|'t' in an index"),
    "empty": ("A[] -> B, 1", "column 3, .*a value is missing"),
    "open": ("A[1 -> B, 1", r"column 2, .*'\[' means nothing"),
    "in the line made": ("for i in 1..2: A[i] > B, 1", "line 2, column [0-9]+, 'A_1 > B, 1': "),
    "name twice": (
        "for i in 1..2: hop: A[i] -> B, 1",
        "line 2, column 1, 'hop: A_2 -> B, 1': a reaction is called 'hop'",
    ),
}


@pytest.mark.parametrize("name", WRONG)
def test_a_slip_is_told_with_line_and_cure(name):
    text, why = WRONG[name]
    with pytest.raises(ValueError, match=why):
        Network.from_text(f"X -> Y, 1\n{text}")


def test_as_many_lines_as_may_be():
    network = Network.from_text(f"for i in 1..{MOST_LINES}: A[i] -> A[i+1], k * i * 2\nk = 3")
    assert len(network.channels) == MOST_LINES
    assert network.known_rates[-1] == 6.0 * MOST_LINES
