"""Limits proven from what a solution leaves of the equations: they hold, and are below 1e-9 on 5,000 states."""

from importlib import import_module

import mpmath
import numpy as np
import pytest
from known_systems import line
from random_chains import DIGITS, random_rates
from scipy.sparse import csr_array, diags_array

from kinetics import Chain
from kinetics.markov.passage import elimination
from kinetics.markov.passage.certified import BoundedSolution
from kinetics.markov.passage.elimination import Elimination, SparseFactors

KINDS = (Elimination, SparseFactors)


def equations(kind, rates, leaving):
    rows, columns = np.nonzero(rates)
    return kind(rows, columns, rates[rows, columns], leaving)


def exact_solution(rates, leaving, weights, is_occupation):
    with mpmath.workdps(DIGITS):
        n = len(leaving)
        matrix = mpmath.matrix(n)
        for i in range(n):
            for j in range(n):
                matrix[i, j] = -mpmath.mpf(float(rates[i, j]))
            matrix[i, i] = mpmath.fsum(mpmath.mpf(float(rate)) for rate in rates[i]) + mpmath.mpf(float(leaving[i]))
        given = mpmath.matrix([mpmath.mpf(float(weight)) for weight in weights])
        return list(mpmath.lu_solve(matrix.T if is_occupation else matrix, given))


def away(values, exact):
    with mpmath.workdps(DIGITS):
        return np.array([float(abs(mpmath.mpf(float(x)) - y)) for x, y in zip(values, exact, strict=True)])


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize("is_occupation", [False, True])
def test_limits_hold_on_random_chains(kind, seed, is_occupation):
    """With no allowance for the rounding of the rates, which hides much: they are taken as they are."""
    rng = np.random.default_rng(seed)
    n = 7
    rates = random_rates(seed, n, decades=4.0)
    leaving, weights = np.zeros(n), np.zeros(n)
    leaving[n - 1], weights[0], weights[2] = 10.0 ** -rng.uniform(0, 6), rng.random(), rng.random()
    chain = equations(kind, rates, leaving)
    chain.rates_error = 0.0
    found = chain.occupied(weights) if is_occupation else chain.solved(weights)
    exact = exact_solution(rates, leaving, weights, is_occupation)
    wrong = away(found.values, exact)
    assert (wrong <= found.errors).all()
    assert found.relative < 3e-16
    assert (away(found.values * (1.0 + 4.0 * found.relative), exact) > found.errors).any()  # the control


@pytest.mark.parametrize("coupling", [1e-6, 1e-10])
def test_factors_are_refined_where_they_are_wrong(coupling):
    """Two groups that mix fast and leave rarely: what plain factors give is outside the limits."""
    rates = np.array([[0, 1, coupling, 0], [2, 0, 0, coupling], [3 * coupling, 0, 0, 5], [0, coupling, 7, 0.0]])
    leaving = np.array([0, 0, 0, coupling * 1e-3])
    chain = equations(SparseFactors, rates, leaving)
    found, exact = chain.solved(np.ones(4)), exact_solution(rates, leaving, np.ones(4), False)
    assert (away(found.values, exact) <= found.errors).all()
    assert found.relative < 1e-12
    assert (away(chain.solve(np.ones(4)), exact) > found.errors).any()  # the control


def test_a_solution_that_leaves_much_is_not_called_good(monkeypatch):
    """Factors of another chain: limits stay true, or there are none."""
    rates = random_rates(3, 6)
    leaving = np.eye(1, 6)[0]
    chain, other = (equations(SparseFactors, scale * rates, leaving) for scale in (1.0, 1.5))
    monkeypatch.setattr(chain, "_factors", other._factors)
    found, exact = chain.solved(np.ones(6)), exact_solution(rates, leaving, np.ones(6), False)
    assert (away(found.values, exact) <= found.errors).all()
    assert (away(other.solve(np.ones(6)), exact) > 1e-3).any()  # the control


def test_nothing_is_known_without_pivots():
    chain = SparseFactors(np.array([0, 1]), np.array([1, 0]), np.ones(2), np.zeros(2))
    assert chain.solved(np.ones(2)).relative == np.inf


def long_walk(n=5000):
    """Rates up and down (n - 1,) that span six decades."""
    rng = np.random.default_rng(3)
    up, down = 10.0 ** rng.uniform(-3, 3, (2, n - 1))
    return up, down


def test_a_long_walk():
    """Stationary law and mean time are sums of positive products; extended precision has 11 bits to spare."""
    up, down = long_walk()
    n = up.size + 1
    chain = Chain(csr_array(diags_array([up, down], offsets=[1, -1])), 0)
    law = chain.stationary()
    a, b = np.longdouble(1.0) * up, np.longdouble(1.0) * down
    logs = np.cumsum(np.append(np.longdouble(0.0), np.log(a) - np.log(b)))
    weights = np.exp(logs - logs.max())
    held = law.probabilities > 1e-290
    truth = (weights / weights.sum())[held]
    wrong = float(np.abs(law.probabilities[held] / truth - 1).max())
    assert wrong < 1e-12  # the logarithms of the reference round, too
    assert law.error < 1e-9
    assert law.is_bound
    # from i to i + 1: e_i = (1 + down e_(i - 1)) / up
    time, step = np.longdouble(0.0), np.longdouble(0.0)
    for i in range(n // 2):
        step = (1 + (b[i - 1] * step if i else 0)) / a[i]
        time += step
    passage = chain.passage(np.arange(n) == n // 2)
    assert abs(passage.mean / time - 1) < 1e-14
    assert passage.error < 1e-9
    # the chance of the last place before the first
    middle = Chain(chain.transitions, n // 2)
    split = middle.committor({"low": np.arange(n) == 0, "high": np.arange(n) == n - 1})

    def climbed(ratios):
        sums = np.cumsum(np.exp(np.cumsum(np.append(np.longdouble(0.0), np.log(ratios)))))
        return sums / sums[-1]

    chances, truth = split.committors[1][1:], climbed(b[:-1] / a[1:])
    held = chances > 1e-290
    assert np.abs(chances[held] / truth[held] - 1).max() < 1e-12
    assert np.abs(chances[held] / climbed(b[1:] / a[1:])[held] - 1).max() > 1e-3  # the control: one rate further
    assert split.error < 1e-9


@pytest.mark.parametrize("kind", ["line", "random"])
def test_three_ways_agree_on_5000_states(kind, monkeypatch):
    """They share no step but the limits; each is below 1e-9; direct ways agree to 5e-13, iteration to 1e-11.

    How closely depends on the processor, by whose BLAS they factorise: 4e-14 on one, 1.2e-13 on another.
    """
    if kind == "line":
        chain = Chain.of(line(), [88, 0, 0, 0])
        goals = {"many": "quadmer >= 15", "one": "quadmer >= 1 and trimer == 0 and dimer == 0 and quadmer < 15"}
    else:
        n, rng = 5000, np.random.default_rng(5)
        rows = np.repeat(np.arange(n), 4)
        columns = np.append((np.arange(n) + 1) % n, (rows + rng.integers(-12, 13, rows.size)) % n)
        rows = np.append(np.arange(n), rows)
        off = rows != columns
        rates = 10.0 ** rng.uniform(-4, 4, rows.size)
        chain = Chain(csr_array((rates[off], (rows[off], columns[off])), shape=(n, n)), 0)
        goals = {"many": np.arange(n) % 500 == 400, "one": np.arange(n) == 40}
    answers = []
    for is_easy, work in ((False, elimination.MAX_WORK), (True, elimination.MAX_WORK), (True, 0)):
        monkeypatch.setattr(elimination, "MAX_WORK", work)
        for module in ("equations", "stationary"):
            monkeypatch.setattr(
                import_module(f"kinetics.markov.passage.{module}"), "is_easy", lambda *_, easy=is_easy: easy
            )
        law, passage = chain.stationary(), chain.passage(goals["many"])
        split = chain.committor(goals)
        assert max(law.error, passage.error, passage.sd_error, split.error) < 1e-9
        assert law.is_bound
        assert passage.is_bound
        assert split.is_bound
        answers.append(np.concatenate([law.probabilities, [passage.mean, passage.sd], *split.committors]))
    held = answers[1] > 1e-280
    assert len(chain) >= 5000
    assert np.abs(answers[2][held] / answers[1][held] - 1).max() < 5e-13
    assert np.abs(answers[0][held] / answers[1][held] - 1).max() < 1e-11
    assert (answers[0] != answers[1]).any()  # the control: it is another way


def test_of_negative_values_nothing_is_known():
    assert BoundedSolution(np.array([-1.0, 1.0]), np.array([np.inf, 1e-16])).relative == np.inf
    assert BoundedSolution(np.array([1.0, 1.0]), np.array([1e-14, 1e-16])).relative == 1e-14
