"""Derivatives of stiff chains: by squaring, against a hundred digits; and by many steps, whose bound grows slowly."""

import mpmath
import numpy as np
import pytest
from known_systems import network
from numpy.testing import assert_allclose
from random_chains import DIGITS, exact_generator

from kinetics.markov import Chain, Sensitivity

STIFF = np.array([[0.0, 1e5, 0.0], [2e5, 0.0, 1e-3], [0.0, 1e-7, 0.0]])  # a fast pair, and a slow way in and out
NAMES = {"fast": (0, 1), "back": (1, 0), "in": (1, 2), "out": (2, 1)}


def masks(rates):
    found = {}
    for name, place in NAMES.items():
        found[name] = np.zeros(rates.shape)
        found[name][place] = 1.0
    return found


def true_derivatives(rates, start, values, time):
    """By the exponential of [[Q, dQ], [0, Q]] in a hundred digits, which holds the derivative of exp(Q t)."""
    n, found = len(rates), []
    with mpmath.workdps(DIGITS):
        q = exact_generator(rates)
        for i, j in NAMES.values():
            block = mpmath.zeros(2 * n)
            for a in range(n):
                for b in range(n):
                    block[a, b] = block[n + a, n + b] = q[a, b]
            block[i, n + j] += mpmath.mpf(float(rates[i, j]))
            block[i, n + i] -= mpmath.mpf(float(rates[i, j]))
            power = mpmath.expm(block * mpmath.mpf(time))
            cells = [
                mpmath.mpf(float(start[a])) * power[a, n + b] * mpmath.mpf(float(values[b]))
                for a in range(n)
                for b in range(n)
            ]
            found.append(mpmath.fsum(cells))
    return found


@pytest.mark.parametrize("time", [3.0, 2e3, 5e6])
def test_a_stiff_chain_is_squared(time):
    """Rate times time from 6e5 to 1e12: what fast rates bring is up to 1e12 times as small as what it is made of."""
    values = np.array([0.0, 0.0, 1.0])
    chain = Chain(STIFF, 0, rewards={"r": values})
    found = Sensitivity(chain, masks(STIFF)).reward("r", at=time)
    assert "squaring" in found.method
    assert found.is_bound
    for low, each, high in zip(
        found.low, true_derivatives(STIFF, chain.initial, values, time), found.high, strict=True
    ):
        assert low <= each <= high
        assert not low <= each + 4 * (high - low) <= high  # the control
    assert (found.high - found.low).max() < 1e-10 * np.abs(found.value).max()


def test_a_stiff_network_with_a_target():
    """One copy of A <-> B, and B -> C: the same chain as a network and as a matrix, stopped at C."""
    reactions = {"fast": ((1, 0, 0), (0, 1, 0)), "back": ((0, 1, 0), (1, 0, 0)), "in": ((0, 1, 0), (0, 0, 1))}
    model = network(("A", "B", "C"), reactions, [1e5, 2e5, 1e-3])
    rates = np.where(STIFF == 1e-7, 0.0, STIFF)
    given = {name: mask for name, mask in masks(rates).items() if name != "out"}
    found = Sensitivity(Chain.of(model, {"A": 1})).until("C == 1", by=2e3)
    other = Sensitivity(Chain(rates, 0), given).until([False, False, True], by=2e3)
    assert found.is_bound
    assert found.parameters == other.parameters
    assert_allclose(found.value, other.value, rtol=1e-12)
    # all rates twice as fast are half the time: their elasticities add up to that of the time, k t / (exp(k t) - 1)
    slow = 1e-3 / 3 * 2e3
    assert found.elasticity.sum() == pytest.approx(slow / np.expm1(slow), rel=1e-6)


def test_the_bound_of_many_steps_grows_with_the_root_of_the_firings():
    """6,700 firings of each fast rate, each as uncertain as the answer; the bound is far below their sum."""
    rates, time = STIFF * [[1e-4], [1e-4], [1e2]], 1e3
    values = np.array([0.0, 1.0, 0.0])
    chain = Chain(rates, 0, rewards={"r": values})
    found = Sensitivity(chain, masks(rates)).reward("r", at=time)
    true = true_derivatives(rates, chain.initial, values, time)
    assert found.is_bound
    for low, each, high in zip(found.low, true, found.high, strict=True):
        assert low <= each <= high
        assert not low <= each + 4 * (high - low) <= high  # the control
    wide, answer = (found.high - found.low) / 2, found.answer
    assert wide[0] < 0.1 * 6.7e3 * (answer.high - answer.low) / 2
