"""The mean of min(T, horizon) and the chance of T by the horizon: closed forms within their bounds, at any scale."""

from math import comb, exp, expm1, factorial

import numpy as np
import pytest

from kinetics import Network, first_passage
from kinetics.markov.network_questions import chain_to
from kinetics.predicting.ranking.yield_and_first_time import first_by

DECAY = Network.from_reactions({"decay": ({"A": 1}, {"B": 1})}, [0.7])
CHAIN = Network.from_reactions(
    {"on": ({"A": 1}, {"B": 1}), "off": ({"B": 1}, {"A": 1}), "done": ({"B": 1}, {"C": 1})}, [2.0, 3.0, 0.5]
)


def asked(network, initial, species, horizon, copies=1):
    return first_by(*chain_to(network, initial, species, copies), horizon)


@pytest.mark.parametrize("horizon", [1e-9, 1e-3, 0.3, 5.0, 400.0])
def test_one_exponential_wait(horizon):
    first, reached, _ = asked(DECAY, {"A": 1}, "B", horizon)
    mean = -expm1(-0.7 * horizon) / 0.7
    assert first.low * (1 - 1e-15) <= mean <= first.high * (1 + 1e-15)
    assert first.error < 1e-12 * mean
    assert reached.low <= -expm1(-0.7 * horizon) * (1 + 1e-15)
    assert -expm1(-0.7 * horizon) * (1 - 1e-15) <= reached.high
    wrong = -expm1(-0.7 * (1 + 1e-9) * horizon) / 0.7  # the control: another rate, where that can be seen
    assert not 0.1 < horizon < 10 or abs(first.value - wrong) > first.error


def test_a_late_horizon_restricts_nothing():
    whole, (first, reached, sd) = first_passage(CHAIN, {"A": 2}, "C"), asked(CHAIN, {"A": 2}, "C", 2000.0)
    assert first.value == pytest.approx(whole.mean, rel=1e-9)
    assert sd == pytest.approx(whole.sd, rel=1e-9)
    assert reached.value == pytest.approx(1.0, abs=1e-12)


def test_the_mean_is_the_integral_of_the_survival_function():
    times = np.linspace(0.0, 3.0, 3001)
    survival = first_passage(CHAIN, {"A": 2}, "C").survival(times)
    first, reached, _ = asked(CHAIN, {"A": 2}, "C", 3.0)
    assert first.value == pytest.approx(float(np.trapezoid(survival, times)), rel=1e-6)
    assert reached.value == pytest.approx(1.0 - float(survival[-1]), abs=1e-12)


@pytest.mark.parametrize("horizon", [0.3, 5.0, 50.0])
def test_what_cannot_happen_has_probability_and_spread_zero(horizon):
    """One A can never make the two B that a C needs; nor can a chain that cannot move at all."""
    pair = Network.from_reactions(
        {"on": ({"A": 1}, {"B": 1}), "off": ({"B": 1}, {"A": 1}), "done": ({"B": 2}, {"C": 1})}, [1.1, 0.9, 1.0]
    )
    for network, target in ((pair, "C"), (DECAY.with_rates([0.0]), "B")):
        first, reached, sd = asked(network, {"A": 1}, target, horizon)
        assert (reached.value, reached.high, sd) == (0.0, 0.0, 0.0)
        assert first.value == pytest.approx(horizon, abs=first.error)
        assert first.value <= horizon
    assert asked(pair, {"A": 2}, "C", horizon)[1].value > 0.0  # the control: two can
    first, reached, sd = asked(DECAY, {"B": 1}, "B", horizon)
    assert (first.value, reached.value, sd) == (0.0, 1.0, 0.0)


@pytest.mark.parametrize("horizon", [1e-2, 1e-4, 1e-7, 1e-10])
def test_small_probabilities_keep_their_digits(horizon):
    """All of four A decay: (1 - exp(-k t))**4, down to 1e-41; the sd follows from the integral of what is left."""
    _, reached, sd = asked(DECAY, {"A": 4}, "B", horizon, copies=4)
    p = -expm1(-0.7 * horizon)
    assert reached.value == pytest.approx(p**4, rel=1e-9, abs=0.0)
    # F(u) = (1 - exp(-k u))**4 is (k u)**4 * (1 - 2 k u + ...) where k u is small; 2 int (h - u) F(u) du.
    square = 2 * 0.7**4 * horizon**6 * (1 / 30 - 2 * 0.7 * horizon / 42)
    assert sd == pytest.approx(square**0.5, rel=10 * horizon**2 + 1e-9, abs=0.0)


@pytest.mark.parametrize("horizon", [0.5, 3.0, 20.0])
def test_the_spread_is_right_where_the_target_is_likely_too(horizon):
    """All of four A decay: the moments by the binomial theorem, term by term."""
    first, _, sd = asked(DECAY, {"A": 4}, "B", horizon, copies=4)
    terms = [((-1) ** (j + 1) * comb(4, j), 0.7 * j) for j in range(1, 5)]
    mean = sum(sign * -expm1(-r * horizon) / r for sign, r in terms)
    square = sum(sign * 2 * (1 - exp(-r * horizon) * (1 + r * horizon)) / r**2 for sign, r in terms)
    assert first.value == pytest.approx(mean, rel=1e-11)
    assert sd == pytest.approx((square - mean**2) ** 0.5, rel=1e-9)


@pytest.mark.parametrize("horizon", [1e-6, 1e-3])
def test_a_small_probability_has_digits(horizon):
    """Five decays in a row by a horizon: Poisson tails down to 1e-33, known to eleven digits."""
    row = {f"{i}": ({f"X{i}": 1}, {f"X{i + 1}": 1}) for i in range(5)}
    _, reached, _ = asked(Network.from_reactions(row, [0.7] * 5), {"X0": 1}, "X5", horizon)
    mean = 0.7 * horizon
    exact = exp(-mean) * sum(mean**k / factorial(k) for k in range(5, 30))
    assert abs(reached.value - exact) <= reached.error < 1e-11 * exact
    _, other, _ = asked(Network.from_reactions(row, [0.7 * (1 + 1e-9)] * 5), {"X0": 1}, "X5", horizon)
    assert abs(other.value - exact) > other.error  # the control
