"""The restricted mean: closed forms within the stated error at every scale, and what is refused."""

from math import comb, exp, expm1, factorial

import numpy as np
import pytest

from kinetics import Network, first_passage
from kinetics.markov.passage.restricted import restricted_passage

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


@pytest.mark.parametrize("horizon", [0.3, 5.0, 50.0])
def test_what_cannot_happen_has_probability_and_spread_zero(horizon):
    """One A can never make the two B that a C needs; likewise a chain that cannot move at all."""
    pair = Network.from_reactions(
        {"on": ({"A": 1}, {"B": 1}), "off": ({"B": 1}, {"A": 1}), "done": ({"B": 2}, {"C": 1})}, [1.1, 0.9, 1.0]
    )
    still = Network.from_reactions({"decay": ({"A": 1}, {"B": 1})}, [0.0])
    for network, target in ((pair, "C"), (still, "B")):
        found = restricted_passage(network, {"A": 1}, target, horizon)
        assert (found.reached, found.sd) == (0.0, 0.0)
        assert found.mean == pytest.approx(horizon, abs=found.mean_error)
        assert found.mean <= horizon
    assert restricted_passage(pair, {"A": 2}, "C", horizon).reached > 0.0  # the control: two can


@pytest.mark.parametrize("horizon", [1e-2, 1e-4, 1e-7, 1e-10])
def test_small_probabilities_keep_their_digits(horizon):
    """All of four A decay: (1 - exp(-k t))**4, down to 1e-41; the sd follows from the integral of what is left."""
    found = restricted_passage(DECAY, {"A": 4}, "B", horizon, copies=4)
    p = -expm1(-0.7 * horizon)
    assert found.reached == pytest.approx(p**4, rel=1e-9, abs=0.0)
    # F(u) = (1 - exp(-k u))**4 is (k u)**4 * (1 - 2 k u + ...) where k u is small; 2 int (h - u) F(u) du.
    square = 2 * 0.7**4 * horizon**6 * (1 / 30 - 2 * 0.7 * horizon / 42)
    assert found.sd == pytest.approx(square**0.5, rel=10 * horizon**2 + 1e-9, abs=0.0)


@pytest.mark.parametrize("horizon", [0.5, 3.0, 20.0])
def test_the_spread_is_right_where_the_target_is_likely_too(horizon):
    """All of four A decay: the moments by the binomial theorem, term by term."""
    found = restricted_passage(DECAY, {"A": 4}, "B", horizon, copies=4)
    terms = [((-1) ** (j + 1) * comb(4, j), 0.7 * j) for j in range(1, 5)]
    mean = sum(sign * -expm1(-r * horizon) / r for sign, r in terms)
    square = sum(sign * 2 * (1 - exp(-r * horizon) * (1 + r * horizon)) / r**2 for sign, r in terms)
    assert found.mean == pytest.approx(mean, rel=1e-11)
    assert found.sd == pytest.approx((square - mean**2) ** 0.5, rel=1e-9)


def test_a_rate_beyond_all_numbers_is_refused_and_times_of_any_scale_are_not():
    fast = Network.from_reactions({"decay": ({"A": 1}, {"B": 1})}, [1e300])
    with pytest.raises(ValueError, match=r"would take inf steps until 1e\+300 tu"):
        restricted_passage(fast, {"A": 1}, "B", 1e300)
    found = restricted_passage(fast, {"A": 1}, "B", 1e-300)
    unit = restricted_passage(Network.from_reactions({"decay": ({"A": 1}, {"B": 1})}, [1.0]), {"A": 1}, "B", 1.0)
    assert found.sd == pytest.approx(1e-300 * unit.sd, rel=1e-12, abs=0.0)


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"horizon": 1e9}, "steps until 1e.09 tu"),
        ({"max_seconds": 1e-12}, "max_seconds = 1e-12 are allowed"),
        ({"max_seconds": float("nan")}, "max_seconds = nan are allowed"),
        ({"max_states": 1}, "over 1 states"),
        ({"max_states": 0}, "max_states = 0; expected a whole number of at least 1"),
        ({"species": "D"}, "unknown species 'D'"),
        ({"copies": -1}, "copies = -1"),
        ({"horizon": -1.0}, "times"),
    ],
)
def test_what_is_refused(settings, message):
    asked = {"initial": {"A": 2}, "species": "C", "horizon": 3.0} | settings
    with pytest.raises(ValueError, match=message):
        restricted_passage(CHAIN, **asked)


@pytest.mark.parametrize("horizon", [1e-6, 1e-3])
def test_a_small_probability_has_digits(horizon):
    """Five decays in a row by a horizon: Poisson tails down to 1e-33, known to eleven digits."""
    row = {f"{i}": ({f"X{i}": 1}, {f"X{i + 1}": 1}) for i in range(5)}
    found = restricted_passage(Network.from_reactions(row, [0.7] * 5), {"X0": 1}, "X5", horizon)
    mean = 0.7 * horizon
    exact = exp(-mean) * sum(mean**k / factorial(k) for k in range(5, 30))
    assert abs(found.reached - exact) <= found.reached_error < 1e-11 * exact
    other = restricted_passage(Network.from_reactions(row, [0.7 * (1 + 1e-9)] * 5), {"X0": 1}, "X5", horizon)
    assert abs(other.reached - exact) > other.reached_error  # the control
