"""Questions answered by independent runs: means with standard errors, probabilities with exact binomial bounds."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from itertools import islice
from typing import TypeVar

import numpy as np

from kinetics.markov.observing import reward_rates
from kinetics.markov.queries import AlwaysQuery, Query, RewardQuery, UntilQuery
from kinetics.network import Model
from kinetics.network.predicates import Condition
from kinetics.runs import TruncatedRunsError
from kinetics.sampling import Auto
from kinetics.sampling.forecast import forecast_runs
from kinetics.sampling.methods import path_method
from kinetics.support.answer import CONFIDENCE, Answer
from kinetics.support.arrays import Floats
from kinetics.support.intervals import binomial_limits, student_quantile
from kinetics.support.tables import counted

Q = TypeVar("Q", bound=Query)

LEVEL = 0.95
MOST_EVENTS = 10**7  # of a path whose total is asked for
LASTS = "it has no end in time; ask within a time, as in F<=100 or C<=100, or let more states be listed"


def check_ends(question: str, query: Query) -> None:
    """ValueError where runs of a finite length do not answer the question."""
    is_until = isinstance(query, RewardQuery) and query.until is not None
    if _end(query) is None and not is_until:
        raise ValueError(f"{question!r} cannot be sampled: {LASTS}")


def sampled_answers(model: Model, questions: Sequence[tuple[str, Query]], runs: int, seed: int) -> list[Answer]:
    """The answers of `runs` runs: counts at given times by the method that `Auto` takes, what happens by runs
    that end where it is decided.

    Limits hold at 95 %: of probabilities by Clopper & Pearson, of means by Student's t; nan where all runs are alike.
    """
    found: dict[Query, Answer] = {}
    for question, query in questions:
        try:
            check_ends(question, query)
        except ValueError as error:
            found[query] = Answer.none(str(error))
    asked = [query for _, query in questions if query not in found]
    at_times = [query for query in asked if isinstance(query, RewardQuery) and query.at is not None]
    end = max((_end(query) or 0.0 for query in asked), default=0.0)
    if end:
        forecast_runs(model.network, Auto(many=False), model.initial, np.array([end]), runs)
    if at_times:
        found |= _timed(at_times, lambda some: _at_times(model, some, runs, seed))
    for query in asked:
        if isinstance(query, RewardQuery) and query not in at_times:
            found |= _timed([query], lambda some: _earned(model, some[0], runs, seed))
        elif isinstance(query, UntilQuery | AlwaysQuery):
            found |= _timed([query], lambda some: _decided(model, some[0], runs, seed))
    return [found[query] for _, query in questions]


def _timed(queries: Sequence[Q], sampled: Callable[[Sequence[Q]], tuple[list[Floats], str]]) -> dict[Query, Answer]:
    """The answers of samples that are made together; each bears its share of the time.

    Where one of them has no answer, each is asked alone.
    """
    began = time.process_time()
    try:
        samples, method = sampled(queries)
    except ValueError as error:
        if len(queries) == 1:
            return {queries[0]: Answer.none(str(error))}
        return {query: answer for each in queries for query, answer in _timed([each], sampled).items()}
    seconds = (time.process_time() - began) / len(queries)
    return {query: _answer(query, values, method, seconds) for query, values in zip(queries, samples, strict=True)}


def _at_times(model: Model, queries: Sequence[RewardQuery], runs: int, seed: int) -> tuple[list[Floats], str]:
    """Values (runs,) of each reward at its time."""
    times = np.array(sorted({float(query.at or 0.0) for query in queries}))
    method = Auto().choose(model.network, model.initial)
    made = method.simulate(model.network, model.initial, times, runs, seed, threads=1)
    if made.truncated is not None:
        raise TruncatedRunsError(made.truncated)
    counts = made.counts
    rows = np.searchsorted(times, [float(query.at or 0.0) for query in queries])
    return [reward_rates(model, query.name, counts[:, t]) for t, query in zip(rows, queries, strict=True)], method.name


def _decided(model: Model, query: UntilQuery | AlwaysQuery, runs: int, seed: int) -> tuple[list[Floats], str]:
    """Whether each run fulfils a question (runs,), 1 or 0: it ends where that is decided."""
    method = path_method(model.network)
    target, through = (query.target, query.through) if isinstance(query, UntilQuery) else (None, query.states)
    parts = [f"({target})"] * (target is not None) + [f"!({through})"] * (through is not None)
    until = Condition(" | ".join(parts), model)
    found = method.simulate(model.network, model.initial, query.by or 0.0, runs, seed, threads=1, until=until)
    if found.truncated is not None:
        raise TruncatedRunsError(found.truncated)
    if target is None:
        return [(~found.is_reached).astype(float)], method.name
    fulfils = found.is_reached & Condition(target, model).holds(found.counts)
    return [fulfils.astype(float)], method.name


def _earned(model: Model, query: RewardQuery, runs: int, seed: int) -> tuple[list[Floats], str]:
    """The total (runs,) that each path earns up to a time, or until a condition holds."""
    method, network, last = path_method(model.network), model.network, float(query.up_to or 0.0)
    until = None
    if query.until is not None:
        until, last = Condition(query.until, model), float(np.finfo(float).max)
    paths = method.sample_paths(network, model.initial, last, seed, max_events=MOST_EVENTS, until=until)
    totals = np.empty(runs)
    for i, path in enumerate(islice(paths, runs)):
        if until is not None and path.end == last:
            raise ValueError(f"run {i} ends where {query.until} can never hold: the mean is infinite")
        held = np.diff(np.concatenate([[0.0], path.times, [path.end]]))
        totals[i] = np.cumsum(held * reward_rates(model, query.name, path.states))[-1]
    return [totals], method.name


def _end(query: Query) -> float | None:
    """When a run has told what is asked; None where it never has."""
    if isinstance(query, UntilQuery | AlwaysQuery):
        return query.by
    if isinstance(query, RewardQuery):
        return query.at if query.at is not None else query.up_to
    return None


def _answer(query: Query, values: Floats, method: str, seconds: float) -> Answer:
    """Value, standard error and bounds of a sample (runs,)."""
    runs, mean = len(values), float(values.mean())
    error = float(values.std(ddof=1) / np.sqrt(runs)) if runs > 1 else float("nan")
    if isinstance(query, RewardQuery):
        half = student_quantile(runs - 1, LEVEL) * error if error > 0 else np.nan
        low, high = mean - half, mean + half
    else:
        low, high = map(float, binomial_limits(values.sum(), runs, LEVEL))
    why = counted(runs, "run") + (f", standard error {error:.3g}" if error > 0 else "")
    return Answer(mean, low, high, CONFIDENCE, method, seconds, why)
