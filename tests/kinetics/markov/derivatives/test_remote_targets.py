"""Derivatives for targets before which rates fire up to 1e19 times: digits, and limits relative to the answer."""

from fractions import Fraction

import numpy as np
import pytest
from exact_fractions import exact_moments, solved

from kinetics.markov import Chain, Reward, Sensitivity
from kinetics.markov.derivatives import eventually


def uphill(steps):
    """A walk to the right at 1 and back at 10, which ends at the last place."""
    rates = np.diag(np.full(steps, 1.0), 1) + np.diag(np.full(steps, 10.0), -1)
    rates[-1] = 0.0
    return rates


@pytest.mark.parametrize(("steps", "begin"), [(10, 3), (15, 0), (20, 0), (20, 19)])
def test_mean_times(steps, begin, monkeypatch):
    rates = uphill(steps)
    shares = {"up": np.triu(rates) > 0, "down": np.tril(rates) > 0}
    target, asked = np.arange(steps + 1) == steps, Sensitivity(Chain(rates, begin), shares)
    found = asked.passage(target)
    assert found.is_bound
    start = np.eye(1, steps + 1, begin)[0]
    for p, share in enumerate(shares.values()):
        _, (true,) = exact_moments(rates, share, start, 1)
        low, high = Fraction(found.low[p]), Fraction(found.high[p])
        assert low <= true <= high
        assert not low <= true + 4 * (high - low) <= high  # the control
    assert (found.high - found.low).max() < 1e-10 * found.answer.value
    # the control: as differences, digits are lost
    monkeypatch.setattr(eventually, "LOOSE", np.inf)
    plain = asked.passage(target)
    assert (plain.high - plain.low).max() > (1e3 if steps == 20 else 1.0) * (found.high - found.low).max()


def test_rewards_with_impulses():
    """All that is earned at jumps upwards: their number, which is that of jumps back and the steps to go."""
    steps, rates = 15, uphill(15)
    shares = {"up": np.triu(rates) > 0, "down": np.tril(rates) > 0}
    chain = Chain(
        rates, 0, rewards={"ups": Reward(impulses=np.triu(rates)), "downs": Reward(impulses=np.tril(rates) / 10)}
    )
    target, asked = np.arange(steps + 1) == steps, Sensitivity(chain, shares)
    ups, downs = (asked.reward(name, until=target) for name in ("ups", "downs"))
    assert ups.answer.value == pytest.approx(downs.answer.value + steps, rel=1e-14)
    for low, high, other in zip(ups.low, ups.high, downs.value, strict=True):
        assert high - low < 1e-9 * ups.answer.value
        assert low <= other <= high
    # numbers of jumps do not change with the unit of time
    assert ups.elasticity.sum() == pytest.approx(0.0, abs=1e-10)
    assert ups.elasticity[0] < -10.0


def test_a_probability_between_two_remote_ends():
    """From a well of which both sides are steep, 12 steps at 1 against 10 to the right, and to the left at 1.5."""
    steps = 12
    n = 2 * steps + 1
    rates = np.zeros((n, n))
    for i in range(1, n - 1):
        inwards, outwards = (i - 1, i + 1) if i > steps else (i + 1, i - 1)
        rates[i, outwards], rates[i, inwards] = (1.0 if i > steps else 1.5), 10.0
    rates[steps, steps + 1], rates[steps, steps - 1] = 1.0, 1.5
    side = np.arange(n)[:, None] < steps
    shares = {"left": (rates > 0) & side, "right": (rates > 0) & ~side}
    found = Sensitivity(Chain(rates, steps), shares).until(np.arange(n) == n - 1)
    given = [[Fraction(float(x)) for x in row] for row in rates]
    inside = range(1, n - 1)

    def leaving(table):
        return [[sum(table[i]) if i == j else -table[i][j] for j in inside] for i in inside]

    chances = solved(leaving(given), [given[i][n - 1] for i in inside])
    value = chances[steps - 1]
    assert Fraction(found.answer.low) <= value <= Fraction(found.answer.high)
    for p, share in enumerate(shares.values()):
        moved = [[x * int(y) for x, y in zip(*rows, strict=True)] for rows in zip(given, share, strict=True)]
        right = [
            moved[i][n - 1] - sum(a * b for a, b in zip(row, chances, strict=True))
            for i, row in zip(inside, leaving(moved), strict=True)
        ]
        true, low, high = solved(leaving(given), right)[steps - 1], Fraction(found.low[p]), Fraction(found.high[p])
        assert low <= true <= high
        assert not low <= true + 4 * (high - low) <= high  # the control
    assert (found.high - found.low).max() < 1e-10 * found.answer.value
