"""Errors that solvers tell, each term by hand: a bound that lost a term still holds on most chains."""

from fractions import Fraction
from math import ceil, floor, log, log2

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from kinetics import Network
from kinetics.markov.transient.certificate import ABOVE, Entries, best_entries, distance, exact_products, series_terms
from kinetics.markov.transient.poisson import ROUNDOFF, poisson_bounds, poisson_tails, poisson_window, window_error
from kinetics.markov.transient.states import reachable
from kinetics.markov.transient.transitions import RATE_ERROR
from kinetics.markov.transient.uniformisation import STEP_SECONDS, Absorption, DiscreteChain, mixtures

ROWS, COLUMNS, RATES = np.array([0, 1, 1, 2]), np.array([1, 0, 2, 1]), np.array([3.0, 1.0, 0.5, 0.25])
EXITS = np.array([3.0, 1.5, 0.25])
P = np.array([[0.0, 1.0, 0.0], [1 / 3, 0.5, 1 / 6], [0.0, 1 / 12, 11 / 12]])  # steps at 3 per time


def chain():
    return DiscreteChain.from_rates(ROWS, COLUMNS, RATES, EXITS)


@pytest.mark.parametrize("mean", [1e-6, 0.7, 30.0, 1e5])
@pytest.mark.parametrize("tolerance", [1e-2, 1e-15])
def test_the_window_is_where_chernoffs_bounds_fall_to_half_the_tolerance(mean, tolerance):
    """P(N >= mean + x) <= exp(-x**2 / (2 mean + 2 x / 3)), P(N <= mean - x) <= exp(-x**2 / (2 mean))."""
    depth = log(2 / tolerance)
    x = np.roots([1.0, -2 * depth / 3, -2 * mean * depth]).max()
    first, last = poisson_bounds(mean, tolerance)
    assert last == ceil(mean + x)
    assert first == max(0, floor(mean - (2 * mean * depth) ** 0.5))


def test_tails_and_error_of_a_window_by_hand():
    weights = np.array([0.25, 0.5, 0.25])
    assert_allclose(poisson_tails(2, weights, 0.125), [1, 1, 0.875, 0.375, 0.125])
    # A quarter each is one ratio away from the mode, which rounds twice.
    rounding = ROUNDOFF * (2 * 0.5 + 2 * 2.0 + 2 * log2(3) + 40)
    assert window_error(4.0, 3, weights, 0.0) == pytest.approx(rounding, rel=1e-12, abs=0.0)
    assert window_error(4.0, 3, weights, 1.0) == pytest.approx(2.0 + rounding, rel=1e-12, abs=0.0)
    assert window_error(4.9, 3, weights, 0.0) == pytest.approx(
        rounding + ROUNDOFF * 2 * (4.9**0.5 - 2), rel=1e-12, abs=0.0
    )
    first, alone = poisson_window(0.0, 1e-9)
    assert (first, alone.tolist()) == (0, [1.0])


def test_a_discrete_chain_by_hand():
    made = chain()
    assert (made.rate, made.size, made.rate_error) == (3.0, 3, RATE_ERROR)
    assert made.terms == 2 + 2  # two rates lead into the second state, and two out of it
    assert DiscreteChain.from_rates(ROWS, COLUMNS, RATES, EXITS, most_out=7).terms == 2 + 7
    assert_allclose(made.transposed.toarray(), P.T, rtol=1e-15)
    assert_allclose(made.inflows.toarray(), (P - np.diag(np.diag(P))).T, rtol=1e-15)
    assert made.steps_until(10.0, 1e-9) == poisson_bounds(30.0, 1e-9)[1]
    assert made.step_seconds == pytest.approx(STEP_SECONDS * 7)
    nothing = DiscreteChain.from_rates(ROWS[:0], COLUMNS[:0], RATES[:0], np.zeros(2))
    assert (nothing.rate, nothing.terms) == (1.0, 0)


def test_rounding_of_steps_by_hand():
    made = chain()
    unit = 1.001 * ROUNDOFF
    assert made.rounding(100, 7, 3.0) == pytest.approx(unit * (100 + (4 + 2 * 3 + 6) * 7), rel=1e-12, abs=0.0)
    assert made.rounding(100, 7) == pytest.approx(unit * (100 + (4 + 2 * RATE_ERROR + 6) * 7), rel=1e-12, abs=0.0)
    assert made.rounding(100) == pytest.approx(unit * (100 + (4 + 2 * RATE_ERROR + 6) * 100), rel=1e-12, abs=0.0)
    assert made.rounding(100, 0, 0.0) == pytest.approx(unit * 100, rel=1e-12, abs=0.0)


def steps(start, n):
    """Vectors after 0, 1, ... n - 1 steps, and the share of each that leaves its states."""
    vectors = [start]
    for _ in range(n - 1):
        vectors.append(vectors[-1] @ P)
    return np.array(vectors), np.array(vectors) @ (EXITS / 3.0)


@pytest.mark.parametrize("time", [0.4, 9.0, 30.0])  # one block of 64 steps, two, and three
def test_the_error_of_mixtures_by_hand(time):
    made, start, tolerance = chain(), np.array([1.0, 0.0, 0.0]), 1e-12
    first, weights = poisson_window(3 * time, tolerance / 2)
    n = first + weights.size
    vectors, flows = steps(start, n)
    jumps = float(flows @ poisson_tails(first, weights, tolerance))
    block = min(64, n)
    error = window_error(3 * time, first, weights, tolerance / 2) + ROUNDOFF * (block + weights.size / block + 2)
    found = mixtures(made, start, [time], tolerance)
    assert_allclose(found.probabilities[0], weights @ vectors[first:], rtol=0, atol=1e-14)
    assert_allclose(found.stays, vectors.sum(axis=0), rtol=1e-12)
    assert found.error == pytest.approx(error + made.rounding(n, jumps), rel=1e-9, abs=0.0)


def test_many_times_are_mixed_in_one_pass():
    times, start = [0.0, 0.4, 30.0, 9.0], np.array([0.25, 0.0, 0.75])
    together = mixtures(chain(), start, times, 1e-12)
    for time, row in zip(times, together.probabilities, strict=True):
        assert_allclose(row, mixtures(chain(), start, [time], 1e-12).probabilities[0], rtol=0, atol=1e-15)
    assert_array_equal(together.probabilities[0], start)
    assert together.error >= mixtures(chain(), start, [30.0], 1e-12).error * (1 - 1e-12)


def test_what_has_settled_ends_early_with_its_drift_in_the_error():
    """Far beyond the 1 % of its steps in which it settles: what is left is one product, and little more error."""
    made, start, time = chain(), np.array([1.0, 0.0, 0.0]), 1e5
    found = mixtures(made, start, [time], 1e-12)
    settled = np.array([1.0, 3.0, 6.0]) / 10.0  # by detailed balance
    assert_allclose(found.probabilities[0], settled, rtol=0, atol=1e-14)
    first, weights = poisson_window(3 * time, 0.5e-12)
    n = first + weights.size
    assert found.stays.sum() == pytest.approx(n, rel=1e-9)
    assert_allclose(found.stays / n, settled, atol=1e-3)
    tails = poisson_tails(first, weights, 1e-12)
    jumps = float(settled @ EXITS) / 3 * tails.sum()
    block = 64
    told = window_error(3 * time, first, weights, 0.5e-12) + ROUNDOFF * (block + weights.size / block + 2)
    told += made.rounding(n, jumps)
    assert told * (1 - 1e-3) <= found.error <= told + made.rounding(n, jumps)


def test_an_absorption_and_its_error_by_hand():
    """The last state takes everything; asked for a short time, a long one, and a short one again."""
    made = DiscreteChain.from_rates(np.array([0]), np.array([1]), np.array([2.0]), np.array([2.0, 0.0]))
    found = Absorption(made, np.array([1.0, 0.0]))
    for time in (0.5, 40.0, 0.1):
        gone, left, error = found.at(time, 1e-13)
        first, weights = poisson_window(2 * time, 1e-13)
        last = first + weights.size
        flows = np.eye(1, last)[0]  # the first step moves all
        told = window_error(2 * time, first, weights, 1e-13) + ROUNDOFF * (weights.size + 2 + 2)
        told += made.rounding(last, float(flows @ poisson_tails(first, weights, 1e-13)))
        assert error == pytest.approx(told, rel=1e-9, abs=0.0)
        assert gone == pytest.approx(-np.expm1(-2 * time), abs=error)
        assert left == pytest.approx(np.exp(-2 * time), abs=error)


def test_the_series_ends_at_the_first_term_below_what_is_cut_off():
    assert series_terms(2.0**-32) == 1  # 2**-32 / 2! is below
    assert series_terms(2.0**-33) == 2  # and not below its own half
    assert series_terms(2.0**-50) == 2
    assert series_terms(2.0**-51) == 3


def test_rates_are_exact_under_mass_action_alone():
    """Else they are as they came, with their errors."""
    third = Network.from_text("A -> B, 1\nB -> A, 3").with_rates([0.1 + 0.2, 1 / 3])
    lawful = Network.from_text("A -> B, 0.3 * A / (1 + A)\nB -> A, 3")
    for network, is_exact in ((third, True), (lawful, False)):
        space = reachable(network, network.state({"A": 3}))
        transitions = space.transitions()
        assert best_entries(transitions, None).rate_error == transitions.rate_error > 0.0
        found = best_entries(transitions, space)
        assert found.rate_error == (0.0 if is_exact else transitions.rate_error)
        assert found.rates.sum() == pytest.approx(transitions.rates.sum())
        assert (found.rates is transitions.rates) != is_exact


def test_products_are_kept_to_the_last_bit():
    rng = np.random.default_rng(4)
    rates = np.concatenate([rng.uniform(0.5, 1, 400) * 2.0 ** rng.integers(-40, 40, 400), [1.0 + 2.0**-52, 1e15 / 3]])
    entries = Entries(np.arange(402), np.arange(402), rates, 2.5)
    for factor in (0.1, 1 - 2.0**-53, 1e9 / 7, 1 + 2.0**-26):
        found = exact_products(entries, factor)
        assert found.rate_error == 2.5
        assert_array_equal(found.rows, np.tile(np.arange(402), 2))
        exact = [Fraction(rate) * Fraction(factor) for rate in rates.tolist()]
        parts = [Fraction(one) + Fraction(rest) for one, rest in found.rates.reshape(2, -1).T.tolist()]
        assert parts == exact


def test_errors_of_rates_count_in_every_jump_even_where_few_are_expected():
    """A slow way out of a state; two others, which nothing reaches, change as fast as can be."""
    rows, columns = np.array([0, 2, 3]), np.array([1, 3, 2])
    start, times = np.array([1.0, 0, 0, 0]), np.array([2.0])
    found = np.array([[np.exp(-2.0), -np.expm1(-2.0), 0, 0]])
    slow = Entries(rows, columns, np.array([1.0, 1e-3, 1e-3]), 4.0)
    sure = slow._replace(rate_error=0.0)
    added = distance(slow, start, times, found) - distance(sure, start, times, found)
    # Two jumps at most, as many as would be if the state stayed full: the bound goes by steps that are that short.
    expected = -np.expm1(-2.0)
    assert ABOVE * 2 * ROUNDOFF * 4 * expected <= added <= ABOVE**4 * 2 * ROUNDOFF * 4 * expected * 1.01
    fast = slow._replace(rates=np.array([1.0, 1e30, 1e30]))
    calm = fast._replace(rate_error=0.0)
    added_by_fast = distance(fast, start, times, found) - distance(calm, start, times, found)
    assert added_by_fast > 1e3 * added  # what powers of the chain may be off by, times its fastest state
