"""Limits of derivatives that are called proven hold the derivative in a hundred digits, of random chains."""

import mpmath
import numpy as np
import pytest
from random_chains import DIGITS, random_rates

from kinetics.markov import Chain, Reward, Sensitivity

N = 5
STEP = mpmath.mpf(10) ** -25  # of a central difference in a hundred digits: right to fifty
TIMES = (1e-6, 0.3, 4.0, 50.0)


def groups(seed, rates):
    """Every rate belongs to one of three parameters; one of them counts twice for some."""
    rng = np.random.default_rng(1000 + seed)
    which = rng.integers(0, 3, rates.shape)
    doubled = np.where(which == 2, 2.0, 1.0) * (rates > 0)
    return {name: doubled * (which == k) for k, name in enumerate("abc")}


def exact(rates, shares, answer):
    """d answer / d ln(parameter) in a hundred digits: `answer` takes rates as mpmath numbers."""
    with mpmath.workdps(DIGITS):
        ends = []
        for step in (STEP, -STEP):
            moved = mpmath.zeros(len(rates))
            for i, j in zip(*np.nonzero(rates), strict=True):
                moved[i, j] = mpmath.mpf(float(rates[i, j])) * mpmath.exp(step * mpmath.mpf(float(shares[i, j])))
            ends.append(answer(moved))
        return (ends[0] - ends[1]) / (2 * STEP)


def generator(moved, stopped=()):
    q = moved.copy()
    for i in range(moved.rows):
        for j in range(moved.rows):
            q[i, j] = mpmath.mpf(0) if i in stopped else q[i, j]
        q[i, i] = -sum(q[i, j] for j in range(moved.rows) if j != i)
    return q


def row(start):
    return mpmath.matrix([[mpmath.mpf(float(p)) for p in start]])


def check(found, rates, shares, answer):
    """All limits hold; those of a derivative that is wrong by four times their width do not."""
    assert found.is_bound
    for p, name in enumerate(found.parameters):
        true = exact(rates, shares[name], answer)
        low, high = found.low[p], found.high[p]
        with mpmath.workdps(DIGITS):
            assert mpmath.mpf(low) <= true <= mpmath.mpf(high), (name, float(true), low, high)
            wrong = true + 4 * mpmath.mpf(high - low) + mpmath.mpf(10) ** -300
            assert not mpmath.mpf(low) <= wrong <= mpmath.mpf(high)  # the control
            assert low <= found.value[p] <= high
    assert (found.high - found.low).max() <= 1e-8 * np.abs(found.value).max()
    with mpmath.workdps(DIGITS):
        value = answer(mpmath.matrix([[mpmath.mpf(float(x)) for x in each] for each in rates]))
        assert mpmath.mpf(found.answer.low) <= value <= mpmath.mpf(found.answer.high)


def started(seed):
    start = np.zeros(N)
    start[:3] = np.random.default_rng(seed).dirichlet(np.ones(3))
    return start


@pytest.mark.parametrize("seed", range(8))
def test_until_by_a_time(seed):
    rates, t = random_rates(100 + seed, N, decades=1.5), TIMES[seed % 4]
    shares = groups(seed, rates)
    chain = Chain(rates, started(seed))
    target, avoided = np.arange(N) == 4, np.arange(N) == 3

    def probability(moved):
        return (row(chain.initial) * mpmath.expm(generator(moved, (3, 4)) * mpmath.mpf(t)))[4]

    check(Sensitivity(chain, shares).until(target, ~avoided, by=t), rates, shares, probability)


@pytest.mark.parametrize("seed", range(4))
def test_rewards_over_time(seed):
    rates, t = random_rates(200 + seed, N, decades=1.0), TIMES[seed]
    shares = groups(seed, rates)
    earning = np.array([0.0, 1e-9, 2.0, 1e3, 1.0])
    impulses = np.random.default_rng(seed).random((N, N)) * (rates > 0)
    plain, jumping = Reward(earning), Reward(earning, impulses)
    chain = Chain(rates, started(seed), rewards={"plain": plain, "jumping": jumping})
    asked = Sensitivity(chain, shares)

    def at(moved):
        law = row(chain.initial) * mpmath.expm(generator(moved) * mpmath.mpf(t))
        return sum(p * mpmath.mpf(float(e)) for p, e in zip(law, earning, strict=True))

    def total(moved):
        q = mpmath.zeros(N + 1)
        inner = generator(moved)
        for i in range(N):
            for j in range(N):
                q[i, j] = inner[i, j]
            q[i, N] = mpmath.mpf(float(earning[i]))
            q[i, N] += sum(moved[i, j] * mpmath.mpf(float(impulses[i, j])) for j in range(N))
        return (row([*chain.initial, 0.0]) * mpmath.expm(q * mpmath.mpf(t)))[N]

    check(asked.reward("plain", at=t), rates, shares, at)
    check(asked.reward("jumping", up_to=t), rates, shares, total)


@pytest.mark.parametrize("seed", range(6))
def test_ever_and_until(seed):
    rates = random_rates(300 + seed, N, decades=1.5)
    shares = groups(seed, rates)
    earning = np.array([1.0, 1e-9, 2.0, 1e3, 1.0])
    impulses = np.random.default_rng(seed).random((N, N)) * (rates > 0)
    chain = Chain(rates, started(seed), rewards={"r": Reward(earning, impulses)})
    asked = Sensitivity(chain, shares)
    target, avoided = np.arange(N) == 4, np.arange(N) == 3

    def solved(moved, inside, weights):
        q = generator(moved)
        part = mpmath.matrix(len(inside), len(inside))
        for a, i in enumerate(inside):
            for b, j in enumerate(inside):
                part[a, b] = -q[i, j]
        x = mpmath.lu_solve(part, mpmath.matrix([weights(i) for i in inside]))
        return sum(mpmath.mpf(float(chain.initial[i])) * x[a] for a, i in enumerate(inside))

    def ever(moved):
        return solved(moved, (0, 1, 2), lambda i: moved[i, 4])

    def earned(moved):
        def worth(i):
            jumps = sum(moved[i, j] * mpmath.mpf(float(impulses[i, j])) for j in range(N))
            return mpmath.mpf(float(earning[i])) + jumps

        return solved(moved, (0, 1, 2, 3), worth)

    def mean(moved):
        return solved(moved, (0, 1, 2, 3), lambda i: mpmath.mpf(1))

    check(asked.until(target, ~avoided), rates, shares, ever)
    check(asked.reward("r", until=target), rates, shares, earned)
    check(asked.passage(target), rates, shares, mean)


@pytest.mark.parametrize("seed", range(4))
def test_in_the_end(seed):
    """Of one class; and of two closed classes, where the chain ends up in either."""
    rates = random_rates(400 + seed, 6, decades=1.5)
    if seed % 2:
        rates[2:4, :2] = rates[2:4, 4:] = rates[4:, :4] = 0.0
        rates[2, 3] = rates[3, 2] = rates[4, 5] = rates[5, 4] = 0.3
        rates[0, 4] = 0.7
    shares = groups(seed, rates)
    earning = np.array([1.0, 1e-9, 2.0, 0.3, 1.0, 5.0])
    impulses = np.random.default_rng(seed).random((6, 6)) * (rates > 0)
    chain = Chain(rates, 0, rewards={"r": Reward(earning, impulses)})

    def in_the_end(moved):
        """By powers of the resolvent: lambda (lambda - Q)^-1 with a tiny lambda, twice extrapolated."""
        q, found = generator(moved), []
        worth = [
            mpmath.mpf(float(earning[i])) + sum(moved[i, j] * mpmath.mpf(float(impulses[i, j])) for j in range(6))
            for i in range(6)
        ]
        for small in (mpmath.mpf(10) ** -35, 2 * mpmath.mpf(10) ** -35):
            x = mpmath.lu_solve(small * mpmath.eye(6) - q, mpmath.matrix(worth))
            found.append(small * x[0])
        return 2 * found[0] - found[1]

    check(Sensitivity(chain, shares).reward("r", stationary=True), rates, shares, in_the_end)


def test_a_tiny_probability_keeps_its_digits():
    """A birth chain of 14 steps at 1e-3 until .1, about 1e-67: its derivative by births is 14 times as large."""
    steps, rate, t = 14, 1e-3, 0.1
    rates = np.diag(np.full(steps, rate), 1) + np.diag(np.full(steps, 1.0), -1)
    chain = Chain(rates, 0)
    shares = {"births": np.triu(rates > 0, 1), "deaths": np.tril(rates > 0, -1)}
    found = Sensitivity(chain, shares).until(np.arange(steps + 1) == steps, by=t)
    for p, name in enumerate(found.parameters):

        def probability(moved):
            return (row(chain.initial) * mpmath.expm(generator(moved, (steps,)) * mpmath.mpf(t)))[steps]

        true = exact(rates, shares[name], probability)
        assert found.low[p] <= true <= found.high[p]
        assert found.high[p] - found.low[p] < 1e-10 * abs(found.value[p])
    assert 0 < found.answer.value < 1e-60
    assert found.elasticity[0] == pytest.approx(14.0, rel=1e-3)
    # the control: a difference of the pass forwards knows nothing of it
    assert chain.transient([t]).error > found.value[0]
