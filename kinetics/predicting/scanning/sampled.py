"""Questions answered by independent runs, each with its interval and, unless it is a quantile, a standard error."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from itertools import islice
from typing import cast

import numpy as np

from kinetics.markov.questions import Question
from kinetics.markov.questions.base import Along, AtTime, Decided
from kinetics.network import Model
from kinetics.network.predicates import Condition
from kinetics.runs import TruncatedRunsError
from kinetics.sampling import Auto
from kinetics.sampling.forecast import forecast_runs
from kinetics.sampling.methods import path_method
from kinetics.support.answer import CONFIDENCE, Answer
from kinetics.support.arrays import Floats
from kinetics.support.tables import counted

Sampling = AtTime | Decided | Along

LEVEL = 0.95
MOST_EVENTS = 10**7  # of a path whose total is asked for


def check_ends(text: str, question: Question) -> None:
    """ValueError if runs of a finite length do not answer the question."""
    if question.sampling is None:
        raise ValueError(f"{text!r} cannot be sampled: {question.unsampled}")


def sampled_answers(model: Model, questions: Sequence[tuple[str, Question]], runs: int, seed: int) -> list[Answer]:
    """The answers of `runs` runs: counts at given times by the method that `Auto` takes, what happens by runs
    that end where it is decided.

    Intervals are at 95 %, see `kinetics.support.estimates`; of means and variances nan if all runs are alike.
    """
    found: dict[Question, Answer] = {}
    asked: dict[Question, Sampling] = {}
    for text, question in questions:
        try:
            check_ends(text, question)
        except ValueError as error:
            found[question] = Answer.none(str(error))
        else:
            asked[question] = cast(Sampling, question.sampling)
    end = max((how.end or 0.0 for how in asked.values()), default=0.0)
    if end:
        forecast_runs(model.network, Auto(many=False), model.initial, np.array([end]), runs)
    at_times = {question: how for question, how in asked.items() if isinstance(how, AtTime)}
    if at_times:
        found |= _timed(list(at_times), lambda some: _at_times(model, [at_times[each] for each in some], runs, seed))
    for question, how in asked.items():
        if isinstance(how, Along):
            found |= _timed([question], lambda _, how=how: _along(model, how, runs, seed))  # type: ignore[misc]
        elif isinstance(how, Decided):
            found |= _timed([question], lambda _, how=how: _decided(model, how, runs, seed))  # type: ignore[misc]
    return [found[question] for _, question in questions]


def _timed(
    questions: Sequence[Question], sampled: Callable[[Sequence[Question]], tuple[list[Floats], str]]
) -> dict[Question, Answer]:
    """The answers of samples that are made together; each bears its share of the time.

    Where one of them has no answer, each is asked alone.
    """
    began = time.process_time()
    try:
        samples, method = sampled(questions)
    except ValueError as error:
        if len(questions) == 1:
            return {questions[0]: Answer.none(str(error))}
        return {question: answer for each in questions for question, answer in _timed([each], sampled).items()}
    seconds = (time.process_time() - began) / len(questions)
    return {each: _answer(each, values, method, seconds) for each, values in zip(questions, samples, strict=True)}


def _at_times(model: Model, asked: Sequence[AtTime], runs: int, seed: int) -> tuple[list[Floats], str]:
    """Values (runs,) of each question at its time, all from the runs of one call."""
    times = np.array(sorted({how.end for how in asked}))
    method = Auto().choose(model.network, model.initial)
    made = method.simulate(model.network, model.initial, times, runs, seed, threads=1)
    if made.truncated is not None:
        raise TruncatedRunsError(made.truncated)
    counts = made.counts
    rows = np.searchsorted(times, [how.end for how in asked])
    return [how.value(model, counts[:, t]) for t, how in zip(rows, asked, strict=True)], method.name


def _decided(model: Model, asked: Decided, runs: int, seed: int) -> tuple[list[Floats], str]:
    """The contribution of each run (runs,) to a question for which runs stop once it is decided."""
    method, until = path_method(model.network), Condition(asked.stop, model)
    found = method.first_times(model.network, model.initial, until, asked.end, runs, seed, threads=1)
    if found.truncated is not None:
        raise TruncatedRunsError(found.truncated)
    return [asked.value(model, found.is_reached, found.counts)], method.name


def _along(model: Model, asked: Along, runs: int, seed: int) -> tuple[list[Floats], str]:
    """The contribution of each run (runs,) along its path up to a time, or until a condition holds."""
    method, last = path_method(model.network), float(np.finfo(float).max) if asked.end is None else asked.end
    until = None if asked.stop is None else Condition(asked.stop, model)
    paths = method.sample_paths(model.network, model.initial, last, seed, max_events=MOST_EVENTS, until=until)
    totals = np.empty(runs)
    for i, path in enumerate(islice(paths, runs)):
        if asked.end is None and path.end == last:
            raise ValueError(f"run {i} ends in a state from which {asked.stop} can never hold: the mean is infinite")
        entered, left = np.append(0.0, path.times), np.append(path.times, path.end)
        totals[i] = asked.value(model, entered, left, path.states)
    return [totals], method.name


def _answer(question: Question, values: Floats, method: str, seconds: float) -> Answer:
    """Value, standard error and bounds of a sample (runs,)."""
    runs, found = len(values), question.estimate(values, LEVEL)
    error = found.standard_error
    why = counted(runs, "run") + (f", standard error {error:.3g}" if error > 0 else "")
    return question.concluded(Answer(found.value, found.low, found.high, CONFIDENCE, method, seconds, why))
