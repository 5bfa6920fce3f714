from fractions import Fraction
from importlib import import_module
from math import factorial

import numpy as np
import pytest
from known_systems import decay, line, network, switch, walk
from matplotlib.figure import Figure
from numpy.testing import assert_allclose
from scipy.stats import binom

from kinetics import Chain, Transient
from kinetics.markov import stationary
from kinetics.markov.passage import elimination
from kinetics.markov.passage.elimination import Elimination


def exact_stationary(rates):
    """Cofactors of the generator in rational arithmetic: slow and obvious."""
    n = len(rates)
    Q = [[Fraction(float(x)) for x in row] for row in rates]
    for i in range(n):
        Q[i][i] = -sum(Q[i])
    # x Q = 0 with x_0 = 1: Gauss on the transposed, leaving out the first equation.
    table = [[Q[i][j] for i in range(1, n)] + [-Q[0][j]] for j in range(1, n)]
    for k in range(n - 1):
        pivot = next(r for r in range(k, n - 1) if table[r][k])
        table[k], table[pivot] = table[pivot], table[k]
        for r in range(n - 1):
            if r != k and table[r][k]:
                factor = table[r][k] / table[k][k]
                table[r] = [a - factor * b for a, b in zip(table[r], table[k], strict=True)]
    x = [Fraction(1)] + [table[k][-1] / table[k][k] for k in range(n - 1)]
    return np.array([float(value / sum(x)) for value in x])


def of_rates(rates):
    rows, columns = np.nonzero(rates)
    return Elimination(rows, columns, rates[rows, columns], np.zeros(len(rates)))


@pytest.mark.parametrize("seed", range(8))
def test_random_chains_over_many_decades(seed):
    rng = np.random.default_rng(seed)
    rates = 10.0 ** rng.uniform(-20, 20, (6, 6)) * (rng.random((6, 6)) < 0.7)
    rates += np.diag(10.0 ** rng.uniform(-20, 20, 5), 1)
    rates[-1, 0] = 1e-7
    np.fill_diagonal(rates, 0.0)
    chain = of_rates(rates)
    assert_allclose(chain.stationary(), exact_stationary(rates), rtol=min(chain.error, 1e-14))
    assert chain.error < 1e-13


@pytest.mark.parametrize("copies", [6, 25])
def test_the_bound_holds_on_a_network_of_many_states(copies):
    # Independent copies on a cycle A -> B -> C -> A: multinomial, in rational numbers.
    reactions = {"ab": ((1, 0, 0), (0, 1, 0)), "bc": ((0, 1, 0), (0, 0, 1)), "ca": ((0, 0, 1), (1, 0, 0))}
    law = stationary(network("ABC", reactions, [1.0, 1e-3, 1e3]), [copies, 0, 0])
    weights = [Fraction(1) / Fraction(rate) for rate in (1.0, 1e-3, 1e3)]
    shares = [weight / sum(weights) for weight in weights]
    worst = 0.0
    for (a, b, c), found in zip(law.space.states.tolist(), law.probabilities, strict=True):
        ways = factorial(copies) // (factorial(a) * factorial(b) * factorial(c))
        exact = ways * shares[0] ** a * shares[1] ** b * shares[2] ** c
        worst = max(worst, abs(float(Fraction(found) / exact - 1)))
    assert 0 < worst <= law.error < (1e-10 if copies > 6 else 1e-12)


@pytest.mark.parametrize("coupling", [1e-3, 1e-16, 1e-100, 1e-300])
def test_nearly_decomposable(coupling):
    # Two pairs that mix fast, hardly joined; least squares and eigenvectors know nothing of how the pairs share.
    c = coupling
    rates = np.array([[0, 1, c, 0], [2, 0, 0, c], [3 * c, 0, 0, 5], [0, c, 7, 0.0]])
    exact = exact_stationary(rates)
    assert_allclose(of_rates(rates).stationary(), exact, rtol=1e-15)
    if c <= 1e-16:
        Q = rates - np.diag(rates.sum(axis=1))
        solved = np.linalg.lstsq(np.vstack([Q.T, np.ones(4)]), np.array([0, 0, 0, 0, 1.0]), rcond=None)[0]
        assert abs(solved / exact - 1).max() > 0.01  # the control: the textbook's way is wrong here


@pytest.mark.parametrize("cubes", [8, 40])
def test_line_of_four(cubes):
    law = stationary(line(), [cubes, 0, 0, 0])
    Q = law.space.generator()
    assert abs(law.probabilities @ Q).max() < 1e-16
    assert_allclose(law.probabilities.sum(), 1.0, rtol=1e-14)
    assert_allclose(law.mean() @ [1, 2, 3, 4], cubes, rtol=1e-13)
    assert len(law.classes) == 1
    if cubes == 8:
        late = Transient().solve(line(), [8, 0, 0, 0], [1e7])
        assert_allclose(law.probabilities, late.probabilities[0], rtol=0, atol=late.error)
        assert_allclose(law.sd(), late.sd()[0], rtol=1e-9)


def test_independent_copies_are_binomial():
    law = stationary(switch(1.0, 2.0), [300, 0])
    assert_allclose(law.marginal("B"), binom(300, 1 / 3).pmf(np.arange(301)), rtol=1e-11)
    assert law.probability([300, 0]) == pytest.approx((2 / 3) ** 300, rel=1e-12, abs=0.0)
    assert law.probability([7, 7]) == 0.0


def test_a_long_chain_with_weights_beyond_double():
    # Against the drift, the weights span 2**1100; the law is geometric, from either end.
    for up, down in ((1.0, 2.0), (2.0, 1.0)):
        law = stationary(walk(1100, up, down), np.eye(1, 1101, dtype=int)[0])
        place = law.space.states.argmax(axis=1)
        distance = place if up < down else 1100 - place
        near = distance < 1000
        assert_allclose(law.probabilities[near], 0.5 ** (distance[near] + 1.0), rtol=1e-12)


def test_two_closed_classes():
    # From A to the pair B <-> C with 1/4, to the trap D with 3/4.
    reactions = {
        "pair": ((1, 0, 0, 0), (0, 1, 0, 0)),
        "trap": ((1, 0, 0, 0), (0, 0, 0, 1)),
        "bc": ((0, 1, 0, 0), (0, 0, 1, 0)),
        "cb": ((0, 0, 1, 0), (0, 1, 0, 0)),
    }
    law = stationary(network("ABCD", reactions, [1.0, 3.0, 2.0, 8.0]), [1, 0, 0, 0])
    assert sorted(law.weights) == pytest.approx([0.25, 0.75], rel=1e-15)
    assert_allclose(law.mean(), [0, 0.25 * 0.8, 0.25 * 0.2, 0.75], rtol=1e-15)
    assert sorted(rows.size for rows in law.classes) == [1, 2]


def test_an_end():
    law = stationary(decay(), [5])
    assert law.probability([0]) == 1.0
    assert law.sd()[0] == 0.0
    assert_allclose(stationary(decay(), [0]).probabilities, [1.0])


def test_out_of_reach(monkeypatch):
    birth = network("X", {"birth": ((0,), (1,)), "death": ((1,), (0,))}, [1.0, 1.0])
    with pytest.raises(ValueError, match="over 1000 states are reachable"):
        stationary(birth, [0], max_states=1000)
    monkeypatch.setattr(elimination, "MAX_WORK", 10)
    with pytest.raises(ValueError, match="the stationary distribution is out of reach: 1101 states, up to"):
        stationary(walk(1100, 1.0, 2.0), np.eye(1, 1101, dtype=int)[0])


def test_chains_too_large_to_eliminate(monkeypatch):
    eliminated = stationary(line(), [40, 0, 0, 0])
    monkeypatch.setattr(elimination, "MAX_WORK", 10)
    monkeypatch.setattr(import_module("kinetics.markov.passage.stationary"), "is_easy", lambda *_: True)
    factored = stationary(line(), [40, 0, 0, 0])
    assert eliminated.probabilities.min() < 1e-50
    wide = eliminated.error + factored.error
    assert_allclose(factored.probabilities, eliminated.probabilities, rtol=wide)
    assert factored.is_bound
    assert wide < 1e-10


def test_failed_factors_prove_nothing(monkeypatch):
    # sparse LU gives negative times here: they once came with the error 3e-16
    rates = np.zeros((7, 7))
    rates[0, [1, 5]] = 2.7e-40, 6e-48
    rates[1, [2, 6]] = 6e13, 5e-53
    rates[2, [3, 4]] = 4e58, 11.0
    rates[3, [0, 4, 6]] = 2e24, 4e-35, 6e-45
    rates[4, [2, 5]] = 4e-48, 9e7
    rates[5, [1, 4, 6]] = 8e-43, 9e6, 2e-51
    rates[6, 5] = 3e-8
    monkeypatch.setattr(import_module("kinetics.markov.passage.stationary"), "is_easy", lambda *_: False)
    found = Chain(rates, 0).stationary()
    right = exact_stationary(rates)
    assert np.all(np.abs(found.probabilities - right) <= (found.error + 1e-15) * right)


def test_factors_that_would_fill_up_are_foretold(monkeypatch):
    """400 states with jumps to anywhere, where iteration proves nothing: no factors beyond the work allowed."""
    rng = np.random.default_rng(3)
    rates = np.where(rng.random((400, 400)) < 0.01, 1.0, 0.0) + np.diag(np.ones(399), 1) + np.diag(np.ones(399), -1)
    room, tried = import_module("kinetics.markov.passage.stationary"), []
    by_factors = room._by_factors
    monkeypatch.setattr(elimination, "MAX_WORK", 0)
    monkeypatch.setattr(room, "_by_factors", lambda chain: tried.append(chain.size) or by_factors(chain))
    for found, error in ((np.ones(400), np.inf), (np.full(400, 1 / 400), 1e-6)):
        monkeypatch.setattr(room, "_by_iteration", lambda _, answer=(found, error): answer)
        assert Chain(rates, 0).stationary().error < 1e-9
        assert tried.pop() == 400
        with monkeypatch.context() as less:
            less.setattr(room, "MAX_FACTORED", 1e6)
            if error == np.inf:
                with pytest.raises(ValueError, match="out of reach"):
                    Chain(rates, 0).stationary()
            else:
                assert Chain(rates, 0).stationary().error >= error
        assert not tried


def test_plot():
    ax = Figure().add_subplot()
    assert stationary(switch(), [20, 0]).plot(ax, "B") is ax
    whole = stationary(switch(), [20, 0]).plot()  # of every species, in its colour
    assert [text.get_text() for text in whole.get_legend().get_texts()] == list(switch().species)
    assert ax.get_xlabel() == "copies of B"
