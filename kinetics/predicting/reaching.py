"""The cheapest way to an accuracy: a solution with its bound, or runs until they are enough."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from math import inf
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from kinetics.markov.transient import Distribution, FiniteStateProjection, Transient
from kinetics.markov.transient.search import MAX_STATES
from kinetics.markov.transient.states import StateSpace, reachable
from kinetics.markov.transient.transitions import Transitions
from kinetics.network import Network
from kinetics.predicting.accuracy import LEAST, LEVEL, TENFOLD, AskedAccuracy, ForetoldWay, Reached
from kinetics.predicting.enough_runs import FIRST_SECONDS, RunsUntil, Sampled
from kinetics.predicting.observables import Observables
from kinetics.predicting.run_cost import FIRST_RUNS, STATISTICS, first_runs
from kinetics.predicting.scouts import send_scouts
from kinetics.predicting.solved_errors import error_reached, is_endless, largest_counts, tolerance_for
from kinetics.runs import EnsembleStatistics
from kinetics.sampling import Auto
from kinetics.support.arrays import Floats, Ints
from kinetics.support.cli.progress import progress_line

BUDGET = 1200.0  # s
FEW_STATES = 1000  # listed before anything else is tried
LIST_SECONDS, LIST_SPECIES = 3e-7, 3.3e-8  # of a state, on a common machine: at least; for each species
SOLVE_SECONDS, TIME_SECONDS = 8e-4, 2e-5  # of a solution, however few its states; of each of its times
LISTING = 0.05  # of what runs are foretold to cost: may be spent on the list of states
QUICK = 3e-3  # s; a solution foretold to take no more is not weighed against runs, which would cost as much to try
FOLLOWING = 0.5  # of the cost of a solution: may be spent on the first runs
TRIED = 0.01  # s; where all else is foretold to cost more, a projection is tried
LANES = 8  # runs that a vector holds, and that cost as much as one of them
TRIAL = 0.2  # of that: done before the rest of a projection is foretold
PROJECTING = 0.5  # of that cost: may be spent on it


class AskedCounts(NamedTuple):
    """What is asked: counts of `model`, or `observables` of it, from `start` (S,) at `grid` (T,)."""

    model: Network
    start: Ints
    grid: Floats
    observables: Observables | None = None

    @property
    def shown(self) -> Network:
        """The network whose counts the answer gives."""
        return self.model if self.observables is None else self.observables.network

    def of_distribution(self, found: Distribution) -> Distribution:
        """The distribution of what is shown."""
        return found if self.observables is None else self.observables.of_distribution(found)

    def of_counts(self, tops: Floats) -> Floats:
        """Limits on what is shown, from those on the counts (S,)."""
        if self.observables is None:
            return tops
        weights = self.observables.weights
        terms = np.where(weights > 0, tops[:, None], 0.0)
        return (weights * terms).sum(axis=0)

    @property
    def is_known(self) -> NDArray[np.bool_]:
        """(T, V) what is shown and no matter of chance: all at time 0, and at any time what nothing changes."""
        model = self.model
        moves: NDArray[np.bool_] = np.bincount(model.sparse_stoichiometry.columns, minlength=len(model.species)) > 0
        for event in model.events:
            moves[[model.index(name) for name in event.assign]] = True
        if self.observables is not None:
            moves = np.any(self.observables.weights[moves] > 0, axis=0)
        return (self.grid == 0.0)[:, None] | ~moves


class ReachedAnswer(NamedTuple):
    """The answer and how it was reached; is_complete: not interrupted, and within the budget."""

    result: EnsembleStatistics | Distribution
    reached: Reached
    method: str
    is_complete: bool


def reach(
    question: AskedCounts,
    asked: AskedAccuracy,
    seed: int = 0,
    threads: int | None = None,
    budget: float = BUDGET,
    report: Callable[[str], None] = lambda _: None,
) -> ReachedAnswer:
    """The answer by the way that is foretold to be cheapest.

    budget : s of processor time; a ValueError before the work starts, where all ways are foretold to take more

    Foretold costs come from counted work (states, steps, events) and measured costs of each, never from the clock, so
    that the same seed gives the same answer on any machine and for any number of threads. Up to `FEW_STATES` states are
    listed first; a solution that is foretold to be quick is taken at once. Else a few runs foretell how many are
    needed; more states are listed for at most `LISTING` of what those would cost. A projection cannot be foretold: it
    is tried for at most `PROJECTING` of what the best of the others would cost, and ends itself where it sees that it
    will take longer.
    """
    digit = float(np.spacing(float(question.start.max(initial=0))))
    if asked.of != "distribution" and not asked.is_relative and asked.value < digit:
        raise ValueError(
            f"accuracy = {asked.in_words} of counts up to {float(question.start.max()):.3g}, which doubles hold within "
            f"{digit:.3g}; ask for no less than that"
        )
    return _Reaching(question, asked, seed, threads, budget, report).answer()


class _Reaching:
    def __init__(
        self, question: AskedCounts, asked: AskedAccuracy, seed: int, threads: int | None, budget: float,
        report: Callable[[str], None],
    ) -> None:  # fmt: skip
        self.question, self.asked, self.seed, self.threads = question, asked, seed, threads
        self.budget, self.report = budget, report
        self.space: StateSpace | None = None
        self.transitions: Transitions | None = None
        self.exact = ForetoldWay(Transient.name, None)
        self.projection = ForetoldWay(FiniteStateProjection.name, None, "not tried")
        self.sampling = ForetoldWay(Auto.name, None, "not weighed")
        self.runs: RunsUntil | None = None
        self.run_seconds = inf

    def answer(self) -> ReachedAnswer:
        """By the cheapest way; by the next where a solution does not prove enough."""
        self._list(FEW_STATES, self.budget)
        if self.exact.seconds is not None and self.exact.seconds <= QUICK:
            made = self._solve()
            if made:
                return made
        try:
            self._weigh_sampling()
            if self.runs is not None and self.runs.error <= self.asked.value:  # the few that were followed are enough
                return self._sample()
            made = self._weigh_solutions()
        except KeyboardInterrupt:
            if self.runs is None:
                raise
            return self._sampled(self.runs.interrupted())
        return made or self._sample()

    def _weigh_solutions(self) -> ReachedAnswer | None:
        """By a solution where that is foretold to be cheaper than runs, or turns out to be."""
        if self.space is None and self.sampling.seconds is not None:
            limit = min(self.sampling.seconds, self.budget)
            each = max(LIST_SECONDS, LIST_SPECIES * len(self.question.model.species))
            allowed = int(min(LISTING * limit / each, MAX_STATES))
            if allowed > FEW_STATES:
                self._list(allowed, limit)
        best = min(_cost(self.exact), _cost(self.sampling))
        made = self._project(min(PROJECTING * best, self.budget)) if best > TRIED else None
        if not made and _cost(self.exact) <= min(_cost(self.sampling), self.budget):
            made = self._solve()
        return made

    def _list(self, most: int, limit: float) -> None:
        """List so many states, and foretell the solution over them; one of more seconds than `limit` is none."""
        model, start, grid, _ = self.question
        if is_endless(model):
            self.exact = self.exact._replace(remark="its states have no end")
            return
        self.report(f"listing up to {most} states")
        try:
            space = reachable(model, start, max_states=most)
        except ValueError as refusal:
            over = f"over {most} states" if str(refusal).startswith("over ") else str(refusal)
            self.exact = self.exact._replace(remark=over)
            return
        self.space, self.transitions = space, space.transitions()
        try:
            seconds, is_proven = Transient(max_seconds=limit).foretold(self.transitions, float(grid[-1]))
        except ValueError as refusal:
            self.exact = self.exact._replace(remark=str(refusal))
            return
        states = f"{len(space)} states"
        if not is_proven:
            remark = (
                f"{states}, over {limit:.2g} s" if seconds == inf else f"{states}, but its error would not be proven"
            )
            self.exact = self.exact._replace(remark=remark)
            return
        floor = error_reached(self.asked, self._first(space), self._tops()) if seconds < inf else inf
        if floor > self.asked.value:
            self.exact = self.exact._replace(remark=f"{states}, whose rounding alone is more")
            return
        seconds += SOLVE_SECONDS + TIME_SECONDS * grid.size
        self.exact = ForetoldWay(Transient.name, seconds, states)

    def _first(self, space: StateSpace) -> Distribution:
        """The distribution at time 0 with the least error that a solution has."""
        return self.question.of_distribution(Distribution(space, self.question.grid[:1], np.eye(1, len(space)), 1e-15))

    def _tops(self) -> Floats:
        """Largest counts of what is shown, as far as they are known."""
        model, start, *_ = self.question
        tops = largest_counts(model, start) if self.space is None else self.space.states.max(axis=0).astype(float)
        return self.question.of_counts(tops)

    def _weigh_sampling(self) -> None:
        """Foretell the runs that are needed, and their cost."""
        model, start, grid, observables = self.question
        shown = self.question.shown
        try:
            method = Auto().choose(model, start)
        except ValueError as refusal:
            self.sampling = ForetoldWay(Auto.name, None, str(refusal))
            return
        name = f"{Auto.name} ({method.name})"
        self.report("following a few runs")
        dearest = min(FOLLOWING * _cost(self.exact), self.budget) / FIRST_RUNS
        source = method.source(model, start, self.seed)
        each, counts, seen = first_runs(
            model, method, source, grid, grid.size * len(shown.species), dearest, self.threads
        )
        if counts is None or seen is None or each > dearest:
            least = FIRST_RUNS * each
            self.sampling = ForetoldWay(name, None, f"over {least:.2g} s for {FIRST_RUNS} runs alone")
            self.run_seconds = each
            return
        if observables is not None:
            source, counts = replace(source, weights=observables.weights), counts @ observables.weights
        scouting = partial(
            send_scouts, model, source, seen, grid, max(FIRST_RUNS, int(FIRST_SECONDS / each)), self.seed
        )
        self.runs = RunsUntil(
            self.asked, shown, source, grid, self.question.is_known, self.seed, self.threads, self.report, each,
            counts, name, LANES if method.is_for_ensembles else 1, scouting,
        )  # fmt: skip
        needed = max(self.runs.foretell(), self.runs.tally.runs)
        self.run_seconds = each
        self.sampling = ForetoldWay(name, STATISTICS + needed * each, f"about {needed:.3g} runs")

    def _project(self, most: float) -> ReachedAnswer | None:
        """By a projection, if it proves enough within `most` seconds."""
        model, start, grid, _ = self.question
        tops = self._tops()
        if self.asked.of != "distribution" and not np.isfinite(tops).all():
            self.projection = self.projection._replace(remark="nothing limits the counts outside its states")
            return None
        least = FiniteStateProjection.least_tolerance or 0.0
        tolerance = min(max(tolerance_for(self.asked, tops) / 2, least), 1e-3)
        self.report("trying a projection")
        began = time.process_time()
        try:
            method = FiniteStateProjection(tolerance, max_seconds=most, trial=TRIAL)
            with progress_line(shown=False):  # it may be given up, long before it would end
                found = self.question.of_distribution(method.solve(model, start, grid))
        except ValueError:
            self.projection = self.projection._replace(remark=f"given up: over {most:.2g} s, or too many states")
            return None
        self.projection = ForetoldWay(method.name, time.process_time() - began, "as it took")
        return self._solved(self.projection, found, tops)

    def _solve(self) -> ReachedAnswer | None:
        """By the solution over all states, if it proves enough."""
        if self.space is None or self.transitions is None:
            return None
        self.report(f"solving {len(self.space)} states")
        grid = self.question.grid
        try:
            table = Transient().probabilities(self.transitions, np.eye(1, len(self.space))[0], grid, self.space)
        except ValueError as refusal:
            self.exact = ForetoldWay(self.exact.method, None, str(refusal))
            return None
        found = self.question.of_distribution(Distribution(self.space, grid, *table))
        return self._solved(self.exact, found, self._tops())

    def _solved(self, way: ForetoldWay, found: Distribution, tops: Floats) -> ReachedAnswer | None:
        error = error_reached(self.asked, found, tops)
        if error > self.asked.value:
            remark = f"proves {self.asked.words(error)} only" if error < inf else "its error is not proven"
            refused = ForetoldWay(way.method, None, remark)
            self.exact, self.projection = (refused, self.projection) if way is self.exact else (self.exact, refused)
            return None
        more = way if error <= self.asked.value / TENFOLD else self._tenfold_sampling()
        reached = Reached(self.asked, error, True, 1.0, way.method, self._candidates(), more)
        return ReachedAnswer(found, reached, way.method, True)

    def _sample(self) -> ReachedAnswer:
        """By runs until they are enough; a ValueError where that is beyond the budget."""
        if self.runs is None or self.sampling.seconds is None or self.sampling.seconds > self.budget:
            raise ValueError(self._refusal())
        most = max(int(self.budget / self.run_seconds), FIRST_RUNS)
        return self._sampled(self.runs.finish(most))

    def _sampled(self, made: Sampled) -> ReachedAnswer:
        """The answer that runs give."""
        statistics, error = made
        is_proven, name = self.asked.of == "distribution", self.sampling.method
        needed = inf if self.runs is None else self.runs.needed
        needed = max(min(statistics.runs * (error / self.asked.value) ** 2, needed), FIRST_RUNS / TENFOLD**2)
        tenfold = self._tenfold_sampling(STATISTICS / TENFOLD**2 + needed * self.run_seconds)
        if self.exact.seconds is not None:
            tenfold = min([self.exact, *filter(None, [tenfold])], key=_cost)
        seldom = "" if self.runs is None else self.runs.seldom
        reached = Reached(self.asked, error, is_proven, LEVEL, name, self._candidates(), tenfold, seldom)
        return ReachedAnswer(statistics, reached, name, statistics.is_complete and error <= self.asked.value)

    def _tenfold_sampling(self, seconds: float | None = None) -> ForetoldWay | None:
        spent = self.sampling.seconds if seconds is None else seconds
        if spent is None or self.asked.value / TENFOLD < LEAST:
            return None
        return ForetoldWay(self.sampling.method, TENFOLD**2 * spent)

    def _candidates(self) -> tuple[ForetoldWay, ...]:
        return self.exact, self.projection, self.sampling

    def _refusal(self) -> str:
        """Why nothing reaches the accuracy, and what would."""
        ways = "; ".join(each.in_words for each in self._candidates())
        advice = "ask for less, for fewer species or times, or allow more"
        seconds = self.sampling.seconds
        if seconds is not None:
            within = 1.1 * self.asked.value * (seconds / self.budget) ** 0.5
            advice = f"allow more, or ask for {self.asked.words(within)}, which runs may reach"
        return (
            f"an accuracy of {self.asked.in_words} is beyond the budget of {self.budget:.3g} s of CPU time: {ways}; "
            f"{advice}"
        )


def _cost(way: ForetoldWay) -> float:
    return inf if way.seconds is None else way.seconds
