"""The defect is that of exact fractions, and its bound holds and says something."""

from fractions import Fraction

import numpy as np
import pytest
from numpy.polynomial.legendre import legvander
from numpy.testing import assert_allclose

from kinetics.markov.transient.certificate import Entries
from kinetics.markov.transient.defect import FixedPointChain, legendre, value_at

DEGREE = 4


def random_chain(rng, n=4):
    rates = 10.0 ** rng.uniform(-9, 3, (n, n)) * (rng.random((n, n)) < 0.7)
    np.fill_diagonal(rates, 0.0)
    rates[0, 1] = 7.3
    return rates


def entries(rates):
    rows, columns = np.nonzero(rates)
    return Entries(rows, columns, rates[rows, columns])


def exact_defect(coefficients, rates, length):
    """u' - u Q h / 2 by Legendre coefficients, in fractions."""
    n, size = coefficients.shape
    u = [[Fraction(float(x)) for x in row] for row in coefficients]
    found = []
    for j in range(n):
        row = [(2 * k + 1) * sum(u[j][i] for i in range(k + 1, size, 2)) for k in range(size)]
        leaving = sum(Fraction(float(x)) for x in rates[j])
        for k in range(size):
            inflow = sum(u[i][k] * Fraction(float(rates[i, j])) for i in range(n))
            row[k] -= (inflow - u[j][k] * leaving) * Fraction(length) / 2
        found.append(row)
    return found


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("length", [2.0**-9, 1.0, 2.0**40])
def test_the_defect_is_that_of_fractions(seed, length):
    rng = np.random.default_rng(seed)
    rates, coefficients = random_chain(rng), rng.uniform(-0.4, 0.4, (4, DEGREE + 1))
    chain = FixedPointChain.of(entries(rates), 4, max(length, 1.0), 1e-15)
    start = rng.uniform(0, 1, 4)
    planes = chain.digits(coefficients)
    found = chain.defect(planes, chain.digits(start), Fraction(length))
    exact = np.array([[float(x) for x in row] for row in exact_defect(coefficients, rates, length)])
    assert_allclose(found.coefficients, exact, rtol=1e-12, atol=1e-15 * max(length, 1.0))
    assert_allclose(found.jump, coefficients @ (-1.0) ** np.arange(DEGREE + 1) - start, rtol=0, atol=1e-15)
    # The integral of |defect| by a fine sum is below the bound, and not far below.
    places = np.linspace(-1, 1, 20_001)
    integral = 2.0 * np.abs(legvander(places, DEGREE) @ exact.T).sum(axis=1).mean()
    assert integral + abs(found.jump).sum() <= found.bound < 4.0 * (integral + abs(found.jump).sum())


def test_a_halved_defect_is_no_bound():
    """One way out of a state, held where it began: the error is nearly the bound, so half of that is too little."""
    rate, length = 1.0, Fraction(1, 16)
    chain = FixedPointChain.of(Entries(np.array([0]), np.array([1]), np.array([rate])), 2, 1.0, 1e-12)
    start = chain.digits(np.array([1.0, 0.0]))
    found = chain.defect(chain.constant(start, DEGREE), start, length)
    error = -2.0 * np.expm1(-rate * float(length))
    assert error <= found.bound
    assert error > found.bound / 2  # the control


def test_what_doubles_cannot_see_is_seen():
    """A state at rest under rates of 1e9, moved by 1e-20: a defect of 1e-11, far below the rounding of 0.5 * 1e9."""
    fast = entries(np.array([[0.0, 1e9], [1e9, 0.0]]))
    chain = FixedPointChain.of(fast, 2, 1.0, 1e-14)
    rest = chain.digits(np.array([0.5, 0.5]))
    assert chain.defect(chain.constant(rest, DEGREE), rest, Fraction(1)).bound < 1e-15
    moved = chain.plus(chain.constant(rest, DEGREE), np.outer([1e-20, -1e-20], np.eye(1, DEGREE + 1)[0]))
    found = chain.defect(moved, chain.end(moved), Fraction(1)).bound
    assert 4e-11 < found < 1e-10
    # The control: in doubles it is the same state.
    assert (chain.values(moved) == 0.5).sum() == 2
    assert abs(chain.values(moved[:, :, 0]) - 0.5).max() == 0.0


def test_what_is_cut_off_is_in_the_bound():
    """With few digits, and so many that are lost, the bound still holds against fractions."""
    rng = np.random.default_rng(5)
    rates = random_chain(rng)
    coarse = FixedPointChain.of(entries(rates), 4, 1.0, 0.5)
    coefficients = coarse.values(coarse.digits(rng.uniform(-0.4, 0.4, (4, DEGREE + 1))))
    planes = coarse.digits(coefficients)
    found = coarse.defect(planes, coarse.end(planes), Fraction(1))
    exact = np.array([[float(x) for x in row] for row in exact_defect(coefficients, rates, 1)])
    places = np.linspace(-1, 1, 20_001)
    assert 2.0 * np.abs(legvander(places, DEGREE) @ exact.T).sum(axis=1).mean() <= found.bound


def test_coefficients_beyond_all_probabilities_have_no_bound():
    chain = FixedPointChain.of(entries(random_chain(np.random.default_rng(1))), 4, 1.0, 1e-12)
    for wrong in (1e17, np.nan):
        planes = chain.digits(np.full((4, DEGREE + 1), 0.1))
        planes[0, 0, 0] = wrong
        assert chain.defect(planes, planes[:, :, 0], Fraction(1)).bound == np.inf


def test_values_between_are_those_of_the_polynomial():
    rng = np.random.default_rng(2)
    chain = FixedPointChain.of(entries(random_chain(rng)), 4, 1.0, 1e-14)
    coefficients = rng.uniform(-0.4, 0.4, (4, 21))
    for place in (Fraction(-1), Fraction(1, 3), Fraction(1)):
        found, rounding = value_at(coefficients, place)
        exact = [
            sum(Fraction(float(x)) * p for x, p in zip(row, legendre(place, 20), strict=True)) for row in coefficients
        ]
        seen = sum(abs(Fraction(float(x)) - y) for x, y in zip(found, exact, strict=True))
        assert float(seen) <= rounding < 1e-13
    assert_allclose(found, chain.values(chain.end(chain.digits(coefficients))), rtol=0, atol=1e-14)
    numbers = [float(p) for p in legendre(Fraction(0.3), 20)]
    assert_allclose(numbers, legvander(np.array([0.3]), 20)[0], rtol=1e-12)
