"""Hard cases of sampling: large counts, late times, output grids, and networks in which nothing can happen."""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial
from typing import Any

import numpy as np

from kinetics.markov.transient import SOLVING_METHODS, Distribution, FiniteStateProjection, SolvingMethod, Transient
from kinetics.network import Network
from kinetics.sampling import SAMPLING_METHODS, SamplingMethod
from kinetics.support.arrays import Ints
from kinetics.trust.hardcases.case import CHANCE, Attempt, Case, attempt, departure, network, refusal, sampled, solved


def _samplers() -> Iterator[Any]:
    for method in SAMPLING_METHODS:
        yield method()


def _grids() -> Iterator[Attempt]:
    net = network({"birth": ({}, {"X": 1}, 10.0), "death": ({"X": 1}, {}, 1.0)})

    def differing(method: Any) -> float:
        coarse = method.simulate(net, [0], [20.0], runs=200, seed=1).counts[:, -1]
        fine = method.simulate(net, [0], np.linspace(0.0, 20.0, 41), runs=200, seed=1).counts[:, -1]
        return float((coarse != fine).sum())

    for method in _samplers():
        yield attempt(method.name, partial(differing, method), 0.0)


def _large_counts() -> Iterator[Attempt]:
    def off(counts: Ints, start: int) -> float:
        # 50 Poisson numbers of mean 20: their mean is 20 +- 4 except for a chance of 1e-9
        return float(abs(counts[:, 0].sum(axis=1) - start).max() + max(0.0, abs(counts[:, 0, 1].mean() - 20.0) - 4.0))

    def missed(net: Network, start: int) -> float:
        probabilities = FiniteStateProjection(1e-12).solve(net, [start, 0], [1.0]).marginal("Y")[0]
        exact = np.exp(-20.0) * np.cumprod(np.append(1.0, 20.0 / np.arange(1, probabilities.size)))
        return float(abs(probabilities - exact).sum() + 1.0 - exact.sum())

    for start in (5 * 10**9, 10**15):
        net = network({"turn": ({"X": 1}, {"Y": 1}, 20.0 / start)})
        yield from sampled(net, [start, 0], [1.0], partial(off, start=start), 50, 2, f", {start:.0e}", 0.0)
        yield attempt(f"fsp, {start:.0e}", partial(missed, net, start), 1e-7)  # Poisson up to 20 / start
        yield refusal(f"exact, {start:.0e}", partial(Transient().solve, net, [start, 0], [1.0]), "reachable")


def _extinction() -> Iterator[Attempt]:
    net, n = network({"death": ({"X": 1}, {}, 1.0)}), 10**6
    left = n * np.exp([-1.0, -10.0])

    def off(counts: Ints) -> float:
        """Seven standard deviations at two times; and any left at a third, by which none are except for 3e-10."""
        return float(max((abs(counts[:, :2, 0] - left) / np.sqrt(left)).max() / 7.0, 2.0 * counts[:, 2].max()))

    yield from sampled(net, [n], [1.0, 10.0, 36.0], off, 2, 3, ", 1e6 copies")


def _late_times() -> Iterator[Attempt]:
    slow = network({"death": ({"X": 1}, {}, 1e-16)})
    wake = {"wake": ({"X": 1}, {"Y": 1}, 1e-16)}
    awake = network(wake | {"turn": ({"Y": 1}, {"Z": 1}, 1e3), "back": ({"Z": 1}, {"Y": 1}, 1e3)})

    def gap(method: Any) -> float:
        left = method.simulate(slow, [1], [1e16], runs=4000, seed=4).counts.mean()
        return float(abs(left - np.exp(-1.0)) / np.sqrt(np.log(2 / CHANCE) / 8000))

    for method in _samplers():
        yield attempt(f"{method.name}, one event near 1e16", partial(gap, method), 1.0)
        stalls = partial(method.simulate, awake, [1, 0, 0], [1e17], runs=3, seed=5)
        yield refusal(f"{method.name}, waits of 1e-3 there", stalls, "clock")


def _nothing() -> Iterator[Attempt]:
    """Questions whose answer is the start, and one whose answer is one state."""
    dying = network({"death": ({"X": 1}, {}, 1.0)})
    still: tuple[tuple[str, Network, list[int], list[float], list[int]], ...] = (
        ("t = 0", dying, [5], [0.0], [5]),
        ("no channels", Network.from_reactions({}, [], ["X"]), [5], [3.0], [5]),
        ("propensities 0", network({"never": ({"X": 1}, {}, 0.0)}), [5], [3.0], [5]),
        ("none left", dying, [0], [3.0], [0]),
        ("A -> A", Network.from_text("idle: X -> X, 7"), [5], [3.0], [5]),
        ("below the reactants", network({"join": ({"X": 3}, {"Y": 1}, 1.0)}), [2, 0], [3.0], [2, 0]),
    )
    methods: tuple[Any, ...] = (*SAMPLING_METHODS, *SOLVING_METHODS)
    for name, net, start, times, end in still:
        for kind in methods:
            method = kind()
            what = f"{method.name}, {name}"
            if isinstance(method, SamplingMethod) and not method.supports(net):
                yield refusal(what, partial(method.simulate, net, start, times), "takes")
                continue
            yield attempt(what, partial(_away, method, net, start, times, end), 1e-13)


def _consumption() -> Iterator[Attempt]:
    """X is eaten at a constant rate of 2 from 3 copies on: 3 minus a Poisson number, and never below 0."""
    eaten = np.exp(-2.0) * np.array([1.0, 2.0, 2.0])  # none, one, two of three
    probabilities = np.append(1.0 - eaten.sum(), eaten[::-1])
    reactions: Any = {"eat": ({"X": 1}, {})}
    net = Network.from_reactions(reactions, ["2.0"])
    strict = Network.from_reactions(reactions, ["2.0"], at_zero="refuse")
    for method in _samplers():
        if method.supports(net):
            counts = partial(method.simulate, net, [3], [1.0], runs=4000, seed=8)
            what = f"{method.name}, blocked at 0"
            yield attempt(what, lambda counts=counts: departure(counts().counts[:, 0, 0], probabilities), 1.0)
            late = partial(method.simulate, strict, [3], [9.0], runs=50, seed=8)
            yield refusal(f"{method.name}, refused at 0", late, "'eat'")

    def summed(found: Distribution) -> float:
        return float(abs(found.marginal("X")[0] - probabilities).sum())

    yield from solved(net, [3], [1.0], summed, 1e-8, ", blocked at 0")


def _away(
    method: SamplingMethod | SolvingMethod, net: Network, start: list[int], times: list[float], end: list[int]
) -> float:
    """Distance of the mean from its exact value."""
    if isinstance(method, SolvingMethod):
        mean = method.solve(net, start, times).mean()
    else:
        mean = method.simulate(net, start, times, runs=20, seed=6).mean()
    return float(abs(mean[-1] - end).max())


def _duplicates() -> Iterator[Attempt]:
    twice = network({"one": ({"X": 1}, {}, 0.25), "two": ({"X": 1}, {}, 0.75)})

    def off(found: Distribution) -> float:
        return float(abs(found.mean()[0, 0] - 9 * np.exp(-1.0)))

    def gap(counts: Ints) -> float:
        return float(abs(counts.mean() / 9 - np.exp(-1.0)) / np.sqrt(np.log(2 / CHANCE) / 8000))

    yield from solved(twice, [9], [1.0], off, 1e-8)
    yield from sampled(twice, [9], [1.0], gap, 4000, 7)


SAMPLING = (
    Case(
        "constant consumption",
        "3 copies eaten at a constant rate: error, or deviation over chance",
        "Poisson distribution",
        _consumption,
    ),
    Case("any grid", "the same seed on two grids: runs that differ", "the same runs", _grids),
    Case(
        "large counts",
        "20 of 5e9 and 1e15 copies convert: copies lost, and the mean beyond chance",
        "conservation",
        _large_counts,
    ),
    Case("dying out", "1e6 copies die: deviation over what chance allows", "binomial distribution", _extinction),
    Case("late events", "times near 1e16: deviation over what chance allows", "exponential distribution", _late_times),
    Case(
        "nothing to do", "t = 0, no channel, none that can fire, A -> A: how far the mean moves", "the start", _nothing
    ),
    Case(
        "duplicate reactions",
        "two channels for one decay: error, or deviation over chance",
        "binomial distribution",
        _duplicates,
    ),
)
