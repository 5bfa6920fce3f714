import numpy as np
import pytest
from known_systems import decay, line, network, switch
from matplotlib.figure import Figure
from numpy.testing import assert_allclose, assert_array_equal
from scipy.linalg import expm
from scipy.sparse.linalg import expm_multiply
from scipy.stats import binom, poisson

from kinetics import Transient, solve
from kinetics.markov.transient import Dense, reachable
from kinetics.markov.transient.poisson import poisson_bounds, poisson_window, window_error
from kinetics.markov.transient.uniformisation import DiscreteChain, mixtures


@pytest.mark.parametrize(("cubes", "n_states"), [(60, 1906), (80, 4263), (120, 13561)])
def test_line_of_four(cubes, n_states):
    law = solve(line(), Transient(), [cubes, 0, 0, 0], [0.0, 100.0, 2000.0])
    assert len(law.space) == n_states
    assert law.probabilities.min() >= -1e-14
    assert_allclose(law.probabilities.sum(axis=1), 1.0, rtol=0, atol=1e-12)
    assert_allclose(law.mean() @ [1, 2, 3, 4], cubes, rtol=1e-12)
    assert_array_equal(law.mean()[0], [cubes, 0, 0, 0])
    assert law.error < 1e-12
    assert law.is_bound


def test_large_line_against_scipy():
    law = solve(line(), Transient(), [60, 0, 0, 0], [150.0])
    Q = law.space.generator()
    reference = expm_multiply(Q.T.tocsr() * 150.0, np.eye(1, len(law.space))[0])
    assert abs(law.probabilities[0] - reference).sum() < 1e-11


@pytest.mark.parametrize("mean", [1e-9, 0.3, 7.0, 1234.5, 1e7])
@pytest.mark.parametrize("tolerance", [1e-3, 1e-14])
def test_poisson_weights(mean, tolerance):
    first, weights = poisson_window(mean, tolerance)
    numbers = np.arange(first, first + weights.size)
    assert_allclose(weights.sum(), 1.0, rtol=1e-14)
    likely = weights > 1e-12
    assert 2 * tolerance <= window_error(mean, first, weights, tolerance) < 2 * tolerance + 1e-11
    # scipy's own value goes through logarithms of the size of mean * log(mean)
    exact = poisson(mean).pmf(numbers[likely])
    assert_allclose(weights[likely], exact, rtol=tolerance + 1e-15 * max(mean * np.log(mean), 100))
    low, high = poisson_bounds(mean, tolerance)
    assert poisson(mean).cdf(low - 1) + poisson(mean).sf(high) <= tolerance


def leak(fast, slow=1e-3):
    """A <-> B quickly, B -> C slowly: once mixed, a slow exponential with half the rate."""
    reactions = {"ab": ((1, 0, 0), (0, 1, 0)), "ba": ((0, 1, 0), (1, 0, 0)), "leak": ((0, 1, 0), (0, 0, 1))}
    return network("ABC", reactions, [fast, fast, slow])


def test_stiff_chain():
    law = solve(leak(1e6), Transient(), [1, 0, 0], [1.0])
    a = 1e6 + 5e-4
    slow_rate = 1e-3 * 1e6 / (a + np.sqrt(a * a - 1e3))  # product of the roots over the larger one
    # No leak at first, from A: the weights of the two roots are as the roots; the faster is gone by exp(-2e6).
    fast_rate = 2e6 + 1e-3 - slow_rate
    exact = np.exp(-slow_rate) * fast_rate / (fast_rate - slow_rate)
    left = law.probabilities[0] @ (law.space.states[:, 2] == 0)
    assert abs(left - exact) < law.error < 1e-12
    assert law.is_bound  # the dense method, certified


def test_too_stiff_and_large_is_refused():
    message = r"too stiff for uniformisation: 2\.\de\+19 steps until 1e\+10, .* its 2201 states are too many"
    with pytest.raises(ValueError, match=message):
        solve(switch(1e6, 1e6), Transient(), [2200, 0], [1e10])


def test_long_and_large():
    # more states than the dense method takes, more steps than are usual
    law = solve(switch(1.0, 1.0), Transient(), [2100, 0], [20.0])
    assert law.is_bound
    exact = binom(2100, 0.5).pmf(np.arange(2101))
    assert abs(law.marginal("B")[0] - exact).sum() < law.error + 1e-12 < 1e-8


def test_what_takes_too_long_is_refused_before_it_starts():
    message = r"351 states would take 2\.\d+e\+03 steps until 1, up to 0\.00\d+ s; max_seconds = 0.001; raise it"
    with pytest.raises(ValueError, match=message):
        Transient(max_seconds=1e-3).solve(switch(6.0, 1.0), [350, 0], [1.0])
    with pytest.raises(ValueError, match="max_seconds = nan"):
        Transient(max_seconds=np.nan)


def test_a_settled_distribution_takes_no_more_steps(monkeypatch):
    # 1e5 relaxation times: binomial long before, by far fewer steps than the Poisson window asks for.
    from kinetics.kernels import markov

    done, advance = [], markov.advance
    monkeypatch.setattr(markov, "advance", lambda *arrays: (done.append(len(arrays[-1])), advance(*arrays)))
    times = [0.2, 5.0, 4000.0]
    chain = DiscreteChain.of(reachable(switch(1.0, 2.0), [30, 0]).transitions())
    p, stays, error = mixtures(chain, np.eye(1, chain.size)[0], times, 1e-13)
    assert sum(done) < 0.02 * chain.steps_until(4000.0, 1e-13)
    in_b = (1.0 - np.exp(-3.0 * np.array(times))) / 3.0
    copies = np.arange(31)
    exact = binom(30, in_b[:, None]).pmf(copies)
    assert abs(p - exact).sum(axis=1).max() < error < 1e-9
    assert_allclose(stays.sum(), chain.steps_until(4000.0, 0.5e-13) + 1, rtol=1e-3)
    # A chain that only seems to rest, its slow leak far below one step's rounding, is not taken for settled.
    p, _, error = mixtures(
        slow := DiscreteChain.of(reachable(leak(1e3, 1e-9), [1, 0, 0]).transitions()), np.eye(3)[0], [200.0], 1e-13
    )
    gone = -np.expm1(-0.5e-9 * 200.0)
    assert slow.steps_until(200.0, 1e-13) > 1e5
    assert abs(p[0, 2] - gone) <= error < 0.01 * gone


def test_bounds():
    law = solve(switch(1.0, 2.0), Transient(), [40, 0], [0.7])
    in_b = (1.0 - np.exp(-2.1)) / 3.0
    low, high = law.mean_bounds()
    assert low[0, 1] < 40 * in_b < high[0, 1] < low[0, 1] + 1e-10
    low, high = law.probability_bounds([30, 10])
    assert low[0] <= binom(40, in_b).pmf(10) <= high[0] <= low[0] + 1e-11


def test_joint_moments_are_those_of_a_multinomial():
    # Copies that change independently between A and B, and from B to C: covariance -n p q, variance n p (1 - p).
    reactions = {"ab": ((1, 0, 0), (0, 1, 0)), "ba": ((0, 1, 0), (1, 0, 0)), "bc": ((0, 1, 0), (0, 0, 1))}
    net = network("ABC", reactions, [1.0, 2.0, 0.5])
    Q = np.array([[-1.0, 1.0, 0.0], [2.0, -2.5, 0.5], [0.0, 0.0, 0.0]])
    for method in (Transient(), Dense()):
        law = solve(net, method, [12, 0, 0], [0.3, 4.0])
        for t, time in enumerate(law.times):
            p = expm(Q * time)[0]
            exact = 12 * (np.diag(p) - np.outer(p, p))
            assert_allclose(law.covariance()[t], exact, rtol=0, atol=1e-12)
        assert_allclose(np.sqrt(np.diagonal(law.covariance(), axis1=1, axis2=2)), law.sd(), rtol=1e-12)


def test_reading_a_distribution():
    law = solve(line(), Transient(), [12, 0, 0, 0], [100.0, 900.0])
    states, p = law.space.states, law.probabilities
    assert law.network.species[0] == "monomer"
    assert_allclose(law.probability(states[5]), p[:, 5])
    assert_array_equal(law.probability([11, 0, 0, 0]), [0, 0])
    quadmers = law.marginal("quadmer")
    assert quadmers.shape == (2, 4)
    assert_allclose(quadmers[1, 2], p[1, states[:, 3] == 2].sum())
    median = law.quantile(0.5)
    for t in range(2):
        for s in range(4):
            assert p[t, states[:, s] <= median[t, s]].sum() >= 0.5
            assert p[t, states[:, s] < median[t, s]].sum() < 0.5
    table = law.to_dataframe()
    assert list(table.columns) == ["time", "species", "mean", "sd"]
    assert_allclose(table["mean"], law.mean().ravel())
    ax = Figure().add_subplot()
    assert law.plot(ax) is ax
    assert ax.get_xlabel() == "time (tu)"
    with pytest.raises(ValueError, match="expected a probability"):
        law.quantile(-0.1)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (
            (line(), [60, 0, 0, 0], np.arange(4_000_000)),
            r"1906 states at 4000000 times would take 56.8 GB of memory, .* are free; ask for fewer times",
        ),
        ((line(), [400, 0, 0, 0], [1.0]), "over 5000 states are reachable"),
    ],
)
def test_bad_input(arguments, message):
    with pytest.raises(ValueError, match=message):
        Transient(max_states=5000).solve(*arguments)


def test_decay_far_out():
    law = solve(decay(1.0), Transient(), [5], [1000.0])
    assert_allclose(law.marginal("X")[0], [1, 0, 0, 0, 0, 0], atol=1e-13)


@pytest.mark.parametrize("method", [Transient(), Dense()])
def test_a_time_beyond_all_numbers_is_refused(method):
    with pytest.raises(ValueError, match="beyond what numbers"):
        solve(switch(1e10), method, [1, 0], [1e300])
