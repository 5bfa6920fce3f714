"""Chains without end, followed within some of their states: limits hold closed forms, and are close on many states."""

from dataclasses import replace

import mpmath
import numpy as np
import pytest
from scipy.stats import poisson

from kinetics import Chain, Network
from kinetics.markov import Reward, ask, chain_path

CLOSE = 1e-9


def queue(arrivals=1.0, services=2.0):
    """Immigration and death, as many servers as customers: endless."""
    return Network.from_reactions({"arrive": ({}, {"Q": 1}), "serve": ({"Q": 1}, {})}, [arrivals, services], ("Q",))


def walk(up, down, n, begin):
    """A walk on 0, 1, ..., n that goes on beyond: one server, one customer a step, absorbed at 0."""
    rates = np.diag(np.full(n, up), 1) + np.diag(np.full(n, down), -1)
    rates[0] = 0.0
    return rates, begin, np.arange(n + 1) == n


def busy_period(arrivals, services, begin, time):
    """P(queue of `begin` is empty by a time): by the density with a modified Bessel function."""
    a, s = mpmath.mpf(arrivals), mpmath.mpf(services)

    def density(t):
        ratio = (s / a) ** (mpmath.mpf(begin) / 2)
        return begin / t * ratio * mpmath.exp(-(a + s) * t) * mpmath.besseli(begin, 2 * t * mpmath.sqrt(a * s))

    with mpmath.workdps(25):
        return float(mpmath.quad(density, mpmath.linspace(0, time, 5)))


@pytest.mark.parametrize(("up", "down"), [(1.0, 2.0), (2.0, 1.0)])
def test_busy_period(up, down):
    begin, time = 3, 4.0
    truth = busy_period(up, down, begin, time)
    for n, is_close in ((120, True), (6, False)):
        rates, first, edge = walk(up, down, n, begin)
        empty = np.arange(n + 1) == 0
        chain = Chain(rates, first, truncated=edge)
        answer = chain.until(empty, by=time)
        assert answer.low <= truth * (1 + 1e-14)
        assert truth * (1 - 1e-14) <= answer.high
        assert answer.is_bound
        assert bool(answer.high - answer.low < CLOSE) is is_close
        passage = chain.passage(empty)
        low, high = passage.cdf_bounds(time)
        assert low * (1 - 1e-13) <= truth <= high * (1 + 1e-13)
        assert bool(high - low < CLOSE) is is_close
        low, high = passage.survival_bounds(time)
        assert low <= 1 - truth <= high
        low, high = passage.quantile_bounds(truth)
        assert low <= time * (1 + 1e-12)
        assert time * (1 - 1e-12) <= high
        assert bool(high - low < CLOSE) is is_close
        stays = chain.always(~empty, by=time)
        assert stays.low <= 1 - truth <= stays.high
        # The control: where the lost mass is left out, the truth is outside of what a few states give.
        whole = Chain(chain.transitions.generator(), first).until(empty, by=time)
        assert bool(whole.low * (1 - 1e-12) <= truth <= whole.high * (1 + 1e-12)) is is_close


def test_times_and_chances_ever():
    """With a drift to 0 it is reached for sure, after begin / (down - up) in the mean."""
    rates, begin, edge = walk(1.0, 2.0, 120, 3)
    chain = Chain(rates, begin, truncated=edge)
    empty = np.arange(edge.size) == 0
    answer = chain.until(empty)
    assert 1.0 - CLOSE < answer.low < 1.0 <= answer.high
    passage = chain.passage(empty)
    assert 3.0 - CLOSE < passage.mean_bounds[0] <= 3.0
    assert passage.probability_bounds[0] > 1.0 - CLOSE
    assert chain.always(~empty).high < CLOSE
    earned = replace(chain, rewards={"time": np.ones(edge.size)}).reward("time", until=empty)
    assert earned.low <= 3.0 < earned.high == np.inf
    few = Chain(rates[:6, :6], begin, truncated=edge[-6:]).passage(empty[:6])
    assert few.mean_bounds[0] < 2.9  # the control: a lower limit, not the mean


@pytest.mark.parametrize("barrier", [10, 119])
def test_limits_are_on_both_sides_where_nothing_can_be_lost(barrier):
    """A run that stops before the edge of the chain: all is that of the whole chain, by the closed form of the ruin."""
    begin = 3
    rates, first, edge = walk(1.0, 2.0, 120, begin)
    places = np.arange(edge.size)
    ends = (places == 0) | (places == barrier)
    chain = Chain(rates, first, rewards={"time": np.ones(edge.size)}, truncated=edge)
    passage = chain.passage(ends)
    rich = mpmath.mpf(2**begin - 1) / (2**barrier - 1)
    mean = float(begin - barrier * rich)  # the drift is 1: Wald's identity
    low, high = passage.mean_bounds
    assert low * (1 - 1e-14) <= mean <= high * (1 + 1e-14)
    assert high - low < CLOSE
    assert passage.earliest is None
    assert passage.is_certain
    spread = passage.answer("sd")
    assert 0 < spread.low <= spread.value <= spread.high < spread.low + CLOSE
    total = chain.reward("time", until=ends)
    assert total.low * (1 - 1e-14) <= mean <= total.high * (1 + 1e-14)
    assert total.high < np.inf
    whole = Chain(chain.transitions.generator(), first).passage(ends)
    assert (passage.mean, passage.sd, passage.probability) == (whole.mean, whole.sd, whole.probability)
    # the control: with a way to the edge before the end, there is no upper limit
    for open_end in (places == 0, (places == 0) | edge & (places != 120)):
        lossy = chain.passage(open_end)
        assert lossy.earliest is not None
        assert lossy.mean_bounds[1] == np.inf
        assert chain.reward("time", until=open_end).high == np.inf
        assert lossy.answer("sd").kind != spread.kind


def test_a_start_that_never_comes_to_the_edge_has_a_steady_state():
    """Two parts that do not meet, of which one is truncated; from there, and from every state, it is refused."""
    rates = np.zeros((5, 5))
    rates[0, 1], rates[1, 0], rates[2, 3], rates[3, 4] = 2.0, 3.0, 1.0, 1.0
    edge = np.arange(5) == 4
    chain = Chain(rates, 0, truncated=edge)
    answer = chain.steady_state(np.arange(5) == 1)
    assert answer.low <= 0.4 <= answer.high
    assert answer.high - answer.low < CLOSE
    assert chain.transient([1.0]).probabilities[0, 1] == pytest.approx(0.4 * -np.expm1(-5.0))
    with pytest.raises(ValueError, match="needs the whole state space"):
        Chain(rates, 2, truncated=edge).steady_state(np.arange(5) == 1)
    with pytest.raises(ValueError, match="needs the whole state space"):
        Chain(rates, [0.5, 0.0, 0.5, 0.0, 0.0], truncated=edge).steady_state(np.arange(5) == 1)
    with pytest.raises(ValueError, match="a steady state needs the whole"):
        ask(chain, 'filter(max, S=? [ "init" ])')


def test_a_network_truncated_beyond_its_target_is_known_on_both_sides():
    """What --truncate leaves out lies behind the target: the answers are those of the finite chain."""
    network = Network.from_text("0 <-> A, 5, 1")
    known = Chain.of(network, {"A": 0}, stop="A == 8").passage("A == 8")
    cut = Chain.of(network, {"A": 0}, truncate="A <= 12").passage("A == 8")
    assert cut.earliest is None
    assert cut.mean == pytest.approx(known.mean, rel=1e-13)
    assert cut.mean_bounds[1] < np.inf
    assert str(cut).startswith("time until A == 8: mean ")


@pytest.mark.parametrize("begin", [1, 5])
def test_gamblers_ruin_with_a_drift_away(begin):
    """Ruin has the chance (1/2)**begin; where the run is lost it might still come, so that the upper limit is 1."""
    rates, first, edge = walk(2.0, 1.0, 150, begin)
    chain = Chain(rates, first, truncated=edge)
    ruined = np.arange(edge.size) == 0
    answer = chain.until(ruined)
    assert answer.low * (1 - 1e-15) <= 0.5**begin <= answer.high
    assert 0.5**begin - answer.low < CLOSE
    assert answer.high == pytest.approx(1.0)
    split = chain.committor({"ruin": ruined, "rich": np.arange(edge.size) == 60})
    low, high = split.probability_bounds("ruin")
    exact = (0.5**begin - 0.5**60) / (1 - 0.5**60)
    assert low <= exact <= high < low + CLOSE
    alone = chain.committor({"ruin": ruined})
    low, high = alone.probability_bounds("ruin")
    assert low <= 0.5**begin <= high
    assert alone.truncated_probability == pytest.approx(1 - 0.5**begin)
    assert alone.probability_bounds("ruin", 2)[0] == pytest.approx(0.25)


def sum_over_time(function, end):
    """Integral of a smooth function from 0, by Gauss's rule with 60 nodes."""
    nodes, weights = np.polynomial.legendre.leggauss(60)
    return float(weights @ function(0.5 * end * (nodes + 1.0))) * 0.5 * end


def test_immigration_and_death():
    """Poisson at every time: counts have a low limit, and what is bounded has both."""
    time, k, g = 1.5, 4.0, 0.5
    net = queue(k, g)
    mean = k / g * (1 - np.exp(-g * time))
    parts = (("Q <= 60", True), (60, True), (lambda states: states[:, 0] <= 60, True), ("Q < 9", False))
    for truncate, is_close in parts:
        chain = Chain.of(net, {"Q": 0}, truncate=truncate, rewards={"open": "Q"})
        many = Reward((np.asarray(chain.counts)[:, 0] >= 5).astype(float), most=1.0)
        chain = replace(chain, rewards={"many": many, "open": "Q"})
        answer = chain.reward("many", at=time)
        truth = float(poisson.sf(4, mean))
        assert answer.low * (1 - 1e-14) <= truth <= answer.high
        assert bool(answer.high - answer.low < CLOSE) is is_close
        total = chain.reward("many", up_to=time)
        exact = sum_over_time(lambda t: poisson.sf(4, k / g * (1 - np.exp(-g * t))), time)
        assert total.low * (1 - 1e-12) <= exact <= total.high * (1 + 1e-12)
        assert bool(total.high - total.low < CLOSE) is is_close
        counts = chain.reward("open", at=time)
        assert counts.low <= mean * (1 + 1e-13)
        assert bool(mean - counts.low < CLOSE) is is_close
        assert counts.high == np.inf
        unlimited = Chain(chain.transitions.generator(), 0, rewards={"many": many.rates}).reward("many", at=time)
        assert bool(unlimited.low <= truth * (1 + 1e-12) <= unlimited.high * (1 + 2e-12)) is is_close  # the control
        if is_close:
            assert len(chain) < 80


def test_a_target_at_the_edge_is_reached_and_not_lost():
    chain = Chain.of(queue(), {"Q": 2}, truncate="Q <= 4")
    assert len(chain) == 6
    assert "truncated in 1" in repr(chain)
    whole = Chain.of(queue(), {"Q": 2}, stop="Q >= 5")
    at_edge, without_end = chain.until("Q >= 5", by=1.0), whole.until("Q >= 5", by=1.0)
    assert at_edge.value == pytest.approx(without_end.value, rel=1e-14)
    assert at_edge.high - at_edge.low < 1e-12
    split = chain.committor({"empty": "Q == 0", "full": "Q == 5"})
    assert split.truncated_probability == 0.0


@pytest.mark.parametrize(
    ("question", "message"),
    [
        (lambda chain: chain.stationary(), "a steady state needs the whole state space"),
        (lambda chain: chain.steady_state("Q == 0"), "a steady state needs"),
        (lambda chain: chain.reward("Q", stationary=True), "a steady state needs"),
        (lambda chain: chain.transient([1.0]), "the distribution needs the whole state space"),
        (lambda chain: chain_path(chain, 1.0), "a run needs the whole state space"),
        (lambda _: Chain.of(queue(), {"Q": 9}, truncate="Q < 5"), "starts outside the states"),
        (lambda _: Chain.of(queue(), {"Q": 9}, truncate=0), "truncate = 0"),
        (lambda _: Chain.of(queue(), {"Q": 0}, truncate="Q < 500", max_states=100), "over 100 states"),
        (
            lambda chain: replace(chain, rewards={"r": Reward(np.ones(len(chain)), most=-1.0)}),
            "most of reward 'r' is -1",
        ),
    ],
)
def test_what_is_refused(question, message):
    with pytest.raises(ValueError, match=message):
        question(Chain.of(queue(), {"Q": 2}, truncate="Q <= 4"))


def test_a_run_that_left_may_come_back():
    """Nothing is earned in what is not listed, `most` = 0; but the queue comes back to where it is empty."""
    time, k, g = 20.0, 1.0, 2.0
    chain = Chain.of(queue(k, g), {"Q": 0}, truncate="Q <= 1")
    empty = Reward((np.asarray(chain.counts)[:, 0] == 0).astype(float), most=0.0)
    answer = replace(chain, rewards={"empty": empty}).reward("empty", at=time)
    assert answer.low <= np.exp(-k / g * (1 - np.exp(-g * time))) <= answer.high


def test_chances_too_small_for_numbers():
    """1e-464 by the gambler's ruin: no limit says 0, and one says 0 where there is no way at all."""
    n, up = 60, 1e-8
    rates = np.diag(np.full(n - 1, up), 1) + np.diag(np.full(n - 1, 1.0), -1)
    rates[[0, -1]] = 0.0
    for is_cut in (False, True):
        rates[30, 31] = 0.0 if is_cut else up
        chain, top = Chain(rates, 1), np.arange(n) == n - 1
        found = chain.committor({"top": top})
        limits = (
            chain.until(top),
            chain.steady_state(top),
            found.probability_bounds("top"),
            found.probability_bounds("top", 2),
            chain.passage(top).probability_bounds,
        )
        highs = [each[1] if isinstance(each, tuple) else each.high for each in limits]
        assert all(high == 0.0 if is_cut else 0.0 < high < 1e-280 for high in highs), highs
