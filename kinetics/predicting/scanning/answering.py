"""The answers at one point of a scan: exact where its states can be listed, sampled elsewhere."""

from __future__ import annotations

import time
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from kinetics.markov.chain import Chain
from kinetics.markov.observing import observing
from kinetics.markov.questions import Question, parse
from kinetics.markov.transient.search import TooManyStatesError
from kinetics.network import Model
from kinetics.network.network import is_homogeneous
from kinetics.network.predicates import state_names
from kinetics.predicting.scanning.sampled import check_ends, sampled_answers
from kinetics.support.answer import Answer
from kinetics.support.stream_keys import seed_of


@dataclass(frozen=True)
class ScanRequest:
    """The questions to ask at every point of a scan, and how.

    max_states : a point is sampled if more can be reached, or if rates depend on time; 0: always
    truncate : condition of the states that a chain is truncated to, or their number; None for all
    runs, seed : of points that are sampled
    """

    questions: tuple[str, ...]
    max_states: int
    truncate: str | int | None
    runs: int
    seed: int

    @property
    def queries(self) -> list[tuple[str, Question]]:
        """Every question with what it was read as."""
        return [(question, parse(question)) for question in self.questions]

    def key(self, model: Model) -> str:
        """A text of all that the answers at a point depend on: two points with one key have the same answers."""
        return f"{model.digest} {self!r}"

    def stream(self, model: Model) -> int:
        """Seed of the runs at a point: by the model there, so that points are independent, in any grid and order."""
        return seed_of(f"scan {self.seed} {model.digest}")


def answers_at(model: Model, asked: ScanRequest, point: Mapping[str, float]) -> list[Answer]:
    """The answers at one point; those that a question does not have there say why."""
    model = model.at(point)
    try:
        exact = _exact(model, asked)
        if exact is not None:
            return exact
        return sampled_answers(model, asked.queries, asked.runs, asked.stream(model))
    except ValueError as error:
        return [Answer.none(str(error)) for _ in asked.questions]


def check_asked(model: Model, asked: ScanRequest) -> None:
    """A ValueError for what no point can answer: names that there are not, or no end where all are sampled."""
    for question, query in asked.queries:
        if not asked.max_states:
            check_ends(question, query)
        query.check(model)
    if isinstance(asked.truncate, str):
        state_names(model, np.asarray(model.initial)[np.newaxis]).holds(asked.truncate)


def _exact(model: Model, asked: ScanRequest) -> list[Answer] | None:
    """The answers of the chain; None if it has too many states, or none because rates depend on time."""
    if not asked.max_states or not is_homogeneous(model.network):
        return None
    began = time.process_time()
    try:
        chain = Chain.of(model, max_states=asked.max_states, truncate=asked.truncate)
    except TooManyStatesError:
        return None
    chain = observing(chain, model)
    listed = (time.process_time() - began) / len(asked.questions)
    found = []
    for _, query in asked.queries:
        try:
            answer = query.value(chain)
            found.append(replace(answer, cpu_seconds=answer.cpu_seconds + listed))
        except ValueError as error:
            found.append(Answer.none(str(error)))
    return found


def tell_questions(questions: Sequence[str]) -> tuple[str, ...]:
    """The questions, each readable and none asked twice; a ValueError if not."""
    given = tuple(questions) if isinstance(questions, Iterable) and not isinstance(questions, str) else (questions,)
    if not given:
        raise ValueError("no question; give one, as in 'E[AB] @ 100' or 'P=? [ F<=100 AB >= 5 ]'")
    for question in given:
        parse(question)
        if given.count(question) > 1:
            raise ValueError(f"{question!r} is asked twice; ask it once")
    return given
