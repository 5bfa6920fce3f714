"""Adaptive prediction: the cheapest way to an accuracy is found by forecasts, and taken."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from kinetics.markov.transient import Distribution
from kinetics.predicting.accuracy import AskedAccuracy, Reached
from kinetics.predicting.job import Job
from kinetics.predicting.sampled_way import EnoughRuns
from kinetics.predicting.solved_ways import AllStates, Projection, largest_counts
from kinetics.predicting.ways import AccuracyWay, Attained, Goal
from kinetics.sampling.statistics import EnsembleStatistics

WAYS: tuple[type[AccuracyWay], ...] = (AllStates, Projection, EnoughRuns)


class Adapted(NamedTuple):
    """An adaptive prediction, and how its accuracy was reached; is_complete: not interrupted, and within the budget."""

    result: EnsembleStatistics | Distribution
    reached: Reached
    is_complete: bool


def adaptive_prediction(job: Job, asked: AskedAccuracy) -> Adapted:
    """The answer by the way that is forecast to be cheapest.

    A ValueError comes before the work starts if all ways are forecast to take more than the budget.

    Forecasts come from counted work (states, steps, events) and the measured cost of each, never from the clock, so
    that one seed gives one answer on any machine and for any number of threads. In two rounds every way makes its
    forecast, knowing those of the others: a few states are listed, then the first runs made, then more states listed
    for a share of what the runs would cost. A way that is settled is attempted at once; then all are, the cheapest
    first. A projection cannot be forecast: it is tried for a share of what the others would cost.
    """
    most = float(job.model.initial.max(initial=0))
    digit = float(np.spacing(most))
    if asked.of != "distribution" and not asked.is_relative and asked.value < digit:
        raise ValueError(
            f"accuracy = {asked.in_words} of counts up to {most:.3g}, which double precision holds to {digit:.3g}; "
            "ask for no less than that"
        )
    goal = Goal(job, asked, asked.budget, job.bounds(largest_counts(job.model.network, job.model.initial)))
    ways = [way(goal) for way in WAYS]
    try:
        for way in 2 * ways:
            way.forecast(min(each.seconds for each in ways if each is not way))
            found = way.attempt() if way.is_settled else None
            if found is not None:
                return _adapted(goal, ways, way, found)
            way.is_settled = False
        for way in sorted(ways, key=lambda way: way.at_most):
            found = way.attempt() if way.at_most <= asked.budget else None
            if found is not None:
                return _adapted(goal, ways, way, found)
    except KeyboardInterrupt:
        for way in ways:
            found = way.interrupted()
            if found is not None:
                return _adapted(goal, ways, way, found)
        raise
    tried = "; ".join(way.cost.in_words for way in ways)
    advice = next(
        filter(None, (way.advice for way in ways)),
        "ask for less accuracy, for fewer species or times, or allow a larger budget",
    )
    raise ValueError(
        f"an accuracy of {asked.in_words} is beyond the budget of {asked.budget:.3g} s of CPU time: {tried}; {advice}"
    )


def _adapted(goal: Goal, ways: list[AccuracyWay], way: AccuracyWay, found: Attained) -> Adapted:
    """The answer of a way, with what all ways were forecast to cost."""
    tenfold = min(filter(None, (each.tenfold for each in ways)), key=lambda cost: cost.seconds or 0.0, default=None)
    candidates = tuple(each.cost for each in ways)
    reached = Reached(
        goal.asked, found.error, found.is_proven, found.confidence, way.cost.method, candidates, tenfold, found.rare
    )
    return Adapted(found.result, reached, found.is_complete)
