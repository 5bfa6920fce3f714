"""Curves of the accuracy diagram, one per method, each with its settings from cheap to expensive.

`predict --accuracy` has one over the accuracies of means that it is asked for; its points say what it chose. Every
solving method has its curve from `SOLVING_METHODS`; any other is a line in `CURVES`. Of the exact sampling methods
three are there, since all make the same error with the same number of runs and differ in cost alone: on networks so
small that they can be solved, `Direct` costs the least of those that make a run at a time, `Lockstep` the least of all,
and `Leaping`, made for larger counts, no more than `Direct`.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import NamedTuple, TypeVar

from kinetics.markov.transient import SOLVING_METHODS, Distribution, SolvingMethod
from kinetics.network import Model, Network
from kinetics.predicting.accuracy import AskedAccuracy
from kinetics.predicting.adaptive import adaptive_prediction
from kinetics.predicting.job import Job
from kinetics.sampling import Direct, Leaping, Lockstep, SamplingMethod
from kinetics.sampling.statistics import EnsembleStatistics
from kinetics.sampling.streamed import streamed
from kinetics.support.arrays import Floats, Ints
from kinetics.trust.accuracy.distances import Certainty, Marginals
from kinetics.trust.accuracy.peers import ExpmMultiply, rate_equation

MOST_REPEATS, FEWEST_REPEATS = 20, 2
ALL_RUNS = 500_000  # as many repeats as make so many runs together, within these limits
SOLUTIONS = 3  # of the same, for their time


class Task(NamedTuple):
    """The task of every method: the distribution of each species at `times` (T,), tu."""

    network: Network
    initial: Ints
    times: Floats
    seed: int


Result = EnsembleStatistics | Distribution | Floats
Answered = TypeVar("Answered", bound=EnsembleStatistics | Distribution)


@dataclass(frozen=True)
class Curve:
    """A method and the setting that varies.

    settings : of the knob, from the cheapest on; one that is meaningless if there is no knob
    make : the answer to a task at a setting; the repeat tells which runs, where chance is involved
    """

    name: str
    knob: str
    settings: tuple[float, ...]
    make: Callable[[Task, float, int], Result]

    @property
    def is_sampled(self) -> bool:
        """Does the error come from chance?"""
        return self.knob == "runs"

    def repeats(self, setting: float) -> int:
        """How often a setting is tried: for the spread of a sampled one, for the time of another."""
        if not self.is_sampled:
            return SOLUTIONS
        return min(MOST_REPEATS, max(FEWEST_REPEATS, int(ALL_RUNS / setting)))

    def label(self, setting: float) -> str:
        """The setting as people read it."""
        return f"{setting:.0e}".replace("e+0", "e").replace("e-0", "e-") if self.knob else ""


def sampled(method: SamplingMethod) -> Callable[[Task, float, int], Result]:
    """`Curve.make` of a method that samples; the knob is the number of runs."""

    def make(task: Task, setting: float, repeat: int) -> EnsembleStatistics:
        runs = int(setting)
        # No run is used twice: settings are powers of ten, and 40 times one stays below 20 times the next.
        first_run = (MOST_REPEATS + repeat) * runs
        network, initial, times, seed = task
        source = method.source(network, network.state(initial), seed)
        return _whole(streamed(network, source, times, runs, 1, first_run, covariances=False))

    return make


def _whole(made: Answered) -> Answered:
    """A complete result, as it is; a KeyboardInterrupt if Ctrl-C left fewer runs than asked for."""
    if isinstance(made, EnsembleStatistics) and not made.is_complete:
        raise KeyboardInterrupt
    return made


def solved(method: Callable[[float], SolvingMethod]) -> Callable[[Task, float, int], Result]:
    """`Curve.make` of a method that solves; `method` makes it from the knob's setting."""
    return lambda task, setting, _: method(setting).solve(task.network, task.initial, task.times)


def solver_curve(method: type[SolvingMethod]) -> Curve:
    """The curve of a solving method: over its tolerances if it has one, else a single point."""
    kind: Callable[..., SolvingMethod] = method
    if method.tried_up_to is not None:
        kind = partial(kind, max_states=method.tried_up_to)
    if method.least_tolerance is None:
        return Curve(method.name, "", NO_KNOB, solved(lambda _: kind()))
    settings = tuple(each for each in TOLERANCES if each >= method.least_tolerance)
    return Curve(method.name, "tolerance", settings, solved(lambda setting: kind(tolerance=setting)))


def asked(task: Task, setting: float, _: int) -> Result:
    """The answer of `predict`, by its own choice of method, at this share of the largest mean of each species."""
    job = Job(Model(task.network, task.initial), task.times, seed=task.seed, threads=1)
    return _whole(adaptive_prediction(job, AskedAccuracy(setting, is_relative=True)).result)


ACCURACIES = (1e-1, 3e-2, 1e-2, 1e-3)
RUNS = (1e2, 1e3, 1e4, 1e5, 1e6)
TOLERANCES = (1e-2, 1e-4, 1e-6, 1e-8, 1e-10, 1e-12)
NO_KNOB = (0.0,)

CURVES: tuple[Curve, ...] = (
    Curve("SSA, direct", "runs", RUNS, sampled(Direct())),
    Curve("SSA, lockstep", "runs", RUNS, sampled(Lockstep())),
    Curve("SSA, leaping", "runs", RUNS, sampled(Leaping())),
    *map(solver_curve, SOLVING_METHODS),
    Curve("predict --accuracy", "accuracy", ACCURACIES, asked),
    Curve("scipy expm_multiply", "", NO_KNOB, solved(lambda _: ExpmMultiply())),
    Curve("rate equation", "", NO_KNOB, lambda task, *_: rate_equation(task.network, task.initial, task.times)),
)


def shape_of(result: Result, species: tuple[str, ...]) -> Marginals | Certainty:
    """The shape of an answer: a distribution for each species, or a number only."""
    if isinstance(result, EnsembleStatistics | Distribution):
        return Marginals.of(result, species)
    return Certainty(result)
