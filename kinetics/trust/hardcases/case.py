"""The parts of a hard case: the problem, the attempts at it, and small networks for both."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from kinetics.markov.transient import SOLVING_METHODS, Distribution
from kinetics.network import Network
from kinetics.sampling import SAMPLING_METHODS
from kinetics.support.arrays import Counts, Ints

CHANCE = 1e-9  # of a right sampler to look wrong, each time


@dataclass(frozen=True)
class Attempt:
    """One method on one hard case.

    error : what it was off by, as the case says; nan if the right answer is a refusal
    allowed : up to here it is right
    seconds : of processor time
    refusal : the message of a clear refusal

    >>> from kinetics.trust.hardcases import Attempt
    >>> Attempt("transient", error=1e-14, allowed=1e-12, seconds=0.1).passed
    True
    """

    method: str
    error: float
    allowed: float
    seconds: float
    refusal: str = ""

    @property
    def passed(self) -> bool:
        """Whether the answer, or the refusal, is right."""
        return bool(self.refusal) or self.error <= self.allowed


@dataclass(frozen=True)
class Case:
    """A hard case.

    name : one word or two
    question : what is asked, and how the error is measured
    answer : where the right answer comes from
    attempts : tries every method that claims the case

    >>> from kinetics.trust.hardcases import CASES
    >>> CASES[0].name, next(CASES[0].attempts()).passed
    ('slow leak', True)
    """

    name: str
    question: str
    answer: str
    attempts: Callable[[], Iterator[Attempt]]


def attempt(method: str, work: Callable[..., float], allowed: float) -> Attempt:
    """An answer: `work()` returns its error."""
    began = time.process_time()
    try:
        error = float(work())
    except (ValueError, ArithmeticError):  # an answer was asked for; `refusal` asks for these
        error = np.inf
    return Attempt(method, error, allowed, time.process_time() - began)


def refusal(method: str, work: Callable[[], Any], expected: str) -> Attempt:
    """A mistake that must be refused with a ValueError whose message holds `expected`; an answer is wrong."""
    began = time.process_time()
    message = ""
    try:
        work()
    except ValueError as raised:
        if expected in str(raised):
            message = str(raised)
    return Attempt(method, np.inf, 0.0, time.process_time() - began, message)


def solved(
    net: Network,
    start: Counts,
    times: ArrayLike,
    error: Callable[[Distribution], float],
    allowed: float,
    what: str = "",
) -> Iterator[Attempt]:
    """An answer by each solving method, whose error is that of its solution."""
    for kind in SOLVING_METHODS:
        solve = partial(kind().solve, net, start, times)
        yield attempt(kind.name + what, lambda solve=solve: error(solve()), allowed)


def sampled(
    net: Network,
    start: Counts,
    times: ArrayLike,
    error: Callable[[Ints], float],
    runs: int,
    seed: int,
    what: str = "",
    allowed: float = 1.0,
) -> Iterator[Attempt]:
    """An answer by each sampling method, whose error is that of counts (runs, T, S); a refusal if it must refuse."""
    for kind in SAMPLING_METHODS:
        sample = partial(kind().simulate, net, start, times, runs=runs, seed=seed)
        if kind().supports(net):
            yield attempt(kind.name + what, lambda sample=sample: error(sample().counts), allowed)
        else:
            yield refusal(kind.name + what, sample, "takes")


def beyond_its_error(solution: Distribution, exact: ArrayLike) -> float:
    """Largest error of the mean counts (T, S) of a solution, over what its own stated error allows and rounding."""
    off = np.abs(solution.mean() - np.asarray(exact))
    return float((off / (solution.space.states.max(axis=0) * (solution.error + 1e-14) + 1e-14)).max())


def relative(found: ArrayLike, exact: ArrayLike) -> float:
    """Largest relative error; infinite if something was found that must be 0."""
    found, exact = np.atleast_1d(np.asarray(found, dtype=float)), np.atleast_1d(np.asarray(exact, dtype=float))
    off = np.abs(found - exact)
    with np.errstate(divide="ignore"):
        return float(np.divide(off, np.abs(exact), out=np.zeros_like(off), where=off > 0).max())


def departure(counts: ArrayLike, probabilities: ArrayLike) -> float:
    """Distance of the distribution function of counts (n,) from that of 0, 1, ... of the given probabilities.

    In units of what chance allows: a right sampler comes above 1 with probability `CHANCE` at most, whatever the
    distribution (Massart 1990, doi:10.1214/aop/1176990746).
    """
    sample, exact = np.asarray(counts), np.cumsum(np.asarray(probabilities, dtype=float))
    found = np.cumsum(np.bincount(np.minimum(sample, exact.size), minlength=exact.size + 1))[:-1] / sample.size
    return float(np.abs(found - exact).max() / np.sqrt(np.log(2 / CHANCE) / (2 * sample.size)))


def network(reactions: Mapping[str, tuple[Mapping[str, int], Mapping[str, int], float]], *species: str) -> Network:
    """Reactions by name, as (copies needed, copies made, rate constant); the species in order of appearance."""
    sides = {name: (needed, made) for name, (needed, made, _) in reactions.items()}
    return Network.from_reactions(sides, [rate for _, _, rate in reactions.values()], species or None)


def walk(n: int, up: float, down: float) -> Network:
    """One walker on places p0, ..., pn."""
    steps = {f"up{i}": ({f"p{i}": 1}, {f"p{i + 1}": 1}, up) for i in range(n)}
    back = {f"down{i}": ({f"p{i + 1}": 1}, {f"p{i}": 1}, down) for i in range(n)} if down else {}
    return network(steps | back, *(f"p{i}" for i in range(n + 1)))
