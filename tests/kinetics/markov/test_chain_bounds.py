"""Limits that are called proven hold the value in a hundred digits, however small it is."""

import mpmath
import numpy as np
import pytest
from random_chains import DIGITS, exact_law, random_rates

from kinetics import Chain, Network, Reward, Sensitivity
from kinetics.markov.passage.backward import BackwardPass, expected_at, expected_integral
from kinetics.native import twins


def holds(answer, exact):
    with mpmath.workdps(DIGITS):
        return mpmath.mpf(answer.low) <= exact <= mpmath.mpf(answer.high)


@pytest.mark.parametrize("seed", range(8))
def test_until_by_a_time(seed):
    n, t = 5, [1e-6, 0.3, 4.0, 50.0][seed % 4]
    rates = random_rates(100 + seed, n, decades=1.5)
    start = np.random.default_rng(seed).dirichlet(np.ones(n))
    start[3:] = 0.0
    start[0] += 1.0 - start.sum()
    chain = Chain(rates, start)
    target, avoided = np.arange(n) == 4, np.arange(n) == 3
    answer = chain.until(target, ~avoided, by=t)
    exact = exact_law(rates, chain.initial, t, stopped=(3, 4))
    assert answer.is_bound
    assert holds(answer, exact[4])
    assert answer.high - answer.low < 1e-9 * answer.value
    moved = answer.value * (1 + 4 * (answer.high - answer.low) / answer.value)  # the control
    assert not answer.low <= moved <= answer.high
    survival = chain.always(~(target | avoided), by=t)
    assert holds(survival, sum(exact[:3]))


def test_tiny_probabilities_have_digits():
    """A birth chain of 14 steps at 1e-3 until .1: about 1e-67."""
    steps, rate, t = 14, 1e-3, 0.1
    chain = Chain(np.diag(np.full(steps, rate), 1) + np.diag(np.full(steps, 1.0), -1), 0)
    answer = chain.until(np.arange(steps + 1) == steps, by=t)
    exact = exact_law(chain.transitions.generator().toarray(), chain.initial, t, stopped=(steps,))[steps]
    assert 0 < answer.value < 1e-60
    assert holds(answer, exact)
    assert answer.high - answer.low < 1e-11 * answer.value
    forwards = chain.transient([t])
    assert forwards.error > answer.value  # the control: a bound on the sum of all errors says nothing here


def test_rewards_over_time():
    rates = random_rates(7, 4)
    start = np.array([0.5, 0.25, 0.25, 0.0])
    earned = np.array([0.0, 1e-9, 2.0, 1e6])
    chain = Chain(rates, start, rewards={"r": earned})
    with mpmath.workdps(DIGITS):
        t = mpmath.mpf(1.5)
        at = sum(p * mpmath.mpf(float(r)) for p, r in zip(exact_law(rates, start, 1.5), earned, strict=True))
        # the integral by an eighth state vector: d/dt of what was earned
        q = mpmath.zeros(5)
        for i in range(4):
            for j in range(4):
                q[i, j] = mpmath.mpf(float(rates[i, j])) if i != j else mpmath.mpf(0)
            q[i, i] = -sum(q[i, j] for j in range(4) if j != i)
            q[i, 4] = mpmath.mpf(float(earned[i]))
        total = (mpmath.matrix([[*map(float, start), 0.0]]) * mpmath.expm(q * t))[4]
    assert holds(chain.reward("r", at=1.5), at)
    assert holds(chain.reward("r", up_to=1.5), total)
    assert not holds(chain.reward("r", up_to=1.5 * (1 + 1e-9)), total)  # the control


@pytest.mark.parametrize("steps", [1, 40])
def test_a_pass_ends_where_the_rest_is_less_than_it_rounds(steps, monkeypatch):
    """A line of steps at rate 1 until .01, whose end is reached with probability 1e-2 or about 1e-128."""

    done, retreat = [], twins.retreat
    monkeypatch.setattr(twins, "retreat", lambda *arrays: (done.append(arrays[-1].size), retreat(*arrays)))
    rates, t = np.diag(np.ones(steps), 1), 0.01
    chain = Chain(rates, 0, rewards={"late": np.arange(steps + 1) == steps})
    with mpmath.workdps(DIGITS):
        exact = mpmath.gammainc(steps, 0, t, regularized=True)
        area = t * exact - steps * mpmath.gammainc(steps + 1, 0, t, regularized=True)
    for answer, value in ((chain.until(np.arange(steps + 1) == steps, by=t), exact), (chain.reward(up_to=t), area)):
        assert holds(answer, value)
        assert answer.high - answer.low < 1e-12 * answer.value
    assert sum(done) < steps + 100


def test_states_that_do_not_matter_make_no_steps():
    """Beyond the target, and where no way leads to it, rates of 1e9 cost nothing."""
    rates = np.zeros((6, 6))
    rates[0, 1], rates[0, 4], rates[1, 0], rates[1, 2] = 1.0, 0.5, 2.0, 0.25
    rates[2, 3] = rates[3, 2] = rates[4, 5] = rates[5, 4] = 1e9
    chain, target = Chain(rates, 0), np.arange(6) == 2
    answer = chain.until(target, by=2.0)
    assert answer.method == "uniformisation, backwards"
    assert holds(answer, exact_law(rates, chain.initial, 2.0, stopped=(2, 4))[2])
    assert not holds(answer, exact_law(rates * 1.0001, chain.initial, 2.0, stopped=(2, 4))[2])  # the control


def test_a_settled_chain_stops_early_and_still_holds():
    rates = np.array([[0, 5.0, 0], [3.0, 0, 1e-7], [0, 0, 0]])
    chain = Chain(rates, 0)
    answer = chain.until([False, False, True], by=3e3)
    assert holds(answer, exact_law(rates, chain.initial, 3e3, stopped=(2,))[2])
    assert answer.high - answer.low < 1e-9 * answer.value


def test_a_pass_goes_on_where_it_stopped(monkeypatch):
    """One pass for many times, in any order, gives what a pass a time gives, in the steps of the longest."""

    done, retreat = [], twins.retreat
    rates = random_rates(3, 5, decades=1.0)
    chain = Chain(rates, 0)
    stopped, target = chain.transitions.stopped(np.arange(5) == 4), (np.arange(5) == 4).astype(float)
    times = [0.3, 1e-3, 20.0, 0.0, 5.0]
    each = [expected_at(stopped, chain.initial, target, t) for t in times]
    monkeypatch.setattr(twins, "retreat", lambda *arrays: (done.append(arrays[-1].size), retreat(*arrays)))
    one = BackwardPass(stopped, chain.initial, target)
    assert [one.at(t) for t in times] == each
    steps = sum(done)
    assert [one.integral(t) for t in times] == [expected_integral(stopped, chain.initial, target, t) for t in times]
    del done[:]
    expected_at(stopped, chain.initial, target, 20.0)
    assert steps == sum(done)


def test_rewards_as_text_bring_their_rounding():
    """1 / 3 and 0.1 * A are no doubles; their rounding is within the limits, and whole numbers have none."""
    death = Network.from_reactions({"death": ({"A": 1}, {})}, [1.0])
    chain = Chain.of(death, {"A": 7}, rewards={"third": "A / 3", "tenth": "0.1 * A", "whole": "2 * A + 1"})
    for name, share in (("third", mpmath.mpf(1) / 3), ("tenth", mpmath.mpf(0.1))):
        answer = chain.reward(name, up_to=1.5)
        with mpmath.workdps(DIGITS):
            assert holds(answer, 7 * share * (1 - mpmath.e ** mpmath.mpf(-1.5)))
        assert answer.is_bound
        assert 0 < chain.rewards[name].error < 1e-15
        assert not Sensitivity(chain).reward(name, at=1.0).is_bound
    assert chain.rewards["whole"].error == 0.0
    assert Sensitivity(chain).reward("whole", at=1.0).is_bound
    given, error = chain.reward("third", at=1.0), chain.rewards["third"].error
    unrounded = Chain.of(death, {"A": 7}, rewards={"third": Reward(np.asarray(chain.rewards["third"].rates))})
    exact = unrounded.reward("third", at=1.0)
    assert given.high >= exact.high * (1 + error) > exact.high  # the control: without the rounding they are narrower


@pytest.mark.parametrize("text", ["(A + 1e16) - 1e16", "1 - exp(-A / 1e18)", "sqrt(A + 1e30) - 1e15"])
def test_formulas_that_lose_their_digits_are_refused(text):
    death = Network.from_reactions({"death": ({"A": 1}, {})}, [1.0])
    with pytest.raises(ValueError, match="loses its digits in state"):
        Chain.of(death, {"A": 1}, rewards={"r": text})
    chain = Chain.of(death, {"A": 1})
    with pytest.raises(ValueError, match="loses its digits in state"):
        chain.until(f"{text} > 0")
