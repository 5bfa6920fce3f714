from decimal import Decimal, localcontext

import numpy as np
import pytest
from known_systems import decay, line, network, switch
from numpy.testing import assert_allclose
from scipy.linalg import expm
from scipy.special import gammaln

from kinetics import Transient
from kinetics.hardcases.stiffness import leak_exact
from kinetics.methods.dense import Dense, exponential_action

EPSILON = 2.0**-52


def leak_rates(fast, slow):
    """A <-> B quickly, B -> C slowly."""
    return np.array([[0, fast, 0], [fast, 0, slow], [0, 0, 0.0]])


def decimal_exponential(rates, times):
    """exp(Q t) by Taylor series and squaring in 120 digits; slow and obvious."""
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
            answers.append([[float(x) for x in row] for row in result])
        return np.array(answers)


@pytest.mark.parametrize("fast", [1.0, 1e3, 1e6, 1e10, 1e15])
def test_stiff_pair_with_a_slow_leak(fast):
    times = np.array([1e-12, 1.0, 1e3])
    p, error = exponential_action(leak_rates(fast, 1e-3), np.array([1.0, 0, 0]), times)
    exact = np.array([leak_exact(fast, 1e-3, time) for time in times])
    assert_allclose(p, exact, rtol=1e-14, atol=1e-280)
    assert abs(p - exact).sum(axis=1).max() <= error < 1e-12


def test_where_scipy_loses_mass():
    # The control: the same question to scipy's expm loses mass in proportion to q t.
    rates = leak_rates(1e15, 1e-3)
    Q = rates - np.diag(rates.sum(axis=1))
    assert abs(expm(Q).sum(axis=1) - 1).max() > 1e-3
    p, _ = exponential_action(rates, np.array([1.0, 0, 0]), np.array([1.0]))
    assert abs(p.sum() - 1) < 2 * EPSILON


@pytest.mark.parametrize("seed", range(6))
def test_random_chains_over_many_decades(seed):
    rng = np.random.default_rng(seed)
    n = 5
    rates = 10.0 ** rng.uniform(-12, 8, (n, n)) * (rng.random((n, n)) < 0.6)
    np.fill_diagonal(rates, 0.0)
    times = np.array([1e-9, 0.37, 1e4])
    exact = decimal_exponential(rates, times)
    for start in np.eye(n):
        p, error = exponential_action(rates, start, times)
        expected = start @ exact
        assert_allclose(p, expected, rtol=1e-13, atol=1e-270)
        assert abs(p - expected).sum(axis=1).max() <= error < 1e-11


def test_poisson_tails():
    # Births at rate 1: p(k; t) = exp(-t) t**k / k!, down to 1e-120 and below, each to 13 digits.
    n = 60
    rates = np.diag(np.ones(n), 1)
    times = np.array([1e-3, 0.5, 20.0])
    p, _ = exponential_action(rates, np.eye(1, n + 1)[0], times)
    k = np.arange(n)
    with np.errstate(divide="ignore"):
        exact = np.array([np.exp(-t) * np.cumprod(np.r_[1.0, t / k[1:]]) for t in times])
    shown = exact > 1e-270
    assert exact[shown].min() < 1e-200
    assert_allclose(p[:, :n][shown], exact[shown], rtol=3e-13)
    assert_allclose(np.log(p[2, 40]), -20 + 40 * np.log(20) - gammaln(41), rtol=1e-13)


def test_against_scipy_and_uniformisation():
    law = Dense().solve(line(), [12, 0, 0, 0], [3.0, 40.0, 2000.0])
    other = Transient().solve(line(), [12, 0, 0, 0], [3.0, 40.0, 2000.0])
    assert abs(law.probabilities - other.probabilities).sum(axis=1).max() < law.error + other.error
    Q = law.space.generator().toarray()
    for time, row in zip(law.times, law.probabilities, strict=True):
        assert abs(row - expm(Q * time)[0]).sum() < law.error + 1e-12


def test_many_times_are_each_as_good_as_one():
    times = np.geomspace(1e-6, 1e6, 40)
    together = Dense().solve(switch(3.0, 1e5), [4, 0], times)
    for i in (0, 13, 39):
        alone = Dense().solve(switch(3.0, 1e5), [4, 0], times[i : i + 1])
        assert_allclose(together.probabilities[i], alone.probabilities[0], rtol=1e-13)


def test_nothing_happens():
    p, error = exponential_action(np.zeros((2, 2)), np.array([0.25, 0.75]), np.array([0.0, 5.0]))
    assert_allclose(p, [[0.25, 0.75]] * 2, rtol=0)
    assert error == 0.0
    frozen = network(("A",), {"never": ((1,), (0,))}, [0.0])
    assert_allclose(Dense().solve(frozen, [3], [1.0]).probabilities, [[1.0]])
    assert_allclose(Dense().solve(decay(), [1], [0.0]).probabilities, [[1.0, 0.0]])


def test_too_many_states():
    with pytest.raises(ValueError, match="over 2000 states are reachable"):
        Dense().solve(switch(), [2001, 0], [1.0])
