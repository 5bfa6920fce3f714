"""Hard cases of first passage: remote targets, improbable ones, and long waits."""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial

import numpy as np

from kinetics.markov import committor, first_passage, stationary
from kinetics.markov.passage import rare_event
from kinetics.markov.state_enumeration import Condition
from kinetics.markov.transient import Dense, FiniteStateProjection, Transient
from kinetics.network import Network
from kinetics.support.arrays import Floats, Ints
from kinetics.support.packages import linalg, special
from kinetics.trust.hardcases.case import Attempt, Case, attempt, departure, network, refusal, relative, sampled, walk


def _first(n: int) -> Ints:
    return np.eye(1, n + 1, dtype=np.int64)[0, :]


def _at_least(index: int, copies: int) -> Condition:
    return lambda states: states[:, index] >= copies


def _none(states: Ints) -> np.ndarray:
    return np.equal(states[:, 0], 0)


def _copies(states: Ints) -> Floats:
    return states[:, 0].astype(float)


def _drift() -> Iterator[Attempt]:
    def off(n: int) -> float:
        return relative(first_passage(walk(n, 1.0, 2.0), _first(n), f"p{n}").mean, 2.0 ** (n + 1) - n - 2)

    def also(n: int) -> float:
        last: dict[str, Condition] = {"end": _at_least(n, 1)}
        return relative(committor(walk(n, 1.0, 2.0), _first(n), last).mean_times[0], 2.0 ** (n + 1) - n - 2)

    for n in (20, 60, 500):
        yield attempt(f"passage, N = {n}", partial(off, n), 1e-13)
        yield attempt(f"committor, N = {n}", partial(also, n), 1e-13)


def _ruin() -> Iterator[Attempt]:
    net = network({"win": ({"X": 1}, {"X": 2}, 1.0), "lose": ({"X": 1}, {}, 2.0)})

    def off(n: int) -> float:
        found = committor(net, [1], {"ruin": _none, "rich": _at_least(0, n)})
        return relative(found.probabilities[1], 1 / (2.0**n - 1))

    for n in (100, 1000):
        yield attempt(f"committor, chance {1 / (2.0**n - 1):.0e}", partial(off, n), 1e-13)
        rich = partial(first_passage, net, [1], "X", n)
        yield attempt(
            f"passage, chance {1 / (2.0**n - 1):.0e}",
            lambda rich=rich, n=n: relative(rich().probability, 1 / (2.0**n - 1)),
            1e-13,
        )


def _rare() -> Iterator[Attempt]:
    # 25 stages at rate 1 within 1 tu: 25 or more of a Poisson number of mean 1.
    n = 25
    terms = np.cumprod(1.0 / np.arange(1, 80))
    exact = float(np.exp(-1.0) * terms[n - 1 :].sum())
    net = walk(n, 1.0, 0.0)

    def off() -> float:
        return relative(Dense().solve(net, _first(n), [1.0]).probability(np.eye(1, n + 1, n, dtype=int)[0])[0], exact)

    yield attempt(f"dense, chance {exact:.0e}", off, 1e-13)
    births = network({"birth": ({}, {"X": 1}, 1.0)})
    for copies, allowed in ((10, 0.5), (14, 0.7)):
        tail = float(np.exp(-1.0) * terms[copies - 1 :].sum())
        # 7.3 standard errors of at most a tenth each, by Student's distribution a chance of 1e-6
        found = partial(rare_event, births, [0], _copies, copies, 1.0, runs=20_000, seed=21)
        yield attempt(
            f"rare event, chance {tail:.0e}",
            lambda found=found, tail=tail: relative(found().probability, tail),
            allowed,
        )
        yield attempt(
            f"passage cdf, chance {tail:.0e}",
            lambda copies=copies, tail=tail: relative(first_passage(births, [0], "X", copies).cdf(1.0), tail),
            1e-2 if copies == 14 else 1e-6,
        )


def _schloegl_network() -> Network:
    return network(
        {
            "more": ({"X": 2}, {"X": 3}, 0.03),
            "less": ({"X": 3}, {"X": 2}, 1e-4),
            "in": ({}, {"X": 1}, 200.0),
            "out": ({"X": 1}, {}, 3.5),
        }
    )


def _schloegl() -> Iterator[Attempt]:
    net, low, high, top = _schloegl_network(), 85, 565, 1200
    n = np.arange(top + 1.0)
    up, down = 200.0 + 0.015 * n * (n - 1), 3.5 * n + 1e-4 / 6 * n * (n - 1) * (n - 2)
    # Mean time of one step up is the wait, and after a step down the way back: positive terms, from 0 on.
    rise = np.zeros(top + 1)
    for k in range(top + 1):
        rise[k] = (1.0 + (down[k] * rise[k - 1] if k else 0.0)) / up[k]
    fall = np.zeros(top + 2)
    for k in range(top, 0, -1):
        fall[k] = (1.0 + up[k] * fall[k + 1]) / down[k]
    upwards, downwards = rise[low:high].sum(), fall[low + 1 : high + 1].sum()
    yield attempt(
        f"passage up, {upwards:.4g} tu", lambda: relative(first_passage(net, [low], "X", high).mean, upwards), 1e-11
    )
    ends: dict[str, Condition] = {"low": lambda states: states[:, 0] <= low, "beyond": _at_least(0, top)}
    yield attempt(
        f"committor down, {downwards:.4g} tu",
        lambda: relative(committor(net, [high], ends).mean_times[0], downwards),
        1e-11,
    )
    yield refusal("stationary", lambda: stationary(net, [low], max_states=2000), "X up to")
    # The distribution when both modes are filled, from the symmetrised matrix with a wall far above the upper mode.

    between, time, wall = 250, 4.0, 1000
    weights = np.concatenate([[0.0], np.cumsum(np.log(up[:wall] / down[1 : wall + 1]))])
    exits = down[: wall + 1] + np.append(up[:wall], 0.0)
    values, vectors = linalg.eigh_tridiagonal(-exits, np.sqrt(up[:wall] * down[1 : wall + 1]))
    shares = (vectors[between] * np.exp(values * time)) @ vectors.T * np.exp((weights - weights[between]) / 2)

    def off() -> float:
        found = FiniteStateProjection(1e-10).solve(net, [between], [time]).marginal("X")[0]
        return float(abs(np.resize(found, wall + 1) * (np.arange(wall + 1) < found.size) - shares).sum())

    yield attempt("fsp, modes and valley", off, 1e-8)
    what = ", modes and valley"
    yield from sampled(net, [between], [time], lambda counts: departure(counts[:, 0, 0], shares), 300, 22, what)


def _erlang() -> Iterator[Attempt]:

    n = 1000
    passage = first_passage(walk(n, 1.0, 0.0), _first(n), f"p{n}")
    yield attempt("passage, mean and sd", lambda: relative([passage.mean, passage.sd], [n, n**0.5]), 1e-12)
    times = np.array([900.0, 1000.0, 1100.0])
    yield attempt("passage, cdf", lambda: float(abs(passage.cdf(times) - special.gammainc(n, times)).max()), 1e-12)
    stages, last = walk(n, 1.0, 0.0), np.eye(1, n + 1, n, dtype=int)[0]

    def solved() -> float:
        found = Transient().solve(stages, _first(n), times).probability(last)
        return float(abs(found - special.gammainc(n, times)).max())

    yield attempt("exact", solved, 1e-12)
    share = float(special.gammainc(n, 1000.0))
    yield from sampled(
        stages, _first(n), [1000.0], lambda counts: departure(counts[:, 0, n], [1 - share, share]), 200, 23
    )


def _extinction() -> Iterator[Attempt]:
    net, n = network({"death": ({"X": 1}, {}, 1.0)}), 20_000
    exact = float((1.0 / np.arange(n, 0, -1)).sum())
    gone = {"gone": _none}
    yield attempt(f"committor, {n} copies", lambda: relative(committor(net, [n], gone).mean_times[0], exact), 1e-11)
    yield refusal("committor, 1e6 copies", partial(committor, net, [10**6], gone, max_states=50_000), "reachable")


PASSAGES = (
    Case("against a drift", "birth 1, death 2: relative error of the mean time", "2**(N+1) - N - 2", _drift),
    Case("gambler's ruin", "odds 2 : 1: relative error of the chance", "1 / (2**N - 1)", _ruin),
    Case("rare passage", "25 stages in a 25th of their time: relative error", "Poisson tail", _rare),
    Case("schloegl", "both ways between the modes: relative error of the mean times", "sums of steps", _schloegl),
    Case("erlang", "1000 stages: relative error of moments, error of the cdf", "gamma distribution", _erlang),
    Case("extinction", "deaths down to none: relative error of the mean time", "harmonic number", _extinction),
)
