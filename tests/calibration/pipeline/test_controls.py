"""Controls of a plan are named by what sets them apart from the rates that are judged."""

from pathlib import Path

import pytest

from calibration.pipeline.controls import load_controls
from kinetics.rates import Rates

LINE4 = Path(__file__).parents[3] / "results" / "line4"


@pytest.fixture(scope="module")
def rates():
    return Rates.load(LINE4 / "rates.toml")


def test_controls_are_named_by_break_model_and_crowding(rates):
    names = [str(LINE4 / f"{name}.toml") for name in ("first-order", "uncrowded")]
    found = load_controls(names, rates)
    assert found["no crowding"].channels == Rates.load(names[1]).channels
    (other,) = set(found) - {"no crowding"}
    assert other.startswith("first-order breaks")


def test_rates_like_those_that_are_judged_are_no_control(rates):
    with pytest.raises(ValueError, match=r"rates.toml: .* breaks and crowding, as the rates that are judged"):
        load_controls([str(LINE4 / "rates.toml")], rates)


def test_no_names_give_no_controls(rates):
    assert load_controls([], rates) == {}
