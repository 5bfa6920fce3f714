"""The kernels in C for chains give the bits of those by Numba: steps, factors, iteration, sets without a matrix."""

from functools import partial
from unittest.mock import patch

import numpy as np
import pytest
from numpy.testing import assert_array_equal
from scipy import sparse

from kinetics.kernels import balance, elimination, incomplete, markov, residuals
from kinetics.markov.transient import MatrixFree
from kinetics.native import library, linear, packed, twins
from kinetics.native.rate_tables import RateTable
from tests.kinetics.native.test_twins import CASES, assert_same

pytestmark = pytest.mark.skipif(not library.is_built(), reason="the C kernels were not built: there was no compiler")


def chain(rng, n=200):
    """A random chain as the kernels read it."""
    shares = rng.random((n, n)) * (rng.random((n, n)) < 0.05)
    np.fill_diagonal(shares, 0.0)
    shares /= shares.sum(axis=0, keepdims=True).max() * 1.5
    sources, targets = np.nonzero(shares)
    order = np.lexsort((sources, targets))
    begins = np.searchsorted(targets[order], np.arange(n + 1)).astype(np.uint32)
    return begins, sources[order].astype(np.uint32), shares[sources, targets][order], shares.sum(axis=1)


def test_steps_of_a_chain_are_the_same():
    rng = np.random.default_rng(2)
    arrays = chain(rng)
    vectors = np.zeros((30, 200))
    vectors[0] = rng.dirichlet(np.ones(200))
    *_, vectors, _ = assert_same(twins.advance, markov.advance, (*arrays, vectors, np.empty(29)))
    weights = rng.random((3, 29)) * (rng.random((3, 29)) < 0.5)
    assert_same(twins.mix, markov.mix, (np.array([2, 0, 1]), weights, vectors[:29], np.zeros((3, 200))))
    for steps in (4, 5):
        empty = np.empty(steps), np.empty(steps), np.empty(steps)
        assert_same(twins.absorb, markov.absorb, (*arrays, vectors[0].copy(), *empty))
        begin, now = (np.array([3, 0]), np.array([0.25, 0.75])), (vectors[1].copy(), np.empty(200))
        in_c, by_numba = partial(twins.retreat, twins.backward_moves(*arrays)), partial(markov.retreat, *arrays)
        assert_same(in_c, by_numba, (*begin, *now, np.empty(steps)))
    in_c, by_numba = partial(twins.powers, twins.backward_moves(*arrays)), partial(markov.powers, *arrays)
    (vectors,) = assert_same(in_c, by_numba, (vectors,))
    in_c, by_numba = partial(twins.steps_back, twins.backward_moves(*arrays)), partial(markov.steps_back, *arrays)
    sums = np.zeros(arrays[1].size), rng.random(200), np.zeros(200)
    for steps in (4, 5):
        given = vectors[:steps].copy(), rng.random(steps), rng.random(steps), rng.random(200), rng.random(200)
        assert_same(in_c, by_numba, (*given, *sums))


@pytest.mark.parametrize("scale", [1.0, 1e30])
def test_stationary_weights_are_the_same(scale):
    rng = np.random.default_rng(6)
    n, b = 150, 6
    band = rng.random((n, 2 * b + 1)) * scale  # where weights grow beyond double they are scaled
    assert_same(linear.balance, elimination.balance, (band, np.empty(n)))


def test_a_first_guess_of_the_stationary_distribution_is_the_same():
    rng = np.random.default_rng(7)
    rates = rng.random((200, 200)) * (rng.random((200, 200)) < 0.05) * 10.0 ** rng.integers(-9, 9, (200, 200))
    rates += np.diag(rng.random(199), 1)
    table = sparse.csr_array(rates)
    arrays = table.indptr, table.indices, table.data, rates.sum(axis=1)
    found, guessed = np.empty(200), np.empty(200)
    linear.balanced(table, arrays[-1], found)
    balance.balanced(*arrays, guessed)
    assert_array_equal(found, guessed)


@pytest.mark.parametrize("kind", ["random", "band", "ends in a sink", "one state", "no entries"])
def test_steps_that_are_added_up_are_the_same(kind):
    """By rows of any form, in any order of steps: bit for bit what plain steps give."""
    rng = np.random.default_rng(4)
    n = {"one state": 1, "no entries": 40}.get(kind, 1100)
    matrix = np.zeros((n, n))
    if kind == "random":
        matrix = rng.random((n, n)) * (rng.random((n, n)) < 0.01)
    elif n > 1000:
        for offset in (-31, -1, 30):
            matrix += np.diag(rng.random(n - abs(offset)), offset) * (rng.random(n) < 0.99)
        if kind == "ends in a sink":
            matrix[:, -1] = rng.random(n) * (rng.random(n) < 0.2)
    for table in (sparse.csr_array(matrix), sparse.csr_array(matrix.T)):
        diagonal, vector = rng.random(n), rng.random(n)
        for weights in (rng.random((1, 1)), rng.random((1, 7)), rng.random((3, 41)) * (rng.random((3, 41)) < 0.5)):
            sums, now = np.zeros((len(weights), n)), vector.copy()
            places = table.indptr.astype(np.uint32), table.indices.astype(np.uint32)
            markov.summed_steps(*places, table.data, diagonal, weights, now, sums)
            found = twins.summed_steps(table, diagonal, weights, vector)
            np.testing.assert_array_equal(found, sums)


@pytest.mark.parametrize("is_occupation", [False, True])
def test_elimination_and_its_residuals_are_the_same(is_occupation):
    rng = np.random.default_rng(3)
    n, b = 150, 6
    band = rng.random((n, 2 * b + 1)) * (rng.random((n, 2 * b + 1)) < 0.6)
    places = np.arange(n)[:, None] + np.arange(-b, b + 1)
    band[(places < 0) | (places >= n) | (places == np.arange(n)[:, None])] = 0.0
    leaving = rng.random(n)
    rows, columns = np.nonzero(band)
    rates, columns = band[rows, columns], places[rows, columns]

    def reduced(*arguments):
        return elimination.reduce(*arguments, 0, n)

    band, _, exits = assert_same(linear.reduce, reduced, (band, leaving, np.empty(n)))
    in_c, by_numba = (linear.occupy, elimination.occupy) if is_occupation else (linear.solve, elimination.solve)
    _, _, high = assert_same(in_c, by_numba, (band, exits, rng.random(n)))
    low, left = 1e-17 * rng.random(n), np.stack([rng.random(n), np.zeros(n)], axis=1)
    by_numba = residuals.occupied if is_occupation else residuals.accumulated
    assert_same(
        lambda *arrays: linear.take_off(is_occupation, *arrays),
        by_numba,
        (rows, columns, rates, leaving, high, low, left, np.zeros(n)),
    )
    assert_same(linear.corrected, residuals.corrected, (high, low, 1e-16 * rng.random(n)))
    exits[n // 2] = 0.0
    for each in (in_c, elimination.occupy if is_occupation else elimination.solve):
        with pytest.raises(ZeroDivisionError):
            each(band, exits, np.ones(n))


def iterated(in_c, is_occupation, table, leaving, left, units, goal):
    with patch.object(linear, "is_built", return_value=in_c):
        factors, change = linear.Factors.of(table, leaving), np.zeros_like(left)
        assert (factors.record is not None) == in_c
        swept, residual = left.copy(), left.copy()
        factors.sweep(swept, is_occupation)
        rounds = factors.correct(is_occupation, units, residual, change, goal, 40)
        return *factors[:7], swept, factors.product(left, is_occupation), residual, change, np.array(rounds)


@pytest.mark.parametrize("is_occupation", [False, True])
@pytest.mark.parametrize("spoiled", ["not", "empty", "nothing left", "not a number", "no way out"])
def test_iteration_is_the_same(spoiled, is_occupation):
    """Factors, sweeps, products and corrections; also where the method breaks down."""
    rng = np.random.default_rng(11)
    n = 1 if spoiled == "empty" else 200
    rows, columns = rng.integers(0, n, size=(2, 6 * n))
    rates, leaving = 10.0 ** rng.uniform(-3, 3, rows.size), rng.random(n) * (rng.random(n) < 0.1)
    leaving = np.zeros(n) if spoiled == "no way out" else leaving + 1e-2
    left, units = rng.random(n) - 0.5, 10.0 ** rng.uniform(-3, 3, n)
    if spoiled == "nothing left":
        left[:] = 0.0
    elif spoiled == "not a number":
        left[7] = np.nan
    off = rows != columns
    table = RateTable.of(rows[off], columns[off], rates[off], n)
    with np.errstate(all="ignore"):
        found, same = (iterated(in_c, is_occupation, table, leaving, left, units, 1e-9) for in_c in (True, False))
        for one, other in zip(found, same, strict=True):
            assert_array_equal(one, other)
    if spoiled == "not":
        assert 1 < found[-1] < 40  # it did some rounds, and came to its goal
        wrong = np.empty(n)
        kernel = incomplete.occupied if is_occupation else incomplete.accumulated
        kernel(found[0], found[2], found[5], found[6], found[-2], wrong)
        assert np.abs((left - wrong) / units).max() < 1e-6


@pytest.mark.parametrize("name", ["line", "enzyme", "mixed", "third order", "ordered pairs", "nothing left"])
def test_steps_without_a_matrix_are_the_same(name, monkeypatch):
    net, start, end = CASES[name]
    solve = partial(MatrixFree(1e-6).solve, net, np.minimum(start, 12), [end / 20.0])
    native = solve()
    with monkeypatch.context() as patched:
        patched.setattr(packed, "is_built", lambda: False)
        compiled = solve()
    assert_array_equal(native.space.states, compiled.space.states)
    assert_array_equal(native.probabilities, compiled.probabilities)
    assert native.error == compiled.error
    # The control: a coefficient that is one bit larger is seen.
    other = MatrixFree(1e-6).solve(
        net.with_rates(np.nextafter(net.known_rates, np.inf)), np.minimum(start, 12), [end / 20.0]
    )
    assert (
        other.probabilities.shape != native.probabilities.shape or (other.probabilities != native.probabilities).any()
    )
