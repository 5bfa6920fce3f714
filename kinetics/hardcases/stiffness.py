"""Rates many decades apart: probabilities and stationary laws."""

from __future__ import annotations

from collections.abc import Iterator
from decimal import Decimal, localcontext
from fractions import Fraction
from functools import partial
from math import comb, factorial

import numpy as np

from kinetics.arrays import Floats
from kinetics.hardcases.case import Attempt, Case, attempt, network, refusal, relative, walk
from kinetics.methods import Dense, FiniteStateProjection, Transient
from kinetics.methods.stationary import stationary
from kinetics.network import Network

DIGITS = 1e-13


def _leak() -> Iterator[Attempt]:
    for fast in (1e6, 1e10, 1e15):
        pair = {"ab": ({"A": 1}, {"B": 1}, fast), "ba": ({"B": 1}, {"A": 1}, fast), "leak": ({"B": 1}, {"C": 1}, 1e-3)}
        net = network(pair)
        exact = leak_exact(fast, 1e-3, 1.0)
        for method in (Dense(), Transient()):
            yield attempt(f"{method.name}, q t = {fast:g}", partial(_leak_error, method, net, exact), DIGITS)


def _leak_error(method: Dense | Transient, net: Network, exact: Floats) -> float:
    law = method.solve(net, [1, 0, 0], [1.0])
    return relative([law.probability(state)[0] for state in np.eye(3, dtype=int)], exact)


def leak_exact(fast: float, slow: float, time: float) -> Floats:
    """Probabilities of A <-> B -> C from A, by the two roots in 60 digits."""
    with localcontext() as context:
        context.prec = 60
        q, k, t = Decimal(fast), Decimal(slow), Decimal(time)
        root = (4 * q * q + k * k).sqrt()
        slower, faster = -2 * q * k / (2 * q + k + root), -(2 * q + k + root) / 2
        weight = q / (slower - faster)
        b = weight * ((slower * t).exp() - (faster * t).exp())
        change = weight * (slower * (slower * t).exp() - faster * (faster * t).exp())
        a = (change + (q + k) * b) / q
        return np.array([float(a), float(b), float(1 - a - b)])


def _decomposable() -> Iterator[Attempt]:
    for coupling in (1e-16, 1e-300):
        net = network(
            {
                "ab": ({"A": 1}, {"B": 1}, 1.0),
                "ba": ({"B": 1}, {"A": 1}, 2.0),
                "ac": ({"A": 1}, {"C": 1}, coupling),
                "ca": ({"C": 1}, {"A": 1}, 3 * coupling),
                "cd": ({"C": 1}, {"D": 1}, 5.0),
                "dc": ({"D": 1}, {"C": 1}, 7.0),
            }
        )
        shares = np.array([1, 1 / 2, 1 / 3, 5 / 21])
        yield attempt(f"stationary, coupling {coupling:g}", partial(_resting_error, net, shares / shares.sum()), 1e-14)


def _resting_error(net: Network, exact: Floats) -> float:
    return relative(stationary(net, [1, 0, 0, 0]).mean(), exact)


def _poisson_tails() -> Iterator[Attempt]:
    net, time, n = walk(50, 1.0, 0.0), 0.01, 48

    def off() -> float:
        law = Dense().solve(net, np.eye(1, 51, dtype=int)[0], [time])
        found = [law.probability(np.eye(1, 51, k, dtype=int)[0])[0] for k in range(n)]
        return relative(found, [np.exp(-time) * time**k / factorial(k) for k in range(n)])

    yield attempt(f"dense, down to {time**n / factorial(n):.0e}", off, DIGITS)


def _decades() -> Iterator[Attempt]:
    net = network(
        {
            "xy": ({"X": 1}, {"Y": 1}, 1e6),
            "yx": ({"Y": 1}, {"X": 1}, 2e6),
            "uv": ({"U": 1}, {"V": 1}, 1e-6),
            "vu": ({"V": 1}, {"U": 1}, 1e-6),
        }
    )
    v = -0.5 * np.expm1(-2e-6)
    exact = np.array([comb(4, n) * v**n * (1 - v) ** (4 - n) for n in range(5)])

    def off(method: Dense | Transient) -> float:
        return relative(method.solve(net, [6, 0, 4, 0], [1.0]).marginal("V")[0], exact)

    for method in (Dense(), Transient()):
        yield attempt(method.name, partial(off, method), DIGITS)


def _binding() -> Iterator[Attempt]:
    # A + B <-> C from 100 of each: weights K**c / (c! (100 - c)!**2). Rates without species give 65.887.
    bind, free = 0.05662, 1.0
    net = network({"bind": ({"A": 1, "B": 1}, {"C": 1}, bind), "free": ({"C": 1}, {"A": 1, "B": 1}, free)})
    ratio = Fraction(bind)
    weights = [ratio**c * comb(100, c) ** 2 * factorial(c) for c in range(101)]
    mean = float(sum(c * w for c, w in enumerate(weights)) / sum(weights))
    yield attempt(
        f"stationary, mean {mean:.3f}", lambda: relative(stationary(net, [100, 100, 0]).mean()[2], mean), 1e-13
    )
    yield attempt(
        "exact, late", lambda: relative(Transient().solve(net, [100, 100, 0], [50.0]).mean()[0, 2], mean), 1e-11
    )


def _two_classes() -> Iterator[Attempt]:
    net = network(
        {
            "pair": ({"A": 1}, {"B": 1}, 1.0),
            "trap": ({"A": 1}, {"D": 1}, 3.0),
            "bc": ({"B": 1}, {"C": 1}, 2.0),
            "cb": ({"C": 1}, {"B": 1}, 8.0),
        },
        *"ABCD",
    )
    exact = [0, 0.2, 0.05, 0.75]
    yield attempt("stationary", lambda: relative(stationary(net, [1, 0, 0, 0]).mean(), exact), 1e-15)
    yield attempt(
        "dense, late", lambda: relative(Dense().solve(net, [1, 0, 0, 0], [100.0]).mean()[0, 1:], exact[1:]), DIGITS
    )


def _yule() -> Iterator[Attempt]:
    net = network({"birth": ({"X": 1}, {"X": 2}, 1.0)})

    def off() -> float:
        law = FiniteStateProjection(1e-10).solve(net, [1], [4.0])
        found = law.marginal("X")[0][1:]
        exact = np.exp(-4.0) * (-np.expm1(-4.0)) ** np.arange(found.size)
        return float(abs(found - exact).sum() + 1 - exact.sum())

    yield attempt("fsp", off, 1.01e-10)
    yield refusal("exact", lambda: Transient(max_states=1000).solve(net, [1], [4.0]), "X up to")
    yield refusal("stationary", lambda: stationary(net, [1], max_states=1000), "over 1000 states are reachable")


def _births_from_nothing() -> Iterator[Attempt]:
    net = network({"birth": ({}, {"X": 1}, 10.0), "death": ({"X": 1}, {}, 1.0)})
    exact = np.exp(-10.0) * np.cumprod(np.append(1.0, 10.0 / np.arange(1, 40)))

    def off(points: int) -> float:
        law = FiniteStateProjection(1e-12).solve(net, [0], np.linspace(0.0, 40.0, points)).marginal("X")[-1]
        return float(abs(np.resize(law, 40) * (np.arange(40) < law.size) - exact).sum())

    for points in (2, 50):
        yield attempt(f"fsp, {points} times", partial(off, points), 1e-10)


STIFFNESS = (
    Case(
        "slow leak", "A <-> B at q, B -> C at 1e-3: relative error of each probability", "two roots, 60 digits", _leak
    ),
    Case(
        "near-decomposable", "two pairs hardly joined: relative error of the stationary law", "balance", _decomposable
    ),
    Case("poisson tails", "births: relative error of each probability", "closed form", _poisson_tails),
    Case("twelve decades", "independent switches, 1e6 and 1e-6: relative error of the slow one", "binomial", _decades),
    Case("reversible binding", "A + B <-> C: relative error of the mean", "product law, rational", _binding),
    Case("two closed classes", "a pair and a trap: relative error of the last law", "closed form", _two_classes),
    Case("yule", "births without end: summed error", "geometric law", _yule),
    Case(
        "empty start", "births and deaths from nothing on two grids: summed error", "Poisson law", _births_from_nothing
    ),
)
