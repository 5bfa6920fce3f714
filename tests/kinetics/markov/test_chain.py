"""A chain as one object: closed forms, dense algebra, and what functions of networks say."""

from dataclasses import replace

import numpy as np
import pytest
from known_systems import decay, line, switch
from numpy.testing import assert_allclose, assert_array_equal
from random_chains import random_rates
from scipy.linalg import expm
from scipy.sparse import csr_array
from scipy.special import gammainc
from scipy.stats import chisquare

from kinetics import Chain, Reward, Sensitivity, Transient, committor, first_passage, solve, stationary
from kinetics.markov import chain_path, chain_path_to
from kinetics.markov.transient import Dense


def queue(places=6, arrive=0.7, serve=1.0, start=0):
    """M/M/1/K, with the number of those in it as a variable."""
    rates = np.diag(np.full(places, arrive), 1) + np.diag(np.full(places, serve), -1)
    return Chain(rates, start, variables=("n",), counts=np.arange(places + 1)[:, None])


def contains(answer, exact, rounding=1e-14):
    """Whether the exact value, itself rounded, lies within the limits."""
    return answer.low - rounding * abs(exact) <= exact <= answer.high + rounding * abs(exact)


def test_the_queue_in_the_end():
    chain, r = queue(), 0.7
    shares = r ** np.arange(7)
    shares /= shares.sum()
    assert_allclose(chain.stationary().probabilities, shares, rtol=1e-13)
    assert contains(chain.steady_state("n >= 5"), shares[5:].sum())
    assert contains(chain.reward("n", stationary=True), shares @ np.arange(7))
    # what is lost at the full place, as impulses: none is, so arrivals are those at all other places
    arrivals = Reward(impulses=np.diag(np.ones(6), 1))
    assert contains(replace(chain, rewards={"in": arrivals}).reward("in", stationary=True), 0.7 * (1 - shares[6]))
    assert not contains(chain.steady_state("n >= 5"), shares[5:].sum() * (1 + 1e-11))  # the control


def test_ruin_is_that_of_the_gambler():
    chain, odds = queue(20, 1.0, 2.0, start=3), 2.0
    exact = (odds**3 - 1) / (odds**20 - 1)
    answer = chain.until("n == 20", "n > 0")
    assert contains(answer, exact)
    assert answer.is_bound
    assert answer.high - answer.low < 1e-12 * exact
    assert contains(chain.always("n > 0 & n < 20"), 0.0)
    assert chain.until("n == 20").value == 1.0  # for certain: it comes back from 0
    found = chain.committor({"rich": "n == 20", "broke": "n == 0"})
    assert_allclose(found.probabilities, [exact, 1 - exact], rtol=1e-13)


def test_the_time_of_many_stages_is_gamma():
    stages, chain = 9, Chain(np.diag(np.full(9, 2.0), 1), 0, labels={"done": np.arange(10) == 9})
    for t in (0.01, 1.0, 20.0):
        answer = chain.until("done", by=t)
        assert contains(answer, gammainc(stages, 2 * t), 1e-13)
        assert answer.is_bound
        assert answer.high - answer.low < 1e-12 * answer.value
    law = chain.passage("done")
    assert_allclose([law.mean, law.sd], [stages / 2, np.sqrt(stages) / 2], rtol=1e-13)
    assert_allclose(law.cdf([0.5, 4.0]), gammainc(stages, [1.0, 8.0]), rtol=0, atol=1e-13)
    assert law.quantile(0.5) == pytest.approx(chain.passage(np.arange(10) == 9).quantile(0.5))
    assert contains(replace(chain, rewards={"time": np.ones(10)}).reward("time", until="done"), stages / 2)


@pytest.mark.parametrize("seed", range(6))
def test_random_chains_as_dense_algebra_has_them(seed):
    n, t = 7, 1.3
    rates = random_rates(seed, n, decades=1.0)
    start = np.random.default_rng(seed).dirichlet(np.ones(n))
    q = rates - np.diag(rates.sum(axis=1))
    earned, impulses = np.arange(n) * 1.0, np.where(rates > 0, 0.5, 0.0)
    rewards = {"both": Reward(earned, impulses), "state": earned}
    chain = Chain(csr_array(q), start, {"high": np.arange(n) >= 5}, rewards, ("x",), np.arange(n)[:, None])
    high, low = np.arange(n) >= 5, np.arange(n) < 5
    gains = earned + (rates * impulses).sum(axis=1)

    law = chain.transient([0.0, t])
    exact = start @ expm(q * t)
    assert abs(law.probabilities[1] - exact).sum() <= law.error + 1e-12
    means, (lows, highs) = law.mean(chain.counts), law.mean_bounds(chain.counts)
    assert_allclose(means[:, 0], [start @ earned, exact @ earned], rtol=1e-11)
    assert np.all((lows < means) & (means < highs))
    assert_allclose(chain.transient([t], Dense()).probabilities[0], exact, rtol=1e-10)

    stops = q.copy()
    stops[(np.arange(n) == 3) | high] = 0.0
    within = start @ expm(stops * t)
    assert contains(chain.until("high", "x != 3", by=t), within[high].sum(), 1e-12)
    assert contains(chain.until("high", "x != 3", by=t, method=Transient()), within[high].sum(), 1e-12)
    inner = np.flatnonzero(~((np.arange(n) == 3) | high))
    ways = np.linalg.solve(-q[np.ix_(inner, inner)], q[inner][:, high].sum(axis=1))
    assert contains(chain.until("high", "x != 3"), start[inner] @ ways + start[high].sum(), 1e-12)
    shut = q.copy()
    shut[high] = 0.0
    assert contains(chain.always('!"high"', by=t), (start @ expm(shut * t))[low].sum(), 1e-12)

    both = np.zeros((2 * n, 2 * n))
    both[:n, :n], both[:n, n:] = q, np.eye(n)
    total = start @ expm(both * t)[:n, n:]
    assert contains(chain.reward("both", up_to=t), total @ gains, 1e-12)
    assert contains(chain.reward("state", at=t), exact @ earned, 1e-12)
    back = np.linalg.inv(-q[np.ix_(low, low)])
    assert contains(chain.reward("both", until="high"), start[low] @ back @ gains[low], 1e-12)
    first, second = start[low] @ back.sum(axis=1), 2 * start[low] @ back @ back.sum(axis=1)
    passage = chain.passage("high")
    assert_allclose([passage.mean, passage.sd], [first, np.sqrt(second - first**2)], rtol=1e-11)
    assert_allclose(passage.survival(t), (start @ expm(shut * t))[low].sum(), rtol=1e-11)
    rest = np.linalg.lstsq(np.vstack([q.T, np.ones(n)]), np.append(np.zeros(n), 1.0), rcond=None)[0]
    assert contains(chain.reward("both", stationary=True), rest @ gains, 1e-11)
    assert_allclose(chain.steady_state("high").value, rest[high].sum(), rtol=1e-10)


def test_a_network_compiles_to_its_chain():
    start, times = {"monomer": 12}, [20.0, 300.0]
    chain = Chain.of(line(), start)
    for method in (Transient(), Dense()):
        law, known = chain.transient(times, method), solve(line(), method, start, times)
        assert_array_equal(law.probabilities, known.probabilities)
        assert (law.error, law.is_bound, law.method) == (known.error, known.is_bound, method.name)
    passage, known = chain.passage("quadmer >= 1"), first_passage(line(), start, "quadmer")
    assert_allclose([passage.mean, passage.sd], [known.mean, known.sd], rtol=1e-12)
    assert_allclose(passage.cdf(times), known.cdf(times), rtol=1e-11)
    assert contains(chain.until("quadmer >= 1", by=300.0), float(known.cdf(300.0)), 1e-12)
    stopped = Chain.of(line(), start, stop="quadmer >= 1")
    assert len(stopped) < len(chain)
    assert stopped.passage("quadmer >= 1").mean == known.mean
    assert_allclose(chain.stationary().probabilities, stationary(line(), start).probabilities, rtol=1e-12)
    ends = {"two": lambda s: s[:, 3] == 2, "trimers": lambda s: s[:, 2] == 3}
    ours = chain.committor({"two": "quadmer == 2", "trimers": "trimer == 3 and quadmer != 2"})
    assert_allclose(ours.probabilities, committor(line(), start, ends).probabilities, rtol=1e-12)


def test_downward_targets_and_any_start():
    copies, t = 30, 0.8
    chain = Chain.of(decay(1.0), [copies])
    left = 1 - np.exp(-t)
    # all but three are gone: binomial
    from scipy.stats import binom

    assert contains(chain.until("X <= 3", by=t), binom(copies, left).sf(copies - 4), 1e-12)
    assert_allclose(chain.passage("X <= 3").mean, sum(1 / k for k in range(4, copies + 1)), rtol=1e-13)
    spread = Chain(chain.transitions, np.full(copies + 1, 1 / (copies + 1)), variables=("X",), counts=chain.counts)
    each = [sum(1 / k for k in range(4, n + 1)) for n in range(copies + 1)]
    assert_allclose(spread.passage("X <= 3").mean, np.mean(each), rtol=1e-13)


def test_what_never_happens_and_what_is_certain():
    # 0 -> 1 or 2, both for ever
    chain = Chain([[0, 3.0, 1.0], [0, 0, 0], [0, 0, 0]], 0, {"one": [False, True, False]}, {"r": [2.0, 0, 0]})
    assert contains(chain.until("one"), 0.75)
    assert chain.until([False, False, False]).value == 0.0
    assert chain.until([True, True, True]).value == 1.0
    assert contains(chain.always('!"one"'), 0.25)
    assert contains(chain.steady_state("one"), 0.75)
    assert_allclose(chain.until("one", by=1e3).value, 0.75, rtol=1e-11)
    assert contains(chain.until("one", by=0.0), 0.0)
    assert contains(chain.reward("r", until=[False, True, True]), 0.5)
    with pytest.raises(ValueError, match=r"reached with probability 0\.75 only"):
        chain.reward("r", until="one")
    assert not chain.passage("one").is_certain
    assert_allclose(chain.passage("one").probability, 0.75, rtol=1e-14)
    quiet = Chain(np.zeros((2, 2)), [0.25, 0.75], rewards={"r": [1.0, 3.0]})
    assert contains(quiet.reward("r", at=5.0), 2.5)
    assert contains(quiet.reward("r", up_to=4.0), 10.0)


def test_a_stiff_chain_is_solved_forwards():
    chain = Chain.of(switch(1e6, 1e6), [1, 0])
    answer = chain.until("B >= 1", by=100.0)
    assert answer.method == "exact"
    assert answer.value == 1.0


def test_rewards_of_stiff_chains_are_known_to_chain_and_sensitivity():
    """One copy on A and then B, a / (a + b) of the time; up to a time neither of both answers."""
    chain = Chain.of(switch(3e6, 1e6), [1, 0], rewards={"held": "7 * A"})
    answer, slopes = chain.reward("held", at=100.0), Sensitivity(chain).reward("held", at=100.0)
    assert answer.method == "exact"
    for found in (answer, slopes.answer):
        assert found.is_bound
        assert found.low <= 7 / 4 <= found.high
        assert found.high - found.low < 1e-12
    assert not answer.low <= 7 / 4 * (1 + 1e-11) <= answer.high  # the control
    assert_allclose(slopes.elasticity, [-0.75, 0.75], rtol=1e-10)
    for asked in (chain, Sensitivity(chain)):
        with pytest.raises(ValueError, match="too stiff for"):
            asked.reward("held", up_to=100.0)


def test_rate_laws_give_bounds_where_they_are_bounded():
    from dataclasses import replace

    chains = [
        Chain.of(replace(switch(), laws=laws), [2, 0])
        for laws in ({}, {"forward": "A"}, {"forward": "1e16 * (1 - exp(-1e-16 * A))"})
    ]
    for ask in (
        lambda chain: chain.until("B >= 2", by=1.0),
        lambda chain: chain.until("B >= 2", "A >= 1 | B >= 2"),
        lambda chain: chain.until("B >= 2"),
        lambda chain: chain.until("B >= 3"),
        lambda chain: chain.always("A >= 1", by=1.0),
        lambda chain: chain.steady_state("B >= 2"),
        lambda chain: chain.reward("A", at=1.0),
        lambda chain: chain.reward("A", up_to=1.0),
        lambda chain: chain.reward("A", until="B >= 2"),
        lambda chain: chain.passage("B >= 2"),
        lambda chain: chain.committor({"all": chain.states("B >= 2"), "none": chain.states("B == 0")}),
        lambda chain: chain.transient([1.0]),
        lambda chain: chain.until("B >= 2", by=1.0, method=Dense()),
    ):
        same, by_law, lost = map(ask, chains)
        assert same.is_bound
        assert by_law.is_bound
        assert not lost.is_bound  # nothing is known of the law
    same, by_law, lost = (chain.passage("B >= 2") for chain in chains)
    assert by_law.error == pytest.approx(same.error, rel=0.5, abs=0.0)


def test_rates_given_from_outside_are_exact():
    given, known = queue(3, 1.0, 1.0), Chain.of(switch(), [2, 0])
    assert (given.transitions.rate_error, known.transitions.rate_error) == (0.0, 8.0)
    same = Chain(known.transitions.generator(), known.initial)
    assert same.passage(same.states(known.states("B >= 2"))).error < known.passage("B >= 2").error


def test_runs_follow_the_chain():
    chain = queue(3, 1.0, 1.0)
    ends = np.array([chain_path(chain, 2.0, seed=1, run=run).at(2.0) for run in range(2000)])
    law = chain.transient([2.0]).probabilities[0]
    assert chisquare(np.bincount(ends, minlength=4), 2000 * law).pvalue > 1e-6
    assert chisquare(np.bincount(ends, minlength=4), 2000 * chain.transient([0.5]).probabilities[0]).pvalue < 1e-6
    rates = queue(9, 1.0, 9.0).transitions.generator().toarray()
    rates[0] = 0.0
    path = chain_path_to(Chain(rates, 1), np.arange(10) == 9, seed=3)  # a run in 5e7 does so
    assert path.states[-1] == 9
    assert np.all(np.diff(path.times) > 0)
    with pytest.raises(ValueError, match="the run is from 0 to"):
        path.at(path.end * 2)
    never = Chain([[0, 0], [1.0, 0]], 0)
    with pytest.raises(ValueError, match="never reached"):
        chain_path_to(never, [False, True])


def test_other_labels_take_the_place_of_the_first_ones():
    chain = replace(queue(), labels={"full": "n == 6"})
    assert chain.until("full", by=3.0).value == chain.until("n == 6", by=3.0).value
    assert list(replace(queue(), labels={"idle": "n == 0"}).labels) == ["idle"]
