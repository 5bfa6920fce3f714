"""What a tank comes to: the time to its first target and its yield at a horizon, solved where that is possible.

Exact: the master equation by uniformisation on all reachable states, every term positive, so that the error is known.
Sampled: runs of the direct method, with 95 % intervals.
"""

from __future__ import annotations

import time
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import NDArray

from kinetics.network import Network
from kinetics.sampling import sample_path
from kinetics.sampling.base import whole_number
from kinetics.solving import StateSpace, reachable
from kinetics.solving.poisson import poisson_window, window_error
from kinetics.solving.states import TooManyStatesError
from kinetics.solving.uniformisation import DiscreteChain
from kinetics.support.arrays import Floats, Ints
from kinetics.support.intervals import student_quantile

MAX_STATES = 100_000
MAX_WORK = 2e10  # multiplications of one exact figure, about half a minute
TOLERANCE = 1e-13  # probability that uniformisation may leave out
TAIL = 0.025


@dataclass(frozen=True)
class Figure:
    """A mean over runs, and how well it is known.

    value, sd : mean, and spread of a single run
    low, high : 95 % interval of the mean by Monte Carlo; of an exact figure the bounds of its numerical error
    method : `exact` or `ssa`
    size : states of an exact figure, runs of a sampled one
    cpu_seconds : what it cost; figures from the same runs share their cost
    """

    value: float
    sd: float
    low: float
    high: float
    method: str
    size: int
    cpu_seconds: float

    @property
    def error(self) -> float:
        """How far the interval reaches from the value at most."""
        return max(self.value - self.low, self.high - self.value)


@dataclass(frozen=True)
class Question:
    """What is asked of a network.

    initial : (S,) counts at time 0
    target : index of the species waited for
    possible : copies of it that the tank could hold at most
    horizon : tu
    """

    network: Network
    initial: Ints
    target: int
    possible: int
    horizon: float


@dataclass(frozen=True)
class Outcome:
    """The answers.

    first : time to the first target, tu; runs without one by the horizon are counted with the horizon, so that the
        mean exists and both methods estimate the same (the restricted mean of survival analysis)
    reached : probability of a first target by the horizon
    yield_ : targets at the horizon, as a fraction of those possible
    """

    first: Figure
    reached: Figure
    yield_: Figure


def outcome(
    question: Question,
    runs: int,
    seed: int,
    max_states: int = MAX_STATES,
    first_run: int = 0,
    like: Outcome | None = None,
) -> Outcome:
    """Exact where the states are few enough, each figure for itself; else from `runs` sampled runs.

    first_run : number of the first run; with one seed, runs of different numbers are independent
    like : the outcome at other rates; what was too large there is not tried again
    """
    load_kernels()
    passage = amount = None
    if like is None or like.first.method == "exact":
        passage = _exact_passage(question, max_states)
    if like is None or like.yield_.method == "exact":
        amount = _exact_yield(question, max_states)
    if passage is not None and amount is not None:
        return Outcome(*passage, amount)
    first, reached, sampled = _sampled(question, runs, seed, first_run)
    if passage is not None:
        first, reached = passage
    return Outcome(first, reached, sampled if amount is None else amount)


@cache
def load_kernels() -> None:
    """Load kernels and libraries by a tank of one copy that decays, so that this is no cost of the first figure."""
    network = Network(("x",), ("decay",), np.array([[1]]), np.array([[-1]]), np.ones(1), np.ones(1))
    question = Question(network, np.array([1]), 0, 1, 1.0)
    _exact_passage(question, MAX_STATES)
    _exact_yield(question, MAX_STATES)
    _sampled(question, 2, 0, 0)


@dataclass(frozen=True)
class _Chain:
    """A chain that is worth solving. weights : Poisson probabilities of the steps first, first + 1, ... by the end."""

    space: StateSpace
    chain: DiscreteChain
    end: float
    first: int
    weights: Floats

    @classmethod
    def of(cls, question: Question, stops: bool, max_states: int) -> _Chain | None:
        """The chain, stopped at the first target or not; None where it is too large or takes too many steps."""

        def stop(states: Ints) -> NDArray[np.bool_]:
            return states[:, question.target] >= 1

        try:
            space = reachable(question.network, question.initial, stop if stops else None, max_states)
        except TooManyStatesError:
            return None
        chain = DiscreteChain.of(space.generator())
        # The window's own arrays have a place for each step, so the bound comes first.
        if chain.steps_until(question.horizon, TOLERANCE) * chain.transposed.nnz > MAX_WORK:
            return None
        return cls(space, chain, question.horizon, *poisson_window(chain.rate * question.horizon, TOLERANCE))

    @property
    def steps(self) -> int:
        return self.first + self.weights.size

    @property
    def error(self) -> float:
        """Bound on the summed error of the probabilities."""
        window = window_error(self.chain.rate * self.end, self.first, self.weights, TOLERANCE)
        return window + self.chain.rounding(self.steps)

    def vectors(self) -> Iterator[Floats]:
        """Probability (N,) of each state after 0, 1, ... steps."""
        vector = np.zeros(len(self.space))
        vector[0] = 1.0
        for _ in range(self.steps):
            yield vector
            vector = self.chain.transposed @ vector

    def alive(self) -> Floats:
        """Probability (steps,) of not being stopped after each step."""
        goes_on = ~self.space.is_stopped
        return np.array([vector @ goes_on for vector in self.vectors()])

    def probabilities(self) -> Floats:
        """Probability (N,) of each state at the end."""
        total = np.zeros(len(self.space))
        for n, vector in enumerate(self.vectors()):
            if n >= self.first:
                total += self.weights[n - self.first] * vector
        return total


def _exact_passage(question: Question, max_states: int) -> tuple[Figure, Figure] | None:
    """First target, and probability of it by the horizon.

    The moments of min(T, horizon) are integrals of the survival function, and the integral of each of its terms
    Poisson(n; q t) is a Poisson tail: sums of positive terms again.
    """
    began = time.process_time()
    solved = _Chain.of(question, True, max_states)
    if solved is None:
        return None
    alive, rate, end = solved.alive(), solved.chain.rate, solved.end
    # P(N > n) for n = 0, 1, ...: certain before the window, nothing after it
    tails = np.ones(solved.steps + 1)
    tails[solved.first :] = np.append(np.cumsum(solved.weights[::-1])[::-1][1:], [0.0, 0.0])
    mean = float(alive @ tails[:-1]) / rate
    square = 2.0 * float((alive * np.arange(1, alive.size + 1)) @ tails[1:]) / rate**2
    missed = float(alive[solved.first :] @ solved.weights)
    reached = 1.0 - missed
    cost = time.process_time() - began
    states = len(solved.space)
    return (
        _exact(mean, max(square - mean**2, 0.0), solved.error * end, end, states, cost),
        _exact(reached, reached * missed, solved.error, 1.0, states, cost),
    )


def _exact_yield(question: Question, max_states: int) -> Figure | None:
    """Targets at the horizon over those possible."""
    began = time.process_time()
    solved = _Chain.of(question, False, max_states)
    if solved is None:
        return None
    probabilities = solved.probabilities()
    shares = solved.space.states[:, question.target] / question.possible
    mean = float(probabilities @ shares)
    variance = float(probabilities @ (shares - mean) ** 2)
    return _exact(mean, variance, solved.error, 1.0, len(solved.space), time.process_time() - began)


def _exact(value: float, variance: float, error: float, top: float, states: int, cost: float) -> Figure:
    low, high = max(value - error, 0.0), min(value + error, top)
    return Figure(value, float(np.sqrt(variance)), low, high, "exact", states, cost)


def _sampled(question: Question, runs: int, seed: int, first_run: int) -> tuple[Figure, Figure, Figure]:
    """First target, probability of it by the horizon, and yield."""
    n = whole_number("runs", runs, 2)
    name, end = question.network.species[question.target], question.horizon
    began = time.process_time()
    times, shares = np.empty(n), np.empty(n)
    for i in range(n):
        path = sample_path(question.network, question.initial, end, seed, first_run + i)
        times[i] = path.first_time(name)
        shares[i] = path.states[-1, question.target] / question.possible
    is_reached = np.isfinite(times)
    times[~is_reached] = end
    cost = time.process_time() - began
    return _mean(times, end, cost), _mean(is_reached.astype(float), 1.0, cost), _mean(shares, 1.0, cost)


def _mean(values: Floats, top: float, cost: float) -> Figure:
    """Mean of values between 0 and `top` with Student's interval.

    Where all runs agree the spread tells nothing; the interval then allows for a share of other runs that n alike ones
    do not exclude (Clopper & Pearson 1934), at either end of the range.
    """
    n, mean, sd = values.size, float(values.mean()), float(values.std(ddof=1))
    if sd > 0:
        half = student_quantile(n - 1, 1 - 2 * TAIL) * sd / n**0.5
        low, high = mean - half, mean + half
    else:
        share = 1 - TAIL ** (1 / n)
        low, high = mean - share * mean, mean + share * (top - mean)
    return Figure(mean, sd, max(low, 0.0), min(high, top), "ssa", n, cost)
