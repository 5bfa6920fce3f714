from fractions import Fraction

import mpmath
import numpy as np
import pytest
from embedded_system import ACTUATOR, PROCESSOR, SENSOR, embedded_system
from known_systems import line, network, switch
from numpy.testing import assert_allclose
from scipy.sparse import csr_array
from scipy.stats import binom

from kinetics import Transient
from kinetics.markov.transient import Collocation, Dense, collocation, reachable
from kinetics.markov.transient.certificate import Entries
from kinetics.markov.transient.collocation import CollocationPlan, integrate
from kinetics.markov.transient.defect import FixedPointChain
from kinetics.markov.transient.radau import RadauStep, radau_tables
from kinetics.markov.transient.transitions import Transitions
from kinetics.markov.transient.uniformisation import DiscreteChain, mixtures
from kinetics.trust.hardcases.stiffness import leak_exact


def generator_of(entries, n):
    diagonal = np.arange(n)
    exits = np.bincount(entries.rows, entries.rates, minlength=n)
    places = np.append(entries.rows, diagonal), np.append(entries.columns, diagonal)
    return csr_array((np.append(entries.rates, -exits), places), shape=(n, n))


def solved(entries, n, times, tolerance=1e-12, max_seconds=1e4):
    """Probabilities (T, N) from the first state, with their bound."""
    times = np.asarray(times, dtype=float)
    plan = CollocationPlan.of(generator_of(entries, n), times[-1], tolerance, max_seconds)
    return integrate(entries, np.eye(1, n)[0], times, plan, tolerance, max_seconds)


def random_chain(rng, n, share=0.6):
    rates = 10.0 ** rng.uniform(-12, 6, (n, n)) * (rng.random((n, n)) < share)
    np.fill_diagonal(rates, 0.0)
    rates[0, 1] = 10.0 ** rng.uniform(-12, 6)
    return rates


def leak(fast, slow=1e-3):
    """A <-> B quickly, B -> C slowly."""
    reactions = {"ab": ((1, 0, 0), (0, 1, 0)), "ba": ((0, 1, 0), (1, 0, 0)), "leak": ((0, 1, 0), (0, 0, 1))}
    return network("ABC", reactions, [fast, fast, slow])


@pytest.fixture(scope="module")
def embedded():
    return embedded_system()


@pytest.fixture
def factorised(monkeypatch):
    """The lengths of the steps whose equations were factorised."""
    lengths = []

    class Counted(RadauStep):
        def __init__(self, rates, length, degree):
            lengths.append(length)
            super().__init__(rates, length, degree)

    monkeypatch.setattr(collocation, "RadauStep", Counted)
    return lengths


@pytest.mark.parametrize("fast", [1.0, 1e4, 1e8, 1e12, 1e14])
def test_stiff_pair_with_a_slow_leak(fast, factorised):
    times = [1e-12, 1.0, 1e1]
    law = Collocation().solve(leak(fast), [1, 0, 0], times)
    rows = [law.space.index_of(state) for state in np.eye(3, dtype=int)]
    exact = np.array([leak_exact(fast, 1e-3, time) for time in times])
    seen = abs(law.probabilities[:, rows] - exact).sum(axis=1).max()
    assert seen <= law.error < 1e-12
    assert law.is_bound
    assert abs(law.probabilities.sum(axis=1) - 1).max() < 1e-13
    # About as many steps as powers of two in rate * time: counted work.
    assert len(factorised) < 12 + 1.2 * np.log2(10 * fast)


@pytest.mark.parametrize("seed", range(6))
def test_the_bound_holds_on_chains_over_many_decades(seed):
    """Against 100 digits, and the distance stays below the bound by far more than chance."""
    rates = random_chain(np.random.default_rng(seed), 5)
    rows, columns = np.nonzero(rates)
    times = [1e-7, 0.37, 1e6]
    p, error = solved(Entries(rows, columns, rates[rows, columns]), 5, times)
    with mpmath.workdps(100):
        Q = mpmath.matrix(rates.tolist())
        for i in range(5):
            Q[i, i] = -mpmath.fsum(Q[i, :])
        for row, time in zip(p, times, strict=True):
            exact = mpmath.expm(Q * mpmath.mpf(time))[0, :]
            seen = mpmath.fsum(abs(mpmath.mpf(float(row[i])) - exact[i]) for i in range(5))
            assert seen <= error < 1.1e-12


@pytest.mark.parametrize("tolerance", [1e-3, 1e-6, 1e-9, 1e-14])
def test_the_tolerance_is_kept_and_used(tolerance):
    times = np.array([0.01, 0.4, 30.0, 1e6])
    law = Collocation(tolerance).solve(switch(1.0, 2.0), [40, 0], times)
    in_b = (1.0 - np.exp(-3.0 * times)) / 3.0
    exact = binom(40, in_b[:, None]).pmf(np.arange(41))
    seen = abs(law.marginal("B") - exact).sum(axis=1).max()
    assert seen <= law.error + 2e-13  # scipy's binomial rounds
    assert law.error <= tolerance + 2e-14
    assert law.error > 1e-4 * tolerance


def test_a_large_chain_with_rates_over_six_decades(embedded):
    """3,478 states until q t = 3e7: the components that fail on their own have closed forms."""
    states, entries, loops = embedded
    assert (len(states), entries.rates.size + loops) == (3478, 14639)  # as PRISM counts them
    assert 3e-8 < entries.rates.min() < entries.rates.max() < 4e-2
    times = np.array([1e5, 1e7, 3.6e8])
    p, error = solved(entries, len(states), times, 1e-10)
    assert error <= 1e-10
    assert abs(p.sum(axis=1) - 1.0).max() < 1e-14
    main = np.exp(-PROCESSOR * times)
    assert_allclose(p @ (states[:, 4] == 1), main, rtol=0, atol=error)
    actuators = binom(2, np.exp(-ACTUATOR * times)[:, None]).pmf(range(3))
    for k in range(3):
        assert_allclose(p @ (states[:, 2] == k), actuators[:, k], rtol=0, atol=error)
        # Independent of the main processor: the product.
        assert_allclose(p @ ((states[:, 2] == k) & (states[:, 4] == 1)), actuators[:, k] * main, rtol=0, atol=error)
    three, two = np.exp(-3 * SENSOR * times), 3 * (np.exp(-2 * SENSOR * times) - np.exp(-3 * SENSOR * times))
    for k, exact in ((3, three), (2, two), (1, 1 - three - two)):
        assert_allclose(p @ (states[:, 0] == k), exact, rtol=0, atol=error + 1e-15)
    # The whole distribution by uniformisation, as late as it goes quickly.
    chain = DiscreteChain.of(Transitions(*entries[:3], np.zeros(len(states))))
    other, _, off = mixtures(chain, np.eye(1, len(states))[0], times[:1], 1e-13)
    assert abs(p[0] - other[0]).sum() <= error + off
    # The control: one rate in fourteen thousand wrong by a millionth is seen.
    wrong = entries._replace(rates=entries.rates * np.where(np.arange(entries.rates.size) == 0, 1 + 1e-6, 1.0))
    p, error = solved(wrong, len(states), times[:1], 1e-10)
    assert abs(p @ (states[:, 0] == 3) - three[:1]).max() > error


def test_against_the_dense_method():
    times = [30.0, 2000.0, 1e6]
    law = Collocation().solve(line(), [30, 0, 0, 0], times)
    other = Dense(certified_states=10).solve(line(), [30, 0, 0, 0], times)
    assert len(law.space) == 297
    assert abs(law.probabilities - other.probabilities).sum(axis=1).max() <= law.error + other.error
    assert law.is_bound
    assert law.error < 1e-12


def test_uniformisation_hands_over_what_is_stiff_and_large():
    fast, copies = 1e6, 2200
    law = Transient().solve(switch(fast, fast), [copies, 0], [1e-9, 1.0])
    assert law.is_bound
    assert law.error < 1e-12
    in_b = -0.5 * np.expm1(-2 * fast * law.times)
    exact = binom(copies, in_b[:, None]).pmf(np.arange(copies + 1))
    assert abs(law.marginal("B") - exact).sum(axis=1).max() < law.error + 1e-11  # scipy's binomial rounds


def test_a_chain_in_circles_takes_many_steps_and_is_ended_when_it_takes_too_long():
    n, t = 60, 200.0
    ring = Entries(np.arange(n), (np.arange(n) + 1) % n, np.ones(n))
    p, error = solved(ring, n, [t])
    with mpmath.workdps(30):
        turns = [mpmath.exp(-t) * mpmath.mpf(t) ** k / mpmath.factorial(k) for k in range(600)]
        exact = [float(mpmath.fsum(turns[i::n])) for i in range(n)]
    assert abs(p[0] - exact).sum() <= error + 1e-15
    foretold = CollocationPlan.of(generator_of(ring, n), t, 1e-12, 1e4)
    with pytest.raises(ValueError, match=r"far shorter than forecast, as in a chain that oscillates"):
        integrate(ring, np.eye(1, n)[0], np.array([t]), foretold, 1e-12, 0.1 * foretold.seconds)


def test_what_takes_too_long_is_refused_before_it_starts(factorised):
    with pytest.raises(ValueError, match=r"41 states would take about \d+ steps until 1e\+06, up to 0\.\d+ s; max_s"):
        Collocation(max_seconds=0.02).solve(switch(), [40, 0], [1e6])
    with pytest.raises(ValueError, match=r"up to 1 apart, may take .* s to factorise once"):
        Collocation(max_seconds=1e-7).solve(switch(), [100, 0], [1.0])
    with pytest.raises(ValueError, match=r"too stiff for collocation: its fastest rate times 1e\+10 is 8e\+20"):
        Collocation().solve(switch(1e9, 2e9), [40, 0], [1e10])
    assert not factorised


def test_the_tables_are_exact_on_polynomials():
    tables = radau_tables(4)
    points = tables.values[1:, 1]
    assert_allclose(points[-1], 1.0)
    nodes = tables.values[:, 1]
    slopes = np.column_stack([tables.start, tables.rotation @ tables.triangle @ tables.rotation.T])
    for k in range(5):
        assert_allclose(slopes @ nodes**k, k * points ** max(k - 1, 0), atol=1e-13)


def test_defects_in_fixed_point_bring_back_what_sparse_lu_loses():
    """A pair in balance at rates of 1e12 that leaks at 0.1."""
    fast, degree = Entries(np.array([0, 1, 1]), np.array([1, 0, 2]), np.array([1e12, 1e12, 0.1])), 8
    chain, Q, tables = FixedPointChain.of(fast, 3, 1.0, 1e-12), generator_of(fast, 3), radau_tables(degree)
    step, begin = RadauStep(Q.T, 1.0, degree), np.array([0.5, 0.5, 0.0])
    start = chain.digits(begin)
    planes, u = chain.constant(start, degree), np.outer(begin, np.eye(1, degree + 1)[0])
    signs = (-1.0) ** np.arange(degree + 1)
    for _ in range(6):
        found = chain.defect(planes, start, Fraction(1))
        planes = chain.plus(planes, step.correction(found.coefficients, found.jump))
        u += step.correction(u @ tables.derivative.T - Q.T @ u / 2, u @ signs - begin)
    left = np.exp(-0.05) / 2
    assert_allclose(chain.values(chain.end(planes)), [left, left, 1 - 2 * left], atol=1e-12)
    # The control: defects in doubles.
    assert abs(u.sum(axis=1) - [left, left, 1 - 2 * left]).max() > 1e-8


def test_reading_times_off_the_steps_costs_nothing(factorised):
    many = Collocation().solve(switch(3.0, 5.0), [6, 0], np.geomspace(1e-3, 40.0, 50))
    steps = len(factorised)
    Collocation().solve(switch(3.0, 5.0), [6, 0], [40.0])
    assert len(factorised) == 2 * steps
    in_b = 3 / 8 * -np.expm1(-8 * many.times)
    assert_allclose(many.mean()[:, 1], 6 * in_b, rtol=0, atol=6 * many.error)


def test_the_space_is_the_reachable_one():
    law = Collocation().solve(line(), [8, 0, 0, 0], [10.0])
    assert len(law.space) == len(reachable(line(), [8, 0, 0, 0]))
    assert_allclose(law.mean() @ [1, 2, 3, 4], 8, rtol=1e-13)


@pytest.mark.parametrize(("rate", "time"), [(1e-310, 1.0), (1e-300, 1e80), (3e80, 1e-81), (1.0, 1e-300), (1e-90, 1e90)])
def test_rates_and_times_far_from_one(rate, time):
    law = Collocation().solve(network("AB", {"turn": ((1, 0), (0, 1))}, [rate]), [1, 0], [time])
    assert_allclose(law.marginal("B")[0, 1], -np.expm1(-rate * time), rtol=1e-9, atol=law.error)
    assert law.error < 1e-12


def test_a_time_beyond_all_numbers_is_refused():
    with pytest.raises(ValueError, match=r"too stiff for collocation: .* until 1e\+100"):
        Collocation().solve(switch(1e-300), [1, 0], [1e300])
