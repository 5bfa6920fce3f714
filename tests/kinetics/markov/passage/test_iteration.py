"""Iteration: limits hold against rational numbers and closed forms, and spoiled solutions are refused."""

from fractions import Fraction

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from scipy.sparse import csr_array

from kinetics import Chain
from kinetics.markov.passage import equations as choice
from kinetics.markov.passage import iteration
from kinetics.markov.passage.elimination import Elimination, TooLargeError
from kinetics.markov.passage.equations import Iterated, equations
from kinetics.markov.passage.iteration import Iteration

CASES = 1500


def solved_exactly(rates, leaving, weights, is_occupation):
    """Gauss on fractions: slow and obvious."""
    n = len(leaving)
    table = [[-Fraction(rates[i, j]) for j in range(n)] for i in range(n)]
    for i in range(n):
        table[i][i] = sum(map(Fraction, rates[i].tolist()), Fraction(leaving[i]))
    if is_occupation:
        table = [list(column) for column in zip(*table, strict=True)]
    rows = [[*row, Fraction(weight)] for row, weight in zip(table, weights.tolist(), strict=True)]
    for k in range(n):
        for i in range(n):
            if i != k and rows[i][k]:
                factor = rows[i][k] / rows[k][k]
                rows[i] = [a - factor * b for a, b in zip(rows[i], rows[k], strict=True)]
    return [row[-1] / row[k] for k, row in enumerate(rows)]


def small_chain(rng):
    """Up to five states at rates over decades, some without ways, and a way out of each class that is closed."""
    n, decades = int(rng.integers(1, 6)), rng.uniform(0.0, 6.0)
    rates = 10.0 ** rng.uniform(-decades, decades, (n, n)) * (rng.random((n, n)) < rng.uniform(0.2, 1.0))
    np.fill_diagonal(rates, 0.0)
    rates[np.arange(n - 1), np.arange(1, n)] += 1e-3
    leaving = 10.0 ** rng.uniform(-decades, decades, n) * (rng.random(n) < 0.3)
    leaving[-1] += 10.0 ** -rng.uniform(0.0, decades)
    weights = rng.random(n) * (rng.random(n) < 0.5)
    weights[rng.integers(n)] += 1.0
    return rates, leaving, weights


def of(kind, rates, leaving, rate_error=0.0):
    entries = csr_array(rates).tocoo()
    return kind(entries.row, entries.col, entries.data, leaving, rate_error)


def misses(found, exact):
    """How many values lie outside their limits."""
    return sum(
        error < np.inf and abs(Fraction(value) - true) > Fraction(error)
        for value, error, true in zip(found.values.tolist(), found.errors.tolist(), exact, strict=True)
    )


def test_limits_hold_in_rational_numbers():
    """With no allowance for the rounding of the rates; nearly all are proven to twelve digits, and none is missed."""
    rng = np.random.default_rng(11)
    proven, controls = 0, 0
    for case in range(CASES):
        rates, leaving, weights = small_chain(rng)
        chain = of(Iteration, rates, leaving)
        chain.rates_error, chain.goal = 0.0, 1e-14
        found = (chain.occupied if case % 2 else chain.solved)(weights)
        exact = solved_exactly(rates, leaving, weights, bool(case % 2))
        assert misses(found, exact) == 0
        proven += found.relative < 1e-12
        spoiled = found._replace(values=found.values * (1.0 + 1e-9))
        controls += misses(spoiled, exact) > 0
        above = chain.at_most(weights, found.values, bool(case % 2))
        assert all(
            limit == np.inf or Fraction(limit) >= true for limit, true in zip(above.tolist(), exact, strict=True)
        )
    assert proven > 0.95 * CASES
    assert controls > 0.95 * CASES


def entangled(n, seed, ways=5):
    rng = np.random.default_rng(seed)
    rows = np.repeat(np.arange(n), ways)
    columns = (rows + rng.integers(1, n, rows.size)) % n
    return csr_array((10.0 ** rng.uniform(-1.0, 1.0, rows.size), (rows, columns)), shape=(n, n))


@pytest.mark.parametrize("is_occupation", [False, True])
def test_a_spoiled_solution_is_refused(is_occupation, monkeypatch):
    """Whatever the method adds, limits are true: here it is noise, as a solution and as the vector that proves."""
    rates, leaving, weights = entangled(400, 1), np.full(400, 0.01), np.eye(1, 400, 7)[0]
    exact = of(Elimination, rates, leaving)
    truth = (exact.occupied if is_occupation else exact.solved)(weights)
    chain, rng = of(Iteration, rates, leaving), np.random.default_rng(2)
    good = (chain.occupied if is_occupation else chain.solved)(weights)
    assert good.relative < 1e-11
    right = Iteration._changed
    for spoilt in (1e-6, 1e-3, 1.0):
        noise = 1.0 + spoilt * rng.standard_normal(400)
        monkeypatch.setattr(Iteration, "_changed", lambda *given, noise=noise: right(*given) * noise)
        found = (chain.occupied if is_occupation else chain.solved)(weights)
        off = np.abs(found.values - truth.values)
        assert (off <= found.errors + truth.errors).all()
    assert (off > 1e-3 * truth.values).any()  # the control: noise did spoil it
    assert found.relative > 1e-3
    # a solution that is wrong by itself: what it leaves shows it
    monkeypatch.setattr(Iteration, "_changed", lambda self, left, *rest: np.zeros_like(left))
    found = (chain.occupied if is_occupation else chain.solved)(weights)
    assert (np.abs(found.values - truth.values) <= found.errors + truth.errors).all()


@pytest.mark.parametrize("n", [350, 1000])
def test_ruin_against_odds(n):
    """The chance of reaching the top first is (2 - 1) / (2**n - 1) from the lowest place: 1e-301 for n = 1000."""
    inner = np.arange(n - 1)
    rates = csr_array(
        (
            np.append(np.ones(n - 2), 2.0 * np.ones(n - 2)),
            (np.append(inner[:-1], inner[1:]), np.append(inner[1:], inner[:-1])),
        ),
        shape=(n - 1, n - 1),
    )
    leaving, hits = np.zeros(n - 1), np.zeros(n - 1)
    leaving[0], leaving[-1], hits[-1] = 2.0, 1.0, 1.0
    found = of(Iteration, rates, leaving).solved(hits)
    for i in (0, 10, n // 2, n - 2):
        exact = Fraction(2 ** (i + 1) - 1, 2**n - 1)
        known = found.errors[i] < 1e-11 * found.values[i]
        assert misses(found._replace(values=found.values[[i]], errors=found.errors[[i]]), [exact]) == 0
        assert known or exact < 1e-280


def blocks(coupling, n=60, groups=8):
    """Groups that mix fast and are left rarely, from each to the next."""
    rng = np.random.default_rng(5)
    size = n * groups
    rates = np.zeros((size, size))
    for g in range(groups):
        here = slice(g * n, (g + 1) * n)
        rates[here, here] = rng.random((n, n)) * (rng.random((n, n)) < 0.3)
        rates[g * n, ((g + 1) * n) % size] = coupling
        rates[(g + 1) * n - 1, (g * n - 1) % size] = 3.0 * coupling
        rates[here, here][np.arange(n), (np.arange(n) + 1) % n] += 0.5
    np.fill_diagonal(rates, 0.0)
    return rates


@pytest.mark.parametrize("coupling", [1e-2, 1e-6, 1e-12])
def test_nearly_decomposable(coupling):
    """Stiff: either way that is taken, it agrees with elimination within the limits, which are as close."""
    rates, leaving = blocks(coupling), np.zeros(480)
    leaving[100] = 1e-3 * coupling
    chain, other = of(equations, rates, leaving), of(Elimination, rates, leaving)
    assert isinstance(chain, Iterated)
    for weights, is_occupation in ((np.ones(480), False), (np.eye(1, 480, 300)[0], True)):
        found, truth = ((each.occupied if is_occupation else each.solved)(weights) for each in (chain, other))
        assert (np.abs(found.values - truth.values) <= found.errors + truth.errors).all()
        assert found.relative <= 1.2 * truth.relative


@pytest.mark.parametrize("coupling", [1.0, 1e-9])
def test_stationary_of_blocks(coupling):
    rates = blocks(coupling)
    law, truth = Chain(csr_array(rates), 0).stationary(), of(Elimination, rates, np.zeros(480)).stationary()
    assert_allclose(law.probabilities, truth, rtol=law.error)
    assert law.error < 1e-11
    rates[7, 8] = rates[7, 8] * (1.0 + 1e-6) + 1e-6  # the control
    other = of(Elimination, rates, np.zeros(480)).stationary()
    assert (np.abs(other / truth - 1.0) > law.error).any()


def test_stationary_over_many_decades():
    """A reversible chain on entangled states, whose law is known: weights down to 1e-250."""
    rng, n = np.random.default_rng(9), 500
    logs = rng.uniform(-250.0, 0.0, n)
    logs = -np.sort(-logs)
    links = csr_array(
        (
            np.ones(4 * n),
            (np.repeat(np.arange(n), 4), np.clip(np.repeat(np.arange(n), 4) + rng.integers(-20, 21, 4 * n), 0, n - 1)),
        ),
        shape=(n, n),
    )
    links = csr_array(links + links.T).tolil()
    links.setdiag(0.0)
    for i in range(n - 1):
        links[i, i + 1] = links[i + 1, i] = 1.0
    entries = csr_array(links).tocoo()
    uphill = 10.0 ** (0.5 * (logs[entries.col] - logs[entries.row]))
    chain = Chain(csr_array((entries.data * uphill, (entries.row, entries.col)), shape=(n, n)), 0)
    law = chain.stationary()
    exact = 10.0 ** (logs - logs.max())
    assert law.error < 1e-10
    assert_allclose(law.probabilities, exact / exact.sum(), rtol=1e-11)


def test_states_without_a_way_are_zero():
    """Those that never come to what is earned have 0, exactly; the others do not."""
    n = 400
    rates = entangled(n, 3).toarray()
    rates[:200, 200:] = 0.0  # the first half never comes to the second
    found = of(Iteration, rates, np.full(n, 0.1)).solved(np.repeat([0.0, 1.0], 200))
    assert_array_equal(found.values[:200], 0.0)
    assert_array_equal(found.errors[:200], 0.0)
    assert (found.values[200:] > 0.0).all()
    assert found.relative < 1e-11


def test_a_ring_with_chords():
    """Periodic: all ways lead three places on, modulo the chords' six; left at one place only."""
    n = 600
    places = np.arange(n)
    rates = csr_array(
        (np.repeat([1.0, 0.5], n), (np.tile(places, 2), np.append((places + 3) % n, (places - 297) % n))), shape=(n, n)
    )
    leaving = np.zeros(n)
    leaving[::3], leaving[1], leaving[2] = 1e-4, 1e-2, 1e-3
    chain, other = (of(kind, rates, leaving) for kind in (equations, Elimination))
    found, truth = chain.solved(np.ones(n)), other.solved(np.ones(n))
    assert (np.abs(found.values - truth.values) <= found.errors + truth.errors).all()
    assert found.relative < 1e-10


def test_one_state_and_a_target_at_the_start():
    found = of(Iteration, np.zeros((1, 1)), np.array([4.0])).solved(np.array([2.0]))
    assert abs(found.values[0] - 0.5) <= found.errors[0] < 1e-14
    chain = Chain(entangled(400, 2), 7, {"here": np.arange(400) == 7})
    assert chain.until("here").low == 1.0
    assert chain.passage("here").mean == 0.0


def test_without_convergence_a_direct_way_answers(monkeypatch):
    """By counted steps: none are left here. Where no direct way is open either, a rough answer says how rough it is."""
    rates, leaving = entangled(400, 4), np.full(400, 1e-3)
    truth = of(Elimination, rates, leaving).solved(np.ones(400))
    monkeypatch.setattr(iteration, "MOST_STEPS", 0)
    chain = of(equations, rates, leaving)
    found = chain.solved(np.ones(400))
    assert (np.abs(found.values - truth.values) <= found.errors + truth.errors).all()
    assert found.relative <= 1.2 * truth.relative
    assert chain.at_most(np.ones(400), truth.values).max() < 1.1 * truth.values.max()
    with monkeypatch.context() as patch:  # factors that prove nothing: elimination answers
        patch.setattr(choice.SparseFactors, "_by_factors", lambda _, weights, __: 2.0 * truth.values + weights)
        chain = of(equations, rates, leaving)
        assert_array_equal(chain.solved(np.ones(400)).values, truth.values)
        assert chain.at_most(np.ones(400), truth.values).max() < 1.1 * truth.values.max()

    def refused(*_):
        raise TooLargeError("too many", 1.0)

    monkeypatch.setattr(choice, "Elimination", refused)
    other = of(equations, rates, leaving).solved(np.ones(400))  # by sparse factors
    assert (np.abs(other.values - truth.values) <= other.errors + truth.errors).all()
    monkeypatch.setattr(choice, "MAX_FACTORED", 0.0)  # which would fill up
    with pytest.raises(TooLargeError, match="too many"):
        of(equations, rates, leaving).solved(np.ones(400))
    monkeypatch.setattr(iteration, "MOST_STEPS", 200)
    monkeypatch.setattr(iteration, "ROUNDS", 1)
    monkeypatch.setattr(iteration, "DIGITS", 1e-3)
    rough = of(equations, rates, leaving).solved(np.ones(400))
    assert 1e-12 < rough.relative < 1e-3
    assert (np.abs(rough.values - truth.values) <= rough.errors + truth.errors).all()


def test_what_is_small_or_narrow_is_eliminated():
    walk = csr_array((np.ones(999), (np.arange(999), np.arange(1, 1000))), shape=(1000, 1000))
    assert isinstance(of(equations, walk, np.eye(1, 1000, 999)[0]), Elimination)
    assert isinstance(of(equations, entangled(200, 1), np.ones(200)), Elimination)
    assert isinstance(of(equations, entangled(400, 1), np.ones(400)), Iterated)  # the control
