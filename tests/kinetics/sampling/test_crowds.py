"""Networks in a crowd by thinning: their law is that of `general` and of the master equation, on every way to them.

Statistical checks have a false-alarm rate of 1e-6 each and a fixed seed.
"""

from dataclasses import replace
from itertools import islice

import numpy as np
import pytest
from crowded_networks import JOINING, LINE, SWELLING
from known_systems import assert_follows_cdf, assert_follows_table
from numpy.testing import assert_allclose, assert_array_equal
from scipy.stats import norm

from kinetics import Transient, first_passage
from kinetics.network import Crowding, Model, Network
from kinetics.sampling import Auto, Direct, General, Lockstep, first_times_of_draws, simulate_posterior
from kinetics.sampling import merging as merging_module
from kinetics.sampling.merging import Merging

CASES = {
    "hits": (LINE, [8, 0, 0, 0], 20.0),
    "joins too": (JOINING, [8, 0, 0, 0], 20.0),
    "swelling": (SWELLING, [12, 1], 6.0),
}
RUNS = 6000
METHODS = [Direct(), Lockstep()]
named = pytest.mark.parametrize("method", METHODS, ids=lambda method: method.name)
cases = pytest.mark.parametrize("case", CASES)


def counts_of(net, method, start, end, seed=3, runs=RUNS):
    return method.simulate(net, start, [end], runs=runs, seed=seed).counts[:, 0]


def assert_exact(net, start, end, counts):
    exact = Transient().solve(net, start, [end])
    assert_follows_table(np.bincount(exact.space.index_of(counts), minlength=len(exact.space)), exact.probabilities[0])


@cases
@named
def test_the_joint_law_solves_the_master_equation(case, method):
    net, start, end = CASES[case]
    counts = counts_of(net, method, start, end)
    assert_exact(net, start, end, counts)
    with pytest.raises(AssertionError, match="chi-square"):  # control: a chain without the factors
        assert_exact(net.uncrowded, start, end, counts)


def test_candidates_matter(monkeypatch):
    """Control: the low factors alone, and all candidates kept, are seen."""
    net, start, end = CASES["swelling"]
    right = merging_module.thinning_of
    for share in (0.0, 1e9):

        def wrong(*args, share=share):
            made = right(*args)
            return made._replace(factors=np.full_like(made.factors, share))

        monkeypatch.setattr(merging_module, "thinning_of", wrong)
        fresh = replace(net)
        with pytest.raises(AssertionError, match="chi-square"):
            assert_exact(net, start, end, counts_of(fresh, Lockstep(), start, end, runs=20_000))


def test_channels_that_are_not_merged_have_the_same_law(monkeypatch):
    """Three blocks of channels, each channel on its own."""
    net, start, end = CASES["hits"]
    monkeypatch.setattr(merging_module, "MOST_CHANNELS", 0)
    one, other = (counts_of(net, method, start, end, seed=5) for method in METHODS)
    assert_array_equal(one, other)
    assert_exact(net, start, end, one)


def test_general_has_the_same_law():
    net, start, end = CASES["swelling"]
    assert_exact(net, start, end, counts_of(net, General(), start, end, runs=1500))


@pytest.mark.parametrize("case", ["hits", "joins too"])
def test_members_share_sums_and_first_the_low_factors(case):
    """Low factors, and candidates kept at their shares, add up to the propensities."""
    net, start, _ = CASES[case]
    merging = Merging.of(net)
    thinning = merging.thinning(net.state(start))
    states = Transient().solve(net, start, [9.0]).space.states
    s, free = states @ thinning.weights, 1 - states @ thinning.volumes
    low = thinning.coefficients * (1 + np.outer(s, thinning.slopes))
    f = net.crowding.factors(states)[:, merging.members]
    assert (low <= f).all()
    assert (f <= (1 + thinning.ratio) * low).all()
    powers = [np.ones(len(s)), *((s / free) ** d / free for d in range(thinning.factors.shape[1] - 1))]
    kept = np.stack(powers, axis=1) @ thinning.factors.T - np.outer(s, thinning.slopes)
    assert_allclose(low + thinning.coefficients * kept, f, rtol=1e-9)
    model = merging.model(None, thinning)
    assert np.count_nonzero(model.terms[:, 3]) == 1  # as many sums as without a crowd
    x = np.column_stack([states, np.ones(len(states))])
    total = (x[:, model.terms[:, 1].astype(int)] - model.terms[:, 2]) @ model.terms[:, 0]
    x = np.column_stack([x, total])
    merged = model.coefficients * x[:, model.first] * (x[:, model.second] - model.less)
    expected = np.add.reduceat(net.uncrowded.propensities(states)[:, merging.members] * low, merging.spans[:-1], axis=1)
    assert_allclose(merged, expected, rtol=1e-9, atol=1e-15)


@cases
def test_events_of_a_path_are_attributed_by_the_factors(case):
    """Firings less integrated propensities are a martingale: each channel's own, in units of its spread."""
    net, start, end = CASES[case]

    def spread(rates_of):
        fired, expected = np.zeros(len(net.channels)), np.zeros(len(net.channels))
        for path in islice(Direct().sample_paths(net, start, end / 4, seed=8), 200):
            waits = np.diff(path.times, prepend=0.0, append=path.end)
            states = np.concatenate([[net.state(start)], path.states])[-waits.size :]
            fired += np.bincount(path.channels, minlength=len(net.channels))
            expected += waits @ rates_of.propensities(states)
        return np.abs(fired - expected) / np.sqrt(np.maximum(expected, 1.0))

    allowed = norm.isf(0.5e-6 / len(net.channels))
    assert spread(net).max() < allowed
    assert spread(net.uncrowded).max() > allowed  # control


@named
def test_first_times_have_the_law_of_the_passage(method):
    net, start, _ = CASES["hits"]
    name = net.species[3]
    found = method.first_times(net, start, f"{name} >= 1", runs=4000, seed=11)
    assert_follows_cdf(found.times, first_passage(net, start, name, 1).cdf)
    with pytest.raises(AssertionError, match="the laws differ"):
        assert_follows_cdf(found.times, first_passage(JOINING, start, name, 1).cdf)


def test_draws_of_rates_have_the_runs_of_their_networks():
    net, start, end = CASES["hits"]
    table = net.known_rates * np.array([[1.0], [1.7]])
    model = Model(net, start)
    made = list(simulate_posterior(model, table, [end], 30, seed=4))
    for d, row in enumerate(table):
        alone = Lockstep().simulate(net.with_rates(row), start, [end], 30, seed=4, first_run=30 * d)
        assert_array_equal(made[d], alone.counts)
    last = net.species[3]
    times = list(first_times_of_draws(model, table, f"{last} >= 1", 400.0, 30, seed=4))
    assert np.isfinite(times).any()


def test_auto_takes_a_method_that_knows_crowds_where_factors_have_bounds():
    net, start, _ = CASES["hits"]
    assert Auto().choose(net, start).name == Auto().choose(net, start, until=True).name == "lockstep"
    assert Auto(many=False).choose(net, start).name == "ssa"
    open_tank = Network.from_text("0 -> A, 2\nA + A -> A, 0.1")
    open_tank = replace(open_tank, crowding=Crowding([0.1], [0.0], [[1.0, 0.0], [0.0, 1.0]]))
    assert Auto().choose(open_tank, {"A": 3}).name == "general"
    # 25 parts fill the tank where they are pairs: SWELLING has bounds from fewer.
    full = {"A": 40}
    assert Auto().choose(SWELLING, full).name == "general"
    for method in METHODS:
        assert not method.supports(open_tank)
        assert method.supports(SWELLING)
        with pytest.raises(ValueError, match=r"no upper bound .* use the method 'general', or 'auto'"):
            method.simulate(SWELLING, full, [0.1], runs=9)
    found = Auto().first_times(SWELLING, full, "AA >= 1", runs=3, seed=1)
    assert found.method == "auto (general)"
    assert Auto().simulate(SWELLING, full, [1e-3], runs=2, seed=1).method == "auto (general)"
    ((counts,),) = (list(simulate_posterior(Model(SWELLING, full), SWELLING.known_rates[None], [1e-3], 1, seed=1)),)
    assert counts.shape == (1, 1, 2)


def test_ranges_hold_all_states_and_several_quantities_narrow_them():
    space = Transient().solve(SWELLING, [12, 1], [1.0]).space.states
    crowding = SWELLING.crowding
    low, high = crowding.ranges(SWELLING.conserved, [12, 1])
    for shares, least, most in zip((crowding.weights, crowding.volumes), low, high, strict=True):
        found = space @ shares
        assert least <= found.min() <= least * 1.2
        assert found.max() <= most <= found.max() * 1.1
    two = Crowding([1.0, 1.0, 1.0], [0.0, 0.0, 0.0], [[1.0]])
    each = {"a": np.array([1.0, 0.0, 1.0]), "b": np.array([0.0, 1.0, 1.0])}
    assert_allclose(two.ranges(each, [3, 4, 0]), [[4.0, 0.0], [7.0, 0.0]])  # 4 at least, for b; a and b together, 7
    assert two.ranges({"a": each["a"]}, [3, 4, 0])[1][0] == np.inf
