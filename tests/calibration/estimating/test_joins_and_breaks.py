"""One definition of a join and of a break."""

import numpy as np
import pytest

from calibration.estimating.joins_and_breaks import joins_and_breaks
from calibration.validating.groups import event_groups
from kinetics.assembly import RuleBook, derive
from kinetics.network import Network
from mechsim.runs.record import kinds


@pytest.mark.parametrize("book", ["line4", "t5"])
def test_joins_and_breaks_of_a_rule_book_are_those_of_its_derivation(book):
    derivation = derive(RuleBook.load(book))
    groups = joins_and_breaks(derivation.network)
    for kind, group in (("join", "joins"), ("break", "breaks")):
        assert groups[group].tolist() == [each == kind for each in kinds(derivation)]


def test_what_is_neither_join_nor_break_is_in_no_group():
    """A conversion, an exchange and a copy that decays; by the number of reactants alone they would be in one."""
    species = ("a", "b", "ab")
    reactants = [[1, 1, 0], [0, 0, 1], [1, 0, 0], [1, 1, 0], [1, 0, 0]]
    changes = [[-1, -1, 1], [1, 1, -1], [-1, 1, 0], [1, -1, 0], [-1, 0, 0]]
    network = Network(species, ("join", "break", "turn", "exchange", "decay"), reactants, changes, np.ones(5))
    assert {name: members.tolist() for name, members in joins_and_breaks(network).items()} == {
        "joins": [True, False, False, False, False],
        "breaks": [False, True, False, False, False],
    }
    assert event_groups(network)["breaks"] == ("break",)
    assert list(event_groups(network)) == ["joins", "breaks", *network.channels]


def test_a_group_without_channels_is_left_out():
    assert joins_and_breaks(Network(("a", "b"), ("turn",), [[1, 0]], [[-1, 1]], [1.0])) == {}
