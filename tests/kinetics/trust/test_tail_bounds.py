"""P-values of `verify` against exact enumeration: never too small, and not too large to be of use."""

from itertools import product
from math import exp, factorial

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy import stats
from scipy.linalg import expm
from verified_networks import FEW

from kinetics import Transient
from kinetics.trust.verification import Reference
from kinetics.trust.verification.conditional import chain_of, expected_after, transition_matrix
from kinetics.trust.verification.tail_bounds import (
    at_least,
    bennett,
    binomial,
    chance,
    disjoint_pairs,
    log_evidence,
    rare_events,
    uniform_gap,
)


@pytest.mark.parametrize(("n", "p"), [(20, 0.3), (1000, 0.004), (7, 0.0), (7, 1.0)])
def test_binomial(n, p):
    k = np.arange(n + 1)
    law = stats.binom(n, p)
    exact = np.minimum(2 * np.minimum(law.cdf(k), law.sf(k - 1)), 1.0)
    assert_allclose(binomial(k, n, np.full(n + 1, p), 0.0), exact, rtol=1e-9, atol=1e-300)
    assert (binomial(k, n, np.full(n + 1, p), 1e-3) >= exact * (1 - 1e-9)).all()
    assert_allclose([at_least(i, n, p) for i in k], law.sf(k - 1), rtol=1e-9, atol=1e-300)


@pytest.mark.parametrize(("n", "p"), [(50, 0.3), (1000, 0.004), (400, 0.5)])
def test_bennett_is_a_bound_that_is_near(n, p):
    law, k = stats.binom(n, p), np.arange(n + 1)
    tails = np.array([law.pmf(k)[np.abs(k - n * p) >= abs(i - n * p) - 1e-9].sum() for i in k])
    bounds = np.array([bennett(i / n - p, p * (1 - p), 1.0, n) for i in k])
    assert (bounds >= tails).all()
    far = (tails < 1e-8) & (tails > 1e-12)
    assert (bounds[far] < tails[far] ** 0.5).all()
    # Bernstein's, solved for the deviation, allows for at least as much.
    away = chance(p * (1 - p), 1.0, n, 1e-6)
    assert bennett(away, p * (1 - p), 1.0, n) <= 1e-6


def test_bennett_where_nothing_varies():
    assert bennett(0.0, 0.0, 1.0, 100) == 1.0
    assert bennett(0.1, 0.0, 1.0, 100) == 0.0
    assert bennett(0.1, 0.0, 1.0, 100, error=0.2) == 1.0
    assert bennett(0.1, 0.0, 0.0, 100) == 0.0


def test_rare_events():
    exact = stats.poisson(1e-3).sf(np.arange(5) - 1)
    bounds = np.array([rare_events(m, 1e-3) for m in range(5)])
    assert (bounds >= exact).all()
    assert (bounds <= 1.01 * exact).all()
    assert rare_events(1, 0.0) == 0.0


def test_disjoint_pairs():
    """Four members with three values: all 81 outcomes."""
    pairs = [int((np.bincount(labels) // 2).sum()) for labels in product(range(3), repeat=4)]
    exact = [np.mean(np.array(pairs) >= m) for m in range(3)]
    assert_allclose(exact[1], 1.0)
    assert all(disjoint_pairs(m, 4, 1 / 3) >= exact[m] for m in range(3))
    assert_allclose(disjoint_pairs(2, 4, 0.01), factorial(4) / (2**2 * 2) * 0.01**2)
    assert disjoint_pairs(1, 4, 0.0) == 0.0


def test_an_e_value_is_expected_to_be_at_most_one():
    """All outcomes of six trials in three cells."""
    p = np.array([0.5, 0.3, 0.2])
    outcomes = [np.array(o) for o in product(range(7), repeat=3) if sum(o) == 6]
    chances = np.array([stats.multinomial(6, p).pmf(o) for o in outcomes])
    values = np.array([exp(log_evidence(o.astype(float), p, 0.0)) for o in outcomes])
    assert_allclose(chances.sum(), 1.0)
    assert_allclose(chances @ values, 1.0, rtol=1e-6)
    wrong = np.array([0.2, 0.3, 0.5])  # the control: against another distribution it grows
    others = np.array([stats.multinomial(6, wrong).pmf(o) for o in outcomes])
    assert others @ values > 1.5


def test_the_gap_to_the_uniform_distribution():
    gaps = np.linspace(0.05, 0.4, 8)
    exact = stats.kstwo(64).sf(gaps)
    assert all(uniform_gap(gap, 64) >= p for gap, p in zip(gaps, exact, strict=True))
    assert uniform_gap(0.4, 64) < 3 * exact[-1]


@pytest.mark.parametrize(("net", "initial", "times"), [case[1:] for case in FEW], ids=[case[0] for case in FEW])
def test_transition_probabilities(net, initial, times):
    solution = Transient().solve(net, initial, times)
    chain, gap = chain_of(solution.space), times[1] - times[0]
    matrix = transition_matrix(chain, gap)
    exact = expm(solution.space.generator().toarray() * gap)
    assert np.abs(matrix.values - exact).sum(axis=1).max() < matrix.error + 1e-11
    assert matrix.error < 1e-9
    # Backwards and forwards give the same means.
    counts = solution.space.states / solution.space.states.max()
    found = expected_after(chain, counts, gap)
    assert_allclose(solution.probabilities[0] @ found.values, solution.probabilities[1] @ counts, atol=1e-11)
    assert_allclose(found.values, matrix.values @ counts, atol=found.error + matrix.error)
    later = expected_after(chain, counts, 1.01 * gap)  # the control
    assert np.abs(later.values - found.values).max() > 1e-6


def test_how_often_independent_runs_are_equal():
    """Against the sum over all paths of two times, and its own bound at fine times."""
    _, net, initial, times = FEW[3]
    reference = Reference.of(net, initial, times)
    (matrix,) = reference.matrices
    joint = reference.solution.probabilities[0][:, None] * matrix.values
    assert_allclose(reference.repeat_at_times, (joint**2).sum(), rtol=1e-6)
    assert reference.repeat_at_fine_times < 1e-6 * reference.repeat_at_times
