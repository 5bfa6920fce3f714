"""A model of rates is added by one file and its line in `RATE_MODELS`: the contract tests it, and sees a bad one."""

import pytest
from scratch import add_line, run_contract, scratch_copy

NEW = '''"""Squared: twice the reactants, four times the rate again."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from calibration.estimating.rate_model import RateModel, ShapeParameter
from kinetics.runs import JumpPath
from kinetics.support.arrays import Floats


@dataclass(frozen=True)
class Powered(RateModel):
    """Propensity k N h(s)^power: a model made for this test, whose shape parameter says how rates grow with h."""

    power: float = 1.0

    name = "newmember"
    shape = (ShapeParameter("power", 0.2, 3.0),)

    def combinations(self, path: JumpPath) -> Sequence[Floats]:
        """Those of mass action to a power."""
        return [path.network.combinations_of(path.states) ** self.power]
'''
BROKEN = """
    def speed(self, age: Floats) -> Floats:
        \"\"\"Not what `elapsed` integrates.\"\"\"
        return 1 + age
"""
DIVIDED = ("** self.power]", "** self.power / path.network.ways**2]")
MODELS = "calibration/estimating/models"


@pytest.fixture
def copy(tmp_path):
    found = scratch_copy(tmp_path)
    add_line(
        found / MODELS / "__init__.py",
        "import MassActionRates",
        f"from {MODELS.replace('/', '.')}.powered import Powered",
    )
    return found


def test_a_new_model_passes_the_contract(copy):
    (copy / MODELS / "powered.py").write_text(NEW)
    code, said = run_contract(copy, "test_estimators.py", "-k", "newmember and not truth")  # the long one is left out
    assert code == 0, said
    assert "15 passed" in said


def test_a_wrong_one_does_not(copy):
    """Control: a hazard that is not the derivative of its integral, and docking ways that cancel, and more."""
    assert DIVIDED[0] in NEW
    (copy / MODELS / "powered.py").write_text(NEW.replace(*DIVIDED) + BROKEN)
    code, said = run_contract(
        copy, "test_estimators.py", "-k", "newmember and (definition or docking)", "-rf", "--tb=no"
    )
    assert code == 1, said
    for case in ("test_likelihood_is_its_definition", "test_combinations_do_not_depend_on_the_docking_ways"):
        assert f"::{case}[newmember]" in said, f"{case} did not fail: {said}"
