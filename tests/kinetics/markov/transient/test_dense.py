from dataclasses import replace
from decimal import Decimal, localcontext
from fractions import Fraction
from math import comb

import numpy as np
import pytest
from known_systems import line, network, switch
from numpy.testing import assert_allclose
from scipy.linalg import expm
from scipy.special import gammaln

from kinetics.markov.transient import Dense, reachable
from kinetics.markov.transient.certificate import Entries, distance, exact_entries
from kinetics.markov.transient.dense import estimated_error, exponential_action
from kinetics.markov.transient.fixedpoint import FixedPoint
from kinetics.trust.hardcases.stiffness import leak_exact

EPSILON = 2.0**-52


def leak_rates(fast, slow):
    """A <-> B quickly, B -> C slowly."""
    return np.array([[0, fast, 0], [fast, 0, slow], [0, 0, 0.0]])


def decimal_exponential(rates, times):
    """exp(Q t) (T, N, N) by Taylor series and squaring in 120 digits; slow and obvious."""
    n = len(rates)
    with localcontext() as context:
        context.prec = 120
        Q = [[Decimal(float(x)) for x in row] for row in rates]
        for i in range(n):
            Q[i][i] = -sum(Q[i])

        def times_of(A, B):
            return [[sum(A[i][k] * B[k][j] for k in range(n)) for j in range(n)] for i in range(n)]

        answers = []
        for time in times:
            halvings = max(0, int(np.log2(rates.sum(axis=1).max() * time)) + 4)
            scale = Decimal(float(time)) / 2**halvings
            result = [[Decimal(int(i == j)) for j in range(n)] for i in range(n)]
            term = result
            for m in range(1, 60):
                term = [[x * scale / m for x in row] for row in times_of(term, Q)]
                result = [[a + b for a, b in zip(*rows, strict=True)] for rows in zip(result, term, strict=True)]
            for _ in range(halvings):
                result = times_of(result, result)
            answers.append(result)
        return np.array(answers)


def entries(rates):
    rows, columns = np.nonzero(rates)
    return Entries(rows, columns, rates[rows, columns])


def random_chain(rng, n, share=0.6):
    rates = 10.0 ** rng.uniform(-12, 8, (n, n)) * (rng.random((n, n)) < share)
    np.fill_diagonal(rates, 0.0)
    return rates


@pytest.mark.parametrize("fast", [1.0, 1e3, 1e6, 1e10, 1e15])
def test_stiff_pair_with_a_slow_leak(fast):
    times = np.array([1e-12, 1.0, 1e3])
    rates, start = leak_rates(fast, 1e-3), np.array([1.0, 0, 0])
    p = exponential_action(rates, start, times)
    exact = np.array([leak_exact(fast, 1e-3, time) for time in times])
    assert_allclose(p, exact, rtol=1e-14, atol=1e-280)
    seen = abs(p - exact).sum(axis=1).max()
    proven = distance(entries(rates), start, times, p)
    assert abs(seen - proven) < 4 * EPSILON  # the reference is rounded too
    assert proven < 1e-14
    assert seen <= estimated_error(rates, start, times, p) < 1e-12


def test_where_scipy_loses_mass():
    # The control: the same question to scipy's expm loses mass in proportion to q t.
    rates = leak_rates(1e15, 1e-3)
    Q = rates - np.diag(rates.sum(axis=1))
    assert abs(expm(Q).sum(axis=1) - 1).max() > 1e-3
    p = exponential_action(rates, np.array([1.0, 0, 0]), np.array([1.0]))
    assert abs(p.sum() - 1) < 2 * EPSILON


@pytest.mark.parametrize("seed", range(6))
def test_random_chains_over_many_decades(seed):
    rates = random_chain(np.random.default_rng(seed), 5)
    times = np.array([1e-9, 0.37, 1e4])
    exact = decimal_exponential(rates, times)
    for start in np.eye(5):
        p = exponential_action(rates, start, times)
        rows = exact[:, int(start.argmax())]
        assert_allclose(p, rows.astype(float), rtol=1e-13, atol=1e-270)
        errors = [sum(abs(Decimal(x) - y) for x, y in zip(*pair, strict=True)) for pair in zip(p, rows, strict=True)]
        seen = float(max(errors))
        # The bound is above the error, and hardly so.
        assert seen <= distance(entries(rates), start, times, p) <= 1.02 * seen + 1e-19
        assert seen <= estimated_error(rates, start, times, p) < 1e-11


def test_the_bound_holds_and_is_close_on_many_chains():
    """80 random chains of 2 to 6 states and times over 12 decades, some chains reducible, against 120 digits."""
    rng = np.random.default_rng(7)
    for _ in range(80):
        n = int(rng.integers(2, 7))
        rates = random_chain(rng, n, rng.uniform(0.2, 1.0))
        rates[0, 1] = 10.0 ** rng.uniform(-12, 8)
        times = np.array([10.0 ** rng.uniform(-8, 4)])
        p = exponential_action(rates, np.eye(1, n)[0], times)
        exact = decimal_exponential(rates, times)[0, 0]
        with localcontext() as context:
            context.prec = 120
            seen = float(sum(abs(Decimal(float(x)) - y) for x, y in zip(p[0], exact, strict=True)))
        assert seen <= distance(entries(rates), np.eye(1, n)[0], times, p) <= 1.02 * seen + 1e-19


def test_a_wrong_answer_is_seen_by_the_bound():
    # The control: 1e-15 moved from one state to another.
    rates, start, times = leak_rates(1e12, 1e-3), np.array([1.0, 0, 0]), np.array([3.0])
    p = exponential_action(rates, start, times)
    moved = p + np.array([1e-15, 0.0, -1e-15])
    assert distance(entries(rates), start, times, moved) > 1e-15 > distance(entries(rates), start, times, p)


def test_rates_are_taken_to_the_last_bit():
    # 0.1 * 3 is no double: certified against the product itself, of the same network written otherwise.
    reactions = {"out": ((1, 0), (0, 1)), "back": ((0, 1), (1, 0))}
    net = network("AB", reactions, [0.1, 0.7])
    found = exact_entries(reachable(net, [3, 0]))
    assert found.is_certified
    for row, column, (rate, copies) in ((0, 1, (0.1, 3)), (1, 2, (0.1, 2)), (1, 0, (0.7, 1)), (3, 2, (0.7, 3))):
        here = (found.rows == row) & (found.columns == column)
        assert sum(Fraction(float(x)) for x in found.rates[here]) == Fraction(rate) * copies


@pytest.mark.parametrize("combinations", ["distinct", "ordered", "product"])
def test_any_mass_action_rate_is_taken_to_the_last_bit(combinations):
    """Constants and ways of 53 bits each, and more combinations than a double counts: products of up to 180 bits."""
    turn = network("ABC", {"turn": ((5, 1, 0), (5, 0, 1))}, [0.1], combinations)
    net, have = replace(turn, ways=np.array([1 / 3])), 50_003
    found = exact_entries(reachable(net, [have, 1, 0]))
    ways = {"distinct": comb(have, 5), "ordered": comb(have, 5) * 120, "product": have**5}[combinations]
    assert ways > 2**53
    assert found.is_certified
    assert sum(map(Fraction, found.rates.tolist())) == Fraction(0.1) * Fraction(1 / 3) * ways
    assert Fraction(float(found.rates[0])) != Fraction(0.1) * Fraction(1 / 3) * ways  # the control
    small = replace(network("AB", {"turn": ((2, 0), (1, 1))}, [0.1], combinations), ways=np.array([1 / 3]))
    solution = Dense().solve(small, [12, 0], [0.4, 3.0])
    assert solution.is_bound
    assert solution.error < 1e-14


def test_a_rate_below_all_doubles_is_not_taken_for_exact():
    tiny = network("AB", {"turn": ((1, 0), (0, 1))}, [1.1e-308])
    assert exact_entries(reachable(tiny, [1, 0])).is_certified
    assert not exact_entries(reachable(replace(tiny, ways=np.array([1e-3])), [1, 0])).is_certified


def test_the_bound_of_a_network():
    law = Dense().solve(line(), [12, 0, 0, 0], [3.0, 2000.0])
    assert law.is_bound
    assert law.error < 1e-14
    estimated = Dense(certified_states=10).solve(line(), [12, 0, 0, 0], [3.0, 2000.0])
    assert not estimated.is_bound
    assert law.error < estimated.error < 1e-12


def test_digits_are_exact():
    arithmetic = FixedPoint.of(5)
    rng = np.random.default_rng(3)
    a, b = rng.random((2, 5, 5)) / 5
    exact = [[sum(Fraction(a[i, k]) * Fraction(b[k, j]) for k in range(5)) for j in range(5)] for i in range(5)]
    for count in (2, 4, 12):
        product = arithmetic.multiply(arithmetic.digits(a, 12), arithmetic.digits(b, 12), count)
        scale = [Fraction(1, 2 ** (arithmetic.bits * d)) for d in range(count + 1)]
        off = [
            sum(
                abs(sum(int(x) * s for x, s in zip(product[:, i, j], scale, strict=True)) - exact[i][j])
                for j in range(5)
            )
            for i in range(5)
        ]
        assert float(max(off)) <= arithmetic.lost(count)
        assert abs(product[1:]).max() <= 2.0 ** (arithmetic.bits - 1)
    third = arithmetic.divide(arithmetic.digits(np.array([1.0]), 6), 3)
    assert abs(
        sum(int(x) * Fraction(1, 2 ** (arithmetic.bits * d)) for d, x in enumerate(third[:, 0])) - Fraction(1, 3)
    ) <= (Fraction(1, 2 ** (arithmetic.bits * 6)))
    with pytest.raises(ValueError, match="bits take more than 40 digits"):
        arithmetic.digits_for(5000.0)


def test_poisson_tails():
    # Births at rate 1: p(k; t) = exp(-t) t**k / k!, down to 1e-120 and below, each to 13 digits.
    n = 60
    rates = np.diag(np.ones(n), 1)
    times = np.array([1e-3, 0.5, 20.0])
    p = exponential_action(rates, np.eye(1, n + 1)[0], times)
    k = np.arange(n)
    with np.errstate(divide="ignore"):
        exact = np.array([np.exp(-t) * np.cumprod(np.r_[1.0, t / k[1:]]) for t in times])
    shown = exact > 1e-270
    assert exact[shown].min() < 1e-200
    assert_allclose(p[:, :n][shown], exact[shown], rtol=3e-13)
    assert_allclose(np.log(p[2, 40]), -20 + 40 * np.log(20) - gammaln(41), rtol=1e-13)


def test_many_times_are_each_as_good_as_one():
    times = np.geomspace(1e-6, 1e6, 40)
    together = Dense().solve(switch(3.0, 1e5), [4, 0], times)
    for i in (0, 13, 39):
        alone = Dense().solve(switch(3.0, 1e5), [4, 0], times[i : i + 1])
        assert_allclose(together.probabilities[i], alone.probabilities[0], rtol=1e-13)


def test_nothing_happens():
    nothing, start, times = np.zeros((2, 2)), np.array([0.25, 0.75]), np.array([0.0, 5.0])
    p = exponential_action(nothing, start, times)
    assert_allclose(p, [[0.25, 0.75]] * 2, rtol=0)
    assert distance(entries(nothing), start, times, p) == estimated_error(nothing, start, times, p) == 0.0


def test_too_many_states():
    with pytest.raises(ValueError, match="over 2000 states are reachable"):
        Dense().solve(switch(), [2001, 0], [1.0])
