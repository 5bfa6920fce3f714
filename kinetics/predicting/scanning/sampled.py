"""Questions answered by independent runs: means with standard errors, probabilities with exact binomial limits."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from kinetics.formats import NetworkModel
from kinetics.markov.observing import earned_in
from kinetics.markov.queries import AlwaysQuery, Query, RewardQuery, UntilQuery
from kinetics.network.predicates import StateNames, state_names
from kinetics.predicting.scanning.answer import SAMPLED, ScanAnswer
from kinetics.runs import JumpPath, TruncatedRunsError
from kinetics.sampling import Auto
from kinetics.sampling.forecast import forecast_runs
from kinetics.sampling.methods import path_method
from kinetics.support.arrays import Floats
from kinetics.support.intervals import binomial_limits, student_quantile

Q = TypeVar("Q", bound=Query)

LEVEL = 0.95
ROWS = 200_000  # states of paths that conditions are evaluated on at a time
LASTS = "it has no end in time; ask within a time, as in F<=100 or C<=100, or let more states be listed"


def check_ends(question: str, query: Query) -> None:
    """ValueError where runs of a finite length do not answer the question."""
    if _end(query) is None:
        raise ValueError(f"{question!r} cannot be sampled: {LASTS}")


def sampled_answers(
    model: NetworkModel, questions: Sequence[tuple[str, Query]], runs: int, seed: int
) -> list[ScanAnswer]:
    """The answers of `runs` runs: counts at given times by the method that `Auto` takes, what happens by paths.

    Limits hold at 95 %: of probabilities by Clopper & Pearson, of means by Student's t; nan where all runs are alike.
    """
    found: dict[Query, ScanAnswer] = {}
    for question, query in questions:
        try:
            check_ends(question, query)
        except ValueError as error:
            found[query] = ScanAnswer.none(str(error))
    asked = [query for _, query in questions if query not in found]
    at_times = [query for query in asked if isinstance(query, RewardQuery) and query.at is not None]
    on_paths = [query for query in asked if query not in at_times]
    if asked:
        end = max(_end(query) or 0.0 for query in asked)
        forecast_runs(model.network, Auto(many=False), model.initial, np.array([end]), runs)
    if at_times:
        found |= _timed(at_times, lambda some: _at_times(model, some, runs, seed))
    if on_paths:
        found |= _timed(on_paths, lambda some: _on_paths(model, some, runs, seed))
    return [found[query] for _, query in questions]


def _timed(queries: Sequence[Q], sampled: Callable[[Sequence[Q]], tuple[list[Floats], str]]) -> dict[Query, ScanAnswer]:
    """The answers of samples that are made together; each bears its share of the time.

    Where one of them has no answer, each is asked alone.
    """
    began = time.process_time()
    try:
        samples, method = sampled(queries)
    except ValueError as error:
        if len(queries) == 1:
            return {queries[0]: ScanAnswer.none(str(error))}
        return {query: answer for each in queries for query, answer in _timed([each], sampled).items()}
    seconds = (time.process_time() - began) / len(queries)
    return {query: _answer(query, values, method, seconds) for query, values in zip(queries, samples, strict=True)}


def _at_times(model: NetworkModel, queries: Sequence[RewardQuery], runs: int, seed: int) -> tuple[list[Floats], str]:
    """Values (runs,) of each reward at its time."""
    times = np.array(sorted({float(query.at or 0.0) for query in queries}))
    method = Auto().choose(model.network, model.initial)
    made = method.simulate(model.network, model.initial, times, runs, seed, threads=1)
    if made.truncated is not None:
        raise TruncatedRunsError(made.truncated)
    counts = made.counts
    rows = np.searchsorted(times, [float(query.at or 0.0) for query in queries])
    return [
        earned_in(model.network, model.observables, query.name, counts[:, t])
        for t, query in zip(rows, queries, strict=True)
    ], method.name


def _on_paths(model: NetworkModel, queries: Sequence[Query], runs: int, seed: int) -> tuple[list[Floats], str]:
    """Values (runs,) of each question about paths: truths as 1 or 0, or totals."""
    end = max(_end(query) or 0.0 for query in queries)
    method = path_method(model.network)
    paths = method.sample_paths(model.network, model.initial, end, seed)
    samples: list[list[Floats]] = [[] for _ in queries]
    for many in _blocks(paths, runs):
        table = _Visits.of(many)
        names = state_names(model.network, model.observables, table.counts)
        for values, query in zip(samples, queries, strict=True):
            values.append(_judged(table, names, model, query))
    return [np.concatenate(values) for values in samples], method.name


def _blocks(paths: Iterator[JumpPath], runs: int) -> Iterator[list[JumpPath]]:
    """Paths in blocks of not many states."""
    block: list[JumpPath] = []
    rows = 0
    for _ in range(runs):
        block.append(next(paths))
        rows += len(block[-1].times) + 1
        if rows > ROWS:
            yield block
            block, rows = [], 0
    if block:
        yield block


@dataclass(frozen=True)
class _Visits:
    """The states that paths visit, one path after the other.

    counts : (n, S); entered, left : (n,) times; run : (n,) number of the path
    """

    counts: NDArray[np.int64]
    entered: Floats
    left: Floats
    run: NDArray[np.intp]
    runs: int

    @classmethod
    def of(cls, paths: Sequence[JumpPath]) -> _Visits:
        entered = np.concatenate([np.append(0.0, path.times) for path in paths])
        left = np.concatenate([np.append(path.times, path.end) for path in paths])
        run = np.repeat(np.arange(len(paths)), [len(path.times) + 1 for path in paths])
        return cls(np.concatenate([path.states for path in paths]), entered, left, run, len(paths))

    def first(self, marked: NDArray[np.bool_]) -> NDArray[np.intp]:
        """The first marked row of each path (runs,); n where there is none."""
        rows = np.full(self.runs, len(self.run))
        np.minimum.at(rows, self.run[marked], np.flatnonzero(marked))
        return rows


def _judged(visits: _Visits, names: StateNames, model: NetworkModel, query: Query) -> Floats:
    """Whether each path fulfils a question (runs,), or the total that it earns."""
    if isinstance(query, RewardQuery):
        held = np.clip(np.minimum(visits.left, query.up_to or 0.0) - visits.entered, 0.0, None)
        earned = held * earned_in(model.network, model.observables, query.name, visits.counts)
        return np.bincount(visits.run, earned, visits.runs).astype(float)
    if isinstance(query, AlwaysQuery):
        broken = ~names.holds(query.states) & (visits.entered <= (query.by or 0.0))
        return (visits.first(broken) == len(visits.run)).astype(float)
    if not isinstance(query, UntilQuery):
        raise TypeError(f"{query} is not asked of paths")
    reached = visits.first(names.holds(query.target) & (visits.entered <= (query.by or 0.0)))
    if query.through is None:
        return (reached < len(visits.run)).astype(float)
    astray = visits.first(~names.holds(query.through))
    return ((reached < len(visits.run)) & (astray >= reached)).astype(float)


def _end(query: Query) -> float | None:
    """When a run has told what is asked; None where it never has."""
    if isinstance(query, UntilQuery | AlwaysQuery):
        return query.by
    if isinstance(query, RewardQuery):
        return query.at if query.at is not None else query.up_to
    return None


def _answer(query: Query, values: Floats, method: str, seconds: float) -> ScanAnswer:
    """Value, standard error and limits of a sample (runs,)."""
    runs, mean = len(values), float(values.mean())
    error = float(values.std(ddof=1) / np.sqrt(runs)) if runs > 1 else float("nan")
    if isinstance(query, RewardQuery):
        half = student_quantile(runs - 1, LEVEL) * error if error > 0 else np.nan
        low, high = mean - half, mean + half
    else:
        low, high = map(float, binomial_limits(values.sum(), runs, LEVEL))
    return ScanAnswer(mean, low, high, SAMPLED, method, seconds, standard_error=error, runs=runs)
