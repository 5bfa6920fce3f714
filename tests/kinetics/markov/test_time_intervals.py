"""Questions about an interval of time: closed forms, an oracle of dense exponentials, truncation and derivatives."""

from math import exp

import numpy as np
import pytest
from scipy.linalg import expm

from kinetics import Chain, Network, Sensitivity
from kinetics.markov import ask

ROUNDED = 1e-13  # of the oracle


def covers(answer, truth, slack=2e-15):
    return answer.is_bound and answer.low - slack <= truth <= answer.high + slack


def test_closed_forms():
    decay = Chain.of(Network.from_text("A -> 0, 0.7"), {"A": 1})
    assert covers(ask(decay, "P=? [ F[2,5] A = 0 ]"), 1 - exp(-3.5))
    assert covers(ask(decay, "P=? [ A = 1 U[2,5] A = 0 ]"), exp(-1.4) - exp(-3.5))
    assert covers(ask(decay, "P=? [ G[2,5] A = 1 ]"), exp(-3.5))
    assert covers(ask(decay, "P=? [ F[2,2] A = 1 ]"), exp(-1.4))
    two = Chain.of(Network.from_text("A <-> B, 0.3, 0.5"), {"A": 1})
    there = 0.375 * (1 - exp(-0.8 * 2))
    truth = there + (1 - there) * (1 - exp(-0.3 * 3))
    found = ask(two, "P=? [ F[2,5] B = 1 ]")
    assert covers(found, truth)
    assert found.high - found.low < 1e-12
    assert covers(ask(two, "P=? [ G[2,5] A = 1 ]"), 1 - truth)
    assert not covers(ask(two, "P=? [ F[2.001,5] B = 1 ]"), truth)  # the control


def test_from_0_on_it_is_the_upper_bound():
    chain = Chain.of(Network.from_text("A + B <-> C, 0.1, 0.2"), {"A": 8, "B": 6})
    for text in ("F{} C >= 4", "A >= 3 U{} C >= 4", "G{} C <= 4"):
        from_0, by = (ask(chain, f"P=? [ {text.format(bound)} ]") for bound in ("[0,1.5]", "<=1.5"))
        assert (from_0.value, from_0.low, from_0.high) == (by.value, by.low, by.high)
        assert ask(chain, f"P=? [ {text.format('[1e-9,1.5]')} ]").value == pytest.approx(by.value, abs=1e-6)


def random_chain(rng, n=6):
    rates = rng.exponential(1.0, (n, n)) * (rng.random((n, n)) < 0.5)
    np.fill_diagonal(rates, 0.0)
    return rates, rng.dirichlet(np.ones(n)), rng.random(n) < 0.4, rng.random(n) < 0.8


def by_exponentials(rates, start, goal, ways, a, b):
    """The probability of an until in [a, b], phase by phase."""

    def stopped(stops):
        kept = np.where(stops[:, None], 0.0, rates)
        return kept - np.diag(kept.sum(axis=1))

    return start @ expm(a * stopped(~ways)) @ (ways * (expm((b - a) * stopped(goal | ~ways)) @ goal))


@pytest.mark.parametrize("seed", range(8))
def test_dense_exponentials_agree(seed):
    rng = np.random.default_rng(seed)
    rates, start, goal, ways = random_chain(rng)
    a, b = np.sort(rng.uniform(0.05, 3.0, 2))
    chain, every = Chain(rates, start), np.ones_like(ways)
    through = chain.until(goal, ways, b, after=a)
    truth = by_exponentials(rates, start, goal, ways, a, b)
    assert covers(through, truth, ROUNDED)
    assert covers(chain.until(goal, by=b, after=a), by_exponentials(rates, start, goal, every, a, b), ROUNDED)
    stays = chain.always(~goal, b, after=a)
    assert covers(stays, 1 - by_exponentials(rates, start, goal, every, a, b), ROUNDED)
    if 0 < truth < 1:
        assert not covers(through, truth + 3e-12)  # the control


@pytest.mark.parametrize("seed", range(4))
def test_derivatives_are_those_of_the_oracle(seed):
    rng = np.random.default_rng(seed)
    rates, start, goal, ways = random_chain(rng)
    mask, (a, b), step = rng.random(rates.shape) < 0.5, np.sort(rng.uniform(0.05, 3.0, 2)), 1e-3
    asked = Sensitivity(Chain(rates, start), {"k": mask & (rates > 0)})
    for found, sign, through in (
        (asked.until(goal, ways, b, a), 1, ways),
        (asked.always(~goal, b, a), -1, np.ones_like(ways)),
    ):
        terms = [
            weight * by_exponentials(rates * np.exp(mask * shift * step), start, goal, through, a, b)
            for weight, shift in ((1, -2), (-8, -1), (8, 1), (-1, 2))
        ]
        assert found.is_bound
        assert found.value[0] == pytest.approx(sign * sum(terms) / (12 * step), abs=1e-9)
        assert 0 < found.high[0] - found.low[0] < 1e-10


def test_derivatives_have_bounds_that_hold():
    network = Network.from_text("A -> 0, 0.7\nB -> 0, 1")  # the second never fires
    found = Sensitivity(Chain.of(network, {"A": 1})).until("A == 0", "A == 1", 5.0, 2.0)
    assert -1e-15 < found.low[1] <= found.value[1] == 0.0 <= found.high[1] < 1e-15
    truth = 3.5 * exp(-3.5) - 1.4 * exp(-1.4)
    assert found.low[0] <= truth <= found.high[0]
    assert found.high[0] - found.low[0] < 1e-11
    assert not found.low[0] <= truth + 2e-11 <= found.high[0]  # the control


def test_the_bounds_of_a_truncated_chain_hold_whatever_happens_outside():
    network = Network.from_text("0 <-> A, 2, 0.5")
    whole = Chain.of(network, {"A": 0}, truncate="A < 60")
    for text in ("F[1,3] A = 5", "A < 6 U[1,3] A = 5", "G[1,3] A >= 2", "F[1,3] A >= 9"):
        truth = ask(whole, f"P=? [ {text} ]")
        assert truth.high - truth.low < 1e-9
        for most in (8, 10):
            found = ask(Chain.of(network, {"A": 0}, truncate=f"A < {most}"), f"P=? [ {text} ]")
            assert found.low <= truth.high
            assert truth.low <= found.high
            assert found.is_bound


def test_what_has_no_answer():
    chain = Chain.of(Network.from_text("A -> 0, 0.7"), {"A": 1})
    with pytest.raises(ValueError, match="needs a time by which"):
        chain.until("A == 0", by=1.0, after=2.0)
