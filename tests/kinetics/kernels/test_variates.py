"""Poisson and binomial variates as whole distributions, from means near 0 to beyond 1e12, where doubles get coarse."""

import numpy as np
import pytest
from known_systems import assert_follows_table
from scipy.special import gammaln, ndtri, xlogy
from scipy.stats import binom, poisson

from kinetics.kernels import variates
from kinetics.sampling.base import stream_key

pytestmark = pytest.mark.filterwarnings("ignore:overflow encountered")

DRAWS = 20_000
CELLS = 41
POISSON = [1e-3, 0.7, 9.99, 10.0, 13.0, 75.0, 1e4, 1e9, 1e12]
BINOMIAL = [
    (1, 0.5),
    (19, 0.5),
    (21, 0.5),
    (40, 0.3),
    (97, 0.104),
    (200, 0.9),
    (10**6, 0.5),
    (10**9, 3e-8),
    (10**12, 0.4),
]
HALVES = [1, 2, 63, 64, 65, 300, 512, 513, 10**5]


def drawn(draw, seed):
    """As many variates from one stream."""
    stream = stream_key(seed)
    return np.array([draw(stream) for _ in range(DRAWS)])


def assert_follows(sample, law):
    """Chi-square over cells between quantiles, the last ones far out in the tails."""
    tails = np.geomspace(1e-3, 0.02, 4)
    levels = np.concatenate([tails, np.linspace(0.03, 0.97, CELLS), 1 - tails[::-1]])
    edges = np.unique(np.maximum(np.round(law.mean() + law.std() * ndtri(levels)), 0.0)).astype(np.int64)
    below = law.cdf(edges)
    cells = np.bincount(np.searchsorted(edges, sample), minlength=edges.size + 1)
    assert_follows_table(cells, np.diff(np.concatenate([[0.0], below, [1.0]])))


@pytest.mark.parametrize("mean", POISSON)
def test_poisson_variates(mean):
    sample = drawn(lambda stream: variates.poisson(mean, stream), 31)
    assert_follows(sample, poisson(mean))
    with pytest.raises(AssertionError, match="chi-square"):  # a shift by an eighth of a standard deviation
        assert_follows(sample, poisson(mean + 0.125 * np.sqrt(mean) + 0.003))


@pytest.mark.parametrize(("n", "p"), BINOMIAL)
def test_binomial_variates(n, p):
    sample = drawn(lambda stream: variates.binomial(n, p, stream), 32)
    assert sample.min() >= 0
    assert sample.max() <= n
    assert_follows(sample, binom(n, p))
    with pytest.raises(AssertionError, match="chi-square"):
        assert_follows(sample, binom(n, p - 0.14 * np.sqrt(p * (1 - p) / n)))


@pytest.mark.parametrize("n", HALVES)
def test_halves_of_events(n):
    sample = drawn(lambda stream: variates.halved(n, stream), 33)
    assert_follows(sample, binom(n, 0.5))
    with pytest.raises(AssertionError, match="chi-square"):
        assert_follows(sample, binom(n, 0.5 - 0.07 / np.sqrt(n)))


def test_what_needs_no_draw_takes_none():
    stream = stream_key(1)
    before = stream.copy()
    nothing = [variates.poisson(0.0, stream), variates.binomial(9, 0.0, stream), variates.binomial(0, 0.4, stream)]
    assert (nothing, variates.binomial(9, 1.0, stream), variates.halved(0, stream)) == ([0, 0, 0], 9, 0)
    np.testing.assert_array_equal(stream, before)


@pytest.mark.parametrize("k", [1.0, 7.0, 15.0, 16.0, 400.0, 1e5])
def test_logarithms_of_probabilities(k):
    for mean in (k, 0.97 * k, 1.1 * k, 2.0 * k):
        exact = xlogy(k, mean) - mean - gammaln(k + 1)
        assert abs(variates.log_poisson(k, mean) - exact) < 1e-11 * max(k, 10.0)
    n = 3.0 * k
    exact = gammaln(n + 1) - gammaln(k + 1) - gammaln(n - k + 1) + k * np.log(0.4) + (n - k) * np.log(0.6)
    assert abs(variates.log_binomial(k, n, 0.4) - exact) < 1e-11 * max(n, 10.0)
