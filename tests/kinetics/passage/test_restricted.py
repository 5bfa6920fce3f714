"""The restricted mean: closed forms within the stated error at every scale, and what is refused."""

from math import exp, expm1

import numpy as np
import pytest

from kinetics import Network, first_passage
from kinetics.passage.restricted import restricted_passage

DECAY = Network.from_reactions({"decay": ({"A": 1}, {"B": 1})}, [0.7])
CHAIN = Network.from_reactions(
    {"on": ({"A": 1}, {"B": 1}), "off": ({"B": 1}, {"A": 1}), "done": ({"B": 1}, {"C": 1})}, [2.0, 3.0, 0.5]
)


@pytest.mark.parametrize("horizon", [1e-9, 1e-3, 0.3, 5.0, 400.0])
def test_one_exponential_wait(horizon):
    found = restricted_passage(DECAY, {"A": 1}, "B", horizon)
    mean = -expm1(-0.7 * horizon) / 0.7
    assert abs(found.mean - mean) <= found.mean_error + 1e-15 * mean
    assert found.mean_error < 1e-11 * horizon
    assert abs(found.reached + expm1(-0.7 * horizon)) <= found.reached_error < 1e-11
    wrong = -expm1(-0.7 * (1 + 1e-9) * horizon) / 0.7  # the control: another rate, where that can be seen
    assert not 0.1 < horizon < 10 or abs(found.mean - wrong) > found.mean_error


def test_a_late_horizon_restricts_nothing():
    whole, found = first_passage(CHAIN, {"A": 2}, "C"), restricted_passage(CHAIN, {"A": 2}, "C", 2000.0)
    assert found.mean == pytest.approx(whole.mean, rel=1e-9)
    assert found.sd == pytest.approx(whole.sd, rel=1e-9)
    assert found.reached == pytest.approx(1.0, abs=1e-12)


def test_the_mean_is_the_integral_of_the_survival_function():
    times = np.linspace(0.0, 3.0, 3001)
    survival = first_passage(CHAIN, {"A": 2}, "C").survival(times)
    found = restricted_passage(CHAIN, {"A": 2}, "C", 3.0)
    assert found.mean == pytest.approx(float(np.trapezoid(survival, times)), rel=1e-6)
    assert found.reached == pytest.approx(1.0 - float(survival[-1]), abs=1e-12)


def test_a_target_out_of_reach_counts_with_the_horizon_and_one_that_is_there_with_nothing():
    never = restricted_passage(DECAY, {"A": 1}, "B", 5.0, copies=2)
    assert (never.mean, never.reached) == (pytest.approx(5.0, abs=never.mean_error), pytest.approx(0.0, abs=1e-12))
    there = restricted_passage(DECAY, {"B": 1}, "B", 5.0)
    assert (there.mean, there.sd, there.reached) == (0.0, 0.0, 1.0)


def test_two_waits_have_their_spread():
    """Of min(T, h) for one exponential wait."""
    h = 2.0
    mean, square = -expm1(-0.7 * h) / 0.7, 2 * (1 - exp(-0.7 * h) * (1 + 0.7 * h)) / 0.49
    assert restricted_passage(DECAY, {"A": 1}, "B", h).sd == pytest.approx((square - mean**2) ** 0.5, rel=1e-9)


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"horizon": 1e9}, "steps until 1e.09 tu"),
        ({"max_seconds": 1e-12}, "max_seconds = 1e-12 are allowed"),
        ({"max_states": 1}, "over 1 states"),
        ({"species": "D"}, "unknown species 'D'"),
        ({"copies": -1}, "copies = -1"),
        ({"horizon": -1.0}, "times"),
    ],
)
def test_what_is_refused(settings, message):
    asked = {"initial": {"A": 2}, "species": "C", "horizon": 3.0} | settings
    with pytest.raises(ValueError, match=message):
        restricted_passage(CHAIN, **asked)
