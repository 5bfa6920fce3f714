"""Hard cases of stiffness: rates many decades apart, in probabilities and stationary distributions."""

from __future__ import annotations

from collections.abc import Iterator
from decimal import Decimal, localcontext
from fractions import Fraction
from functools import partial
from math import comb, factorial

import numpy as np

from kinetics.markov import committor, first_passage, stationary
from kinetics.markov.state_enumeration import Condition
from kinetics.markov.transient import Collocation, Dense, FiniteStateProjection, SolvingMethod, Transient
from kinetics.network import Network
from kinetics.support.arrays import Floats, Ints
from kinetics.trust.hardcases.case import (
    Attempt,
    Case,
    attempt,
    beyond_its_error,
    departure,
    network,
    refusal,
    relative,
    sampled,
    solved,
    walk,
)

DIGITS = 1e-13


def _leak() -> Iterator[Attempt]:
    for fast in (1e6, 1e10, 1e15):
        pair = {"ab": ({"A": 1}, {"B": 1}, fast), "ba": ({"B": 1}, {"A": 1}, fast), "leak": ({"B": 1}, {"C": 1}, 1e-3)}
        net = network(pair)
        exact = leak_exact(fast, 1e-3, 1.0)
        for method in (Dense(), Transient()):
            yield attempt(f"{method.name}, q t = {fast:g}", partial(_leak_error, method, net, exact), DIGITS)
        # Its bound is for the sum, and the leak holds 5e-4 of that.
        yield attempt(f"collocation, q t = {fast:g}", partial(_leak_error, Collocation(), net, exact), 1e-9)
        project = FiniteStateProjection(1e-12)
        if fast == 1e6:  # as many steps, which round
            yield attempt(f"fsp, q t = {fast:g}", partial(_leak_error, project, net, exact), 1e-9)
        else:
            yield refusal(f"fsp, q t = {fast:g}", partial(project.solve, net, [1, 0, 0], [1.0]), "too stiff")
        mean = 2.0 / 1e-3 + 1.0 / fast
        found = partial(first_passage, net, [1, 0, 0], "C")
        yield attempt(f"passage, q = {fast:g}", lambda found=found, mean=mean: relative(found().mean, mean), DIGITS)


def _leak_error(method: SolvingMethod, net: Network, exact: Floats) -> float:
    solution = method.solve(net, [1, 0, 0], [1.0])
    return relative([solution.probability(state)[0] for state in np.eye(3, dtype=int)], exact)


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


def _joined_pairs(coupling: float) -> Network:
    return network(
        {
            "ab": ({"A": 1}, {"B": 1}, 1.0),
            "ba": ({"B": 1}, {"A": 1}, 2.0),
            "ac": ({"A": 1}, {"C": 1}, coupling),
            "ca": ({"C": 1}, {"A": 1}, 3 * coupling),
            "cd": ({"C": 1}, {"D": 1}, 5.0),
            "dc": ({"D": 1}, {"C": 1}, 7.0),
        }
    )


def _decomposable() -> Iterator[Attempt]:
    shares = np.array([1, 1 / 2, 1 / 3, 5 / 21])
    for coupling in (1e-16, 1e-300):
        net = _joined_pairs(coupling)
        yield attempt(f"stationary, coupling {coupling:g}", partial(_resting_error, net, shares / shares.sum()), 1e-14)
    # Long after the coupling has done its work; q t = 8e18.
    coupled = _joined_pairs(1e-16)
    states = np.eye(4, dtype=int)

    def late() -> float:
        solution = Dense().solve(coupled, [1, 0, 0, 0], [1e18])
        return relative([solution.probability(state)[0] for state in states], shares / shares.sum())

    yield attempt("dense, coupling 1e-16 at 1e18", late, 1e-12)


def _resting_error(net: Network, exact: Floats) -> float:
    return relative(stationary(net, [1, 0, 0, 0]).mean(), exact)


def _poisson_tails() -> Iterator[Attempt]:
    net, time, n = walk(50, 1.0, 0.0), 0.01, 48

    def off() -> float:
        solution = Dense().solve(net, np.eye(1, 51, dtype=int)[0], [time])
        found = [solution.probability(np.eye(1, 51, k, dtype=int)[0])[0] for k in range(n)]
        return relative(found, [np.exp(-time) * time**k / factorial(k) for k in range(n)])

    yield attempt(f"dense, down to {time**n / factorial(n):.0e}", off, DIGITS)

    up = network({"up": ({"A": 1}, {"B": 1}, 1e-3), "down": ({"B": 1}, {"A": 1}, 1.0)})
    copies = 40
    weights = [Fraction(1e-3) ** k * comb(copies, k) for k in range(copies + 1)]
    exact = [float(weight / sum(weights)) for weight in weights]
    yield attempt(
        f"stationary, down to {exact[-1]:.0e}",
        lambda: relative(stationary(up, [copies, 0]).marginal("B"), exact),
        DIGITS,
    )


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

    fair = np.array([1, 4, 6, 4, 1]) / 16
    yield attempt("stationary", lambda: relative(stationary(net, [6, 0, 4, 0]).marginal("V"), fair), DIGITS)
    # Quick copies are gone at once, so that runs need not draw 1e12 events.
    ends = network({"ab": ({"A": 1}, {"B": 1}, 1e6), "cd": ({"C": 1}, {"D": 1}, 1e-6)})
    gone = [comb(4, n) * (-np.expm1(-1.0)) ** n * np.exp(n - 4.0) for n in range(5)]
    yield from sampled(ends, [6, 0, 4, 0], [1e6], lambda counts: departure(counts[:, 0, 3], gone), 4000, 11)


def _thousands() -> Iterator[Attempt]:
    net = network(
        {
            "xy": ({"X": 1}, {"Y": 1}, 1e4),
            "yx": ({"Y": 1}, {"X": 1}, 2e4),
            "uv": ({"U": 1}, {"V": 1}, 1e-4),
            "vu": ({"V": 1}, {"U": 1}, 1e-4),
        }
    )
    quick, slow, time = 50, 40, 1e3
    y, v = 1 / 3, -0.5 * np.expm1(-2e-4 * time)
    exact = np.outer(_binomial(quick, y), _binomial(slow, v))

    def off() -> float:
        solution = Transient().solve(net, [quick, 0, slow, 0], [time])
        states = solution.space.states
        return float(abs(solution.probabilities[0] - exact[states[:, 1], states[:, 3]]).sum())

    yield attempt("exact, by collocation", off, 1e-11)
    refused = partial(FiniteStateProjection(1e-9).solve, net, [quick, 0, slow, 0], [time])
    yield refusal("fsp", refused, "too stiff")


def _binomial(n: int, p: float) -> Floats:
    return np.array([comb(n, k) * p**k * (1 - p) ** (n - k) for k in range(n + 1)])


def _binding() -> Iterator[Attempt]:
    # A + B <-> C from 500 of each: weights K**c / (c! (500 - c)!**2). Rate equations give 65.887 of A.
    n, bind, free = 500, 0.1, 1.0
    net = network({"bind": ({"A": 1, "B": 1}, {"C": 1}, bind), "free": ({"C": 1}, {"A": 1, "B": 1}, free)})
    ratio = Fraction(bind)
    weights = [ratio**c * comb(n, c) ** 2 * factorial(c) for c in range(n + 1)]
    mean = float(sum((n - c) * w for c, w in enumerate(weights)) / sum(weights))
    start = [n, n, 0]
    yield attempt(f"stationary, mean {mean:.2f}", lambda: relative(stationary(net, start).mean()[0], mean), 1e-13)
    yield from solved(net, start, [3.0], lambda late: beyond_its_error(late, [mean, mean, n - mean]), 1.0, ", late")

    def off(counts: Ints) -> float:
        return float(abs(counts[:, 0, 0].mean() - mean))

    # Five standard errors, and short of 65.887.
    yield from sampled(net, [66, 66, 434], [0.2], off, 20_000, 12, ", distance of the mean", 0.19)


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
        "dense, digits", lambda: relative(Dense().solve(net, [1, 0, 0, 0], [100.0]).mean()[0, 1:], exact[1:]), DIGITS
    )

    yield from solved(net, [1, 0, 0, 0], [100.0], lambda late: beyond_its_error(late, exact), 1.0, ", late")
    ends: dict[str, Condition] = {"pair": lambda states: states[:, 1] > 0, "trap": lambda states: states[:, 3] > 0}
    yield attempt("committor", lambda: relative(committor(net, [1, 0, 0, 0], ends).probabilities, [0.25, 0.75]), 1e-15)
    yield from sampled(
        net, [1, 0, 0, 0], [100.0], lambda counts: departure(counts[:, 0] @ [0, 1, 2, 3], exact), 4000, 13
    )


def _yule() -> Iterator[Attempt]:
    net = network({"birth": ({"X": 1}, {"X": 2}, 1.0)})

    def off() -> float:
        solution = FiniteStateProjection(1e-10).solve(net, [1], [4.0])
        found = solution.marginal("X")[0][1:]
        exact = np.exp(-4.0) * (-np.expm1(-4.0)) ** np.arange(found.size)
        return float(abs(found - exact).sum() + 1 - exact.sum())

    yield attempt("fsp", off, 1.01e-10)
    yield refusal("transient", lambda: Transient(max_states=1000).solve(net, [1], [4.0]), "X up to")
    yield refusal("stationary", lambda: stationary(net, [1], max_states=1000), "over 1000 states are reachable")
    solution = np.append(0.0, np.exp(-4.0) * (-np.expm1(-4.0)) ** np.arange(2000))
    yield from sampled(net, [1], [4.0], lambda counts: departure(counts[:, 0, 0], solution), 4000, 14)


def _births_from_nothing() -> Iterator[Attempt]:
    net = network({"birth": ({}, {"X": 1}, 10.0), "death": ({"X": 1}, {}, 1.0)})
    exact = np.exp(-10.0) * np.cumprod(np.append(1.0, 10.0 / np.arange(1, 40)))

    def off(points: int) -> float:
        solution = FiniteStateProjection(1e-12).solve(net, [0], np.linspace(0.0, 40.0, points)).marginal("X")[-1]
        return float(abs(np.resize(solution, 40) * (np.arange(40) < solution.size) - exact).sum())

    for points in (2, 50):
        yield attempt(f"fsp, {points} times", partial(off, points), 1e-10)
        times, what = np.linspace(0.0, 40.0, points), f", {points} times"
        yield from sampled(net, [0], times, lambda counts: departure(counts[:, -1, 0], exact), 2000, 15, what)


STIFFNESS = (
    Case(
        "slow leak", "A <-> B at q, B -> C at 1e-3: relative error of each probability", "two roots, 60 digits", _leak
    ),
    Case(
        "near-decomposable",
        "two weakly coupled pairs: relative error of the stationary distribution",
        "balance",
        _decomposable,
    ),
    Case("poisson tails", "births: relative error of each probability", "closed form", _poisson_tails),
    Case("stiff and large", "2,091 states, q t = 1e9: summed error", "product of binomials", _thousands),
    Case("twelve decades", "independent switches, 1e6 and 1e-6: relative error of the slow one", "binomial", _decades),
    Case(
        "reversible binding",
        "A + B <-> C: relative error of the mean, and for runs its error",
        "product form, rational",
        _binding,
    ),
    Case(
        "two closed classes", "a pair and a trap: relative error of the last probabilities", "closed form", _two_classes
    ),
    Case("yule", "unbounded births: summed error", "geometric distribution", _yule),
    Case(
        "empty start",
        "births and deaths from nothing on two grids: summed error",
        "Poisson distribution",
        _births_from_nothing,
    ),
)
