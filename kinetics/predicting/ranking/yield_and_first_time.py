"""The yield of a target at a horizon and the time to its first copy: exact where possible, else sampled."""

from __future__ import annotations

import time
from dataclasses import dataclass, replace
from functools import cache
from typing import Any

import numpy as np

from kinetics.markov.chain import Chain
from kinetics.markov.network_questions import chain_to
from kinetics.markov.passage.backward import BackwardPass, steps_until
from kinetics.markov.passage.until import Mask
from kinetics.markov.transient import Transient
from kinetics.markov.transient.uniformisation import STEP_SECONDS
from kinetics.network import Model, Network
from kinetics.network.laws.writing import quoted
from kinetics.sampling.forecast import forecast_runs
from kinetics.sampling.methods import path_method
from kinetics.support.answer import CONFIDENCE, Answer, kind_of
from kinetics.support.arrays import Floats, whole_number
from kinetics.support.cli.progress import forecast
from kinetics.support.intervals import student_quantile
from kinetics.support.tables import counted, rough

MAX_STATES = 100_000
MAX_SECONDS = 40.0  # of one exact figure, by the solvers' own estimate, which does not depend on the machine
TOLERANCE = 1e-13  # probability that uniformisation may leave out
TAIL = 0.025
WithSpread = tuple[Answer, float]  # a mean over runs, and the standard deviation of one run


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
    model: Model,
    target: str,
    possible: int,
    horizon: float,
    runs: int,
    seed: int,
    max_states: int = MAX_STATES,
    first_run: int = 0,
    like: YieldAndFirstTime | None = None,
) -> YieldAndFirstTime:
    """Yield and first time of the target: exact if the states are few enough, each for itself; else from `runs` runs.

    target : its species
    possible : largest number of its copies that the tank could hold
    horizon : tu, above 0
    max_states : solved exactly up to these; 0 for sampled figures only
    first_run : number of the first run; with one seed, runs of different numbers are independent
    like : the answers at other rates; what was too large there is not tried again
    """
    if not 0 < horizon < np.inf:
        raise ValueError(f"horizon = {horizon:g}; expected a positive number of tu")
    load_kernels()
    passage = amount = None
    if max_states and (like is None or like.first.kind != CONFIDENCE):
        passage = _exact_passage(model, target, horizon, max_states)
    if max_states and (like is None or like.yield_.kind != CONFIDENCE):
        amount = _exact_yield(model, target, possible, horizon, max_states)
    if passage is None or amount is None:
        *sampled_passage, sampled_amount = _sampled(model, target, possible, horizon, runs, seed, first_run)
        passage, amount = passage or sampled_passage, amount or sampled_amount
    (first, first_sd), (reached, _), (yield_, yield_sd) = *passage, amount
    return YieldAndFirstTime(first, reached, yield_, first_sd, yield_sd)


@cache
def load_kernels() -> None:
    """Load kernels and libraries by a tank of one copy that decays, so that this is no cost of the first figure."""
    network = Network.from_reactions({"decay": ({"x": 1}, {})}, [1.0])
    model = Model(network, np.array([1]))
    _exact_passage(model, "x", 1.0, MAX_STATES)
    _exact_yield(model, "x", 1, 1.0, MAX_STATES)
    _sampled(model, "x", 1, 1.0, 2, 0, 0)


def _exact_passage(model: Model, target: str, end: float, max_states: int) -> list[WithSpread] | None:
    """First target, and probability of it by the horizon; None if the solver refuses: too many states or steps."""
    began = time.process_time()
    try:
        chain, goal = chain_to(model, None, target, 1, max_states)
        steps = steps_until(chain.transitions, end)
        seconds = 2.0 * steps * STEP_SECONDS * (chain.transitions.rates.size + len(chain))
        if not seconds <= MAX_SECONDS:
            return None
        forecast(seconds, f"{rough(steps)} steps over {len(chain)} states")
        first, reached, sd = first_by(chain, goal, end)
    except ValueError:
        return None
    chance, cost = reached.value, time.process_time() - began
    found: dict[str, Any] = {"method": "transient", "cpu_seconds": cost, "why": counted(len(chain), "state")}
    spread = (max(chance * (1.0 - chance), 0.0)) ** 0.5
    return [(replace(first, **found), sd), (replace(reached, **found), spread)]


def first_by(chain: Chain, goal: Mask, horizon: float) -> tuple[Answer, Answer, float]:
    """The mean and sd of min(T, horizon), tu, with T the time to the goal (N,), and P(T <= horizon).

    Two questions to the chain: for how long it is outside the goal, and whether it is inside at the horizon.
    """
    outside, inside = (BackwardPass(chain.transitions, chain.initial, held.astype(float)) for held in (~goal, goal))
    first, reached = outside.integral(horizon), inside.at(horizon).clipped()
    # from the moments of the time, or of what it leaves of the horizon, whichever is smaller: the difference loses less
    if first.value <= 0.5 * horizon:
        variance = outside.second_moment(horizon) - first.value**2
    else:
        variance = inside.second_moment(horizon, left=True) - inside.integral(horizon).value ** 2
    first = replace(first, value=min(first.value, horizon), high=min(first.high, horizon))
    return first, reached, max(variance, 0.0) ** 0.5


def _exact_yield(model: Model, target: str, possible: int, horizon: float, max_states: int) -> WithSpread | None:
    """Targets at the horizon over those possible; None if the solver refuses."""
    began = time.process_time()
    method = Transient(TOLERANCE, max_states, MAX_SECONDS)
    try:
        end = method.solve(model.network, model.initial, [horizon])
    except ValueError:
        return None
    place = model.network.index(target)
    mean, sd, high = (table[0, place] / possible for table in (end.mean(), end.sd(), end.mean_bounds()[1]))
    low, top, cost = float(mean) - float(high - mean), min(float(high), 1.0), time.process_time() - began
    size = counted(len(end.space), "state")
    return Answer(float(mean), max(low, 0.0), top, kind_of(end.is_bound), "transient", cost, size), float(sd)


def _sampled(
    model: Model, target: str, possible: int, end: float, runs: int, seed: int, first_run: int
) -> tuple[WithSpread, WithSpread, WithSpread]:
    """First target, probability of it by the horizon, and yield, from the same runs, those of `sample_path`."""
    n = whole_number("runs", runs, 2)
    began = time.process_time()
    network, start, method = model.network, model.initial, path_method(model.network)
    forecast_runs(network, method, start, np.array([end]), n)
    until = f"{quoted(target)} >= 1"
    found = method.first_times(network, start, until, end, n, seed, first_run=first_run)
    targets = method.simulate(network, start, [end], n, seed, first_run=first_run)[target][:, 0]
    cost = time.process_time() - began
    return (
        _mean(found.observed, end, cost),
        _mean(found.is_reached.astype(float), 1.0, cost),
        _mean(targets / possible, 1.0, cost),
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
