"""A break model is added by one file and its line in `models.py`: the contract tests it, and sees a bad one."""

import pytest
from scratch import add_line, run_contract, scratch_copy

NEW = '''"""A break model made for a test."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from kinetics.rates.breaks.base import ALONE, WALL, BreakModel, ShapeParameter
from kinetics.network import Network
from kinetics.support.arrays import Floats


class NewMember(BreakModel):
    """The last species and the wall break structures, which also break by themselves."""

    name = "newmember"

    def partners(self, network: Network) -> tuple[str, ...]:
        """Three of them."""
        return (network.species[-1], WALL, ALONE)

    def parameters(self, network: Network) -> tuple[ShapeParameter, ...]:
        """How often by themselves."""
        return (ShapeParameter("alone", 0.0, 100.0, 2.0, is_weight=True),)

    def weights(self, network: Network, shape: Mapping[str, float]) -> Floats:
        """In units of the last species."""
        return np.array([1.0, 3.0, shape["alone"]])
'''
BREAKS = "kinetics/rates/breaks"


@pytest.fixture
def copy(tmp_path):
    found = scratch_copy(tmp_path)
    add_line(
        found / BREAKS / "models.py",
        "import CollisionSpecies",
        "from kinetics.rates.breaks.new_member import NewMember",
    )
    return found


def test_a_new_model_passes_the_contract(copy):
    (copy / BREAKS / "new_member.py").write_text(NEW)
    code, said = run_contract(copy, "test_breaks.py", "-k", "newmember")
    assert code == 0, said
    assert "12 passed" in said


def test_a_wrong_one_does_not(copy):
    """Control: a partner that is no species, and a weight too many."""
    assert "network.species[-1], WALL" in NEW
    wrong = NEW.replace("network.species[-1], WALL", 'network.species[-1], "lid", WALL')
    (copy / BREAKS / "new_member.py").write_text(wrong)
    code, said = run_contract(
        copy, "test_breaks.py", "-k", "newmember and (partners or pairs_of_bodies)", "-rf", "--tb=no"
    )
    assert code == 1, said
    assert "::test_partners_are_known_and_weights_are_positive[newmember]" in said
    assert "::test_propensities_are_those_of_pairs_of_bodies[newmember-distinct]" in said
