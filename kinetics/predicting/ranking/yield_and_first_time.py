"""The yield of a target at a horizon and the time to its first copy: exact where possible, else sampled."""

from __future__ import annotations

import time
from dataclasses import dataclass
from functools import cache

import numpy as np

from kinetics.markov.passage.restricted import restricted_passage
from kinetics.markov.transient import Transient
from kinetics.network import Network
from kinetics.network.laws.expression import quoted
from kinetics.sampling.forecast import forecast_runs
from kinetics.sampling.methods import path_method
from kinetics.support.answer import CONFIDENCE, Answer, kind_of
from kinetics.support.arrays import Floats, Ints, whole_number
from kinetics.support.intervals import student_quantile
from kinetics.support.tables import counted

MAX_STATES = 100_000
MAX_SECONDS = 40.0  # of one exact figure, by the solvers' own estimate, which does not depend on the machine
TOLERANCE = 1e-13  # probability that uniformisation may leave out
TAIL = 0.025
WithSpread = tuple[Answer, float]  # a mean over runs, and the standard deviation of one run


@dataclass(frozen=True)
class Question:
    """The question to a network: its yield and first time, from where, of what, and until when.

    initial : (S,) counts at time 0
    target : index of the target species
    possible : largest number of its copies that the tank could hold
    horizon : tu, above 0
    """

    network: Network
    initial: Ints
    target: int
    possible: int
    horizon: float

    def __post_init__(self) -> None:
        if not 0 < self.horizon < np.inf:
            raise ValueError(f"horizon = {self.horizon:g}; expected a positive number of tu")


@dataclass(frozen=True)
class YieldAndFirstTime:
    """The yield of a target and the time to its first copy.

    first : time to the first target, tu; runs without one by the horizon are counted with the horizon, so that the
        mean exists and both methods estimate the same (the restricted mean of survival analysis)
    reached : probability of a first target by the horizon
    yield_ : targets at the horizon, as a fraction of those possible
    first_sd, yield_sd : spread of first and yield_ from run to run

    Answers from the same runs share their cost.
    """

    first: Answer
    reached: Answer
    yield_: Answer
    first_sd: float
    yield_sd: float


def yield_and_first_time(
    question: Question,
    runs: int,
    seed: int,
    max_states: int = MAX_STATES,
    first_run: int = 0,
    like: YieldAndFirstTime | None = None,
) -> YieldAndFirstTime:
    """Exact where the states are few enough, each figure for itself; else from `runs` sampled runs.

    max_states : solved exactly up to these; 0 for sampled figures only
    first_run : number of the first run; with one seed, runs of different numbers are independent
    like : the answers at other rates; what was too large there is not tried again
    """
    load_kernels()
    passage = amount = None
    if max_states and (like is None or like.first.kind != CONFIDENCE):
        passage = _exact_passage(question, max_states)
    if max_states and (like is None or like.yield_.kind != CONFIDENCE):
        amount = _exact_yield(question, max_states)
    if passage is None or amount is None:
        *sampled_passage, sampled_amount = _sampled(question, runs, seed, first_run)
        passage, amount = passage or sampled_passage, amount or sampled_amount
    (first, first_sd), (reached, _), (yield_, yield_sd) = *passage, amount
    return YieldAndFirstTime(first, reached, yield_, first_sd, yield_sd)


@cache
def load_kernels() -> None:
    """Load kernels and libraries by a tank of one copy that decays, so that this is no cost of the first figure."""
    network = Network(("x",), ("decay",), np.array([[1]]), np.array([[-1]]), np.ones(1), np.ones(1))
    question = Question(network, np.array([1]), 0, 1, 1.0)
    _exact_passage(question, MAX_STATES)
    _exact_yield(question, MAX_STATES)
    _sampled(question, 2, 0, 0)


def _exact_passage(question: Question, max_states: int) -> list[WithSpread] | None:
    """First target, and probability of it by the horizon; None where the solver refuses: too many states or steps."""
    began = time.process_time()
    network, end = question.network, question.horizon
    target = network.species[question.target]
    try:
        found = restricted_passage(network, question.initial, target, end, 1, max_states, MAX_SECONDS)
    except ValueError:
        return None
    cost = time.process_time() - began
    sd, kind = max(found.reached * (1.0 - found.reached), 0.0) ** 0.5, kind_of(found.is_bound)
    return [
        (_exact(found.mean, found.mean_error, end, kind, found.n_states, cost), found.sd),
        (_exact(found.reached, found.reached_error, 1.0, kind, found.n_states, cost), sd),
    ]


def _exact_yield(question: Question, max_states: int) -> WithSpread | None:
    """Targets at the horizon over those possible; None where the solver refuses."""
    began = time.process_time()
    method = Transient(TOLERANCE, max_states, MAX_SECONDS)
    try:
        end = method.solve(question.network, question.initial, [question.horizon])
    except ValueError:
        return None
    mean, sd, high = (
        table[0, question.target] / question.possible for table in (end.mean(), end.sd(), end.mean_bounds()[1])
    )
    kind, cost = kind_of(end.is_bound), time.process_time() - began
    return _exact(float(mean), float(high - mean), 1.0, kind, len(end.space), cost), float(sd)


def _exact(value: float, error: float, top: float, kind: str, states: int, cost: float) -> Answer:
    size = counted(states, "state")
    return Answer(value, max(value - error, 0.0), min(value + error, top), kind, "exact", cost, size)


def _sampled(question: Question, runs: int, seed: int, first_run: int) -> tuple[WithSpread, WithSpread, WithSpread]:
    """First target, probability of it by the horizon, and yield, from the same runs, those of `sample_path`."""
    n, end = whole_number("runs", runs, 2), question.horizon
    began = time.process_time()
    network, start, method = question.network, question.initial, path_method(question.network)
    forecast_runs(network, method, start, np.array([end]), n)
    until = f"{quoted(network.species[question.target])} >= 1"
    found = method.simulate(network, start, end, n, seed, first_run=first_run, until=until)
    targets = method.simulate(network, start, [end], n, seed, first_run=first_run).counts[:, 0, question.target]
    cost = time.process_time() - began
    return (
        _mean(found.observed, end, cost),
        _mean(found.is_reached.astype(float), 1.0, cost),
        _mean(targets / question.possible, 1.0, cost),
    )


def _mean(values: Floats, top: float, cost: float) -> WithSpread:
    """Mean of values between 0 and `top` with Student's interval.

    Where all runs agree the spread shows nothing; the interval then allows for a share of other runs that n alike ones
    do not exclude (Clopper & Pearson 1934), at either end of the range.
    """
    n, mean, sd = values.size, float(values.mean()), float(values.std(ddof=1))
    if values.min() < values.max():
        half = student_quantile(n - 1, 1 - 2 * TAIL) * sd / n**0.5
        low, high = mean - half, mean + half
    else:
        mean, sd = float(values[0]), 0.0  # sums of like values round
        share = 1 - TAIL ** (1 / n)
        low, high = mean - share * mean, mean + share * (top - mean)
    return Answer(mean, max(low, 0.0), min(high, top), CONFIDENCE, "ssa", cost, counted(n, "run")), sd
