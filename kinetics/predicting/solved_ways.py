"""Ways to an accuracy by solutions with a proven error: over all states, and over the likely ones."""

from __future__ import annotations

import time
from math import inf

import numpy as np

from kinetics.kernels.leap_limits import LARGEST_COUNT
from kinetics.markov.transient import Distribution, FiniteStateProjection, Transient
from kinetics.markov.transient.distribution import SLACK
from kinetics.markov.transient.search import MAX_STATES
from kinetics.markov.transient.states import StateSpace, reachable
from kinetics.markov.transient.transitions import Transitions
from kinetics.network import Network
from kinetics.predicting import tuning
from kinetics.predicting.accuracy import AskedAccuracy, CostForecast
from kinetics.predicting.ways import AccuracyWay, Attained, Goal
from kinetics.support.arrays import Floats, Ints, divided
from kinetics.support.cli.progress import progress_line


class SolvedWay(AccuracyWay):
    """A solution, which is an answer if its proven error is as small as was asked for."""

    def __init__(self, goal: Goal) -> None:
        super().__init__(goal)
        self.error = inf

    @property
    def tenfold(self) -> CostForecast | None:
        """The solution itself, if it proves a tenth of the error; one that was not made may."""
        return self.cost if self.seconds < inf and self.error <= self.goal.asked.value / tuning.TENFOLD else None

    def judged(self, found: Distribution) -> Attained | None:
        """The answer, if it proves enough."""
        asked = self.goal.asked
        self.error = error_reached(asked, found, self.goal.tops)
        if self.error <= asked.value:
            return Attained(found, self.error)
        remark = f"proves {asked.words(self.error)} only" if self.error < inf else "its error is not proven"
        self.cost = CostForecast(self.name, None, remark)
        return None


class AllStates(SolvedWay):
    """The solution over all states, which are listed first: a few at once, more if runs are expensive."""

    name = Transient.name

    def __init__(self, goal: Goal) -> None:
        super().__init__(goal)
        self.error = 0.0  # until a solution gives a better bound
        self.space: StateSpace | None = None
        self.transitions: Transitions | None = None
        self.is_tried = False

    def forecast(self, rivals: float) -> None:
        """List states, and forecast the solution over them from its counted steps."""
        limit = min(rivals, self.goal.budget)
        if not self.is_tried:
            self.is_tried = True
            self._list(tuning.FEW_STATES, limit)
            self.is_settled = self.seconds <= tuning.QUICK
        elif self.space is None and rivals < inf:
            each = max(tuning.LIST_SECONDS, tuning.LIST_SPECIES * len(self.goal.job.model.network.species))
            most = int(min(tuning.LISTING * limit / each, MAX_STATES))
            if most > tuning.FEW_STATES:
                self._list(most, limit)

    def _list(self, most: int, limit: float) -> None:
        """List so many states, and forecast a solution of at most `limit` s."""
        goal, job = self.goal, self.goal.job
        if is_endless(job.model.network):
            self.cost = self.cost._replace(remark="infinitely many states")
            return
        job.report(f"enumerating up to {most} states")
        try:
            space = reachable(job.model.network, job.model.initial, max_states=most)
        except ValueError as refusal:
            over = f"over {most} states" if str(refusal).startswith("over ") else str(refusal)
            self.cost = self.cost._replace(remark=over)
            return
        self.space, self.transitions = space, space.transitions()
        goal.tops, goal.is_listed = job.bounds(space.states.max(axis=0).astype(float)), True
        seconds, remark = self._solution(space, self.transitions, limit)
        self.cost = CostForecast(self.name, seconds, remark)

    def _solution(self, space: StateSpace, transitions: Transitions, limit: float) -> tuple[float | None, str]:
        """Forecast cost of a solution of at most `limit` s, and a remark; None if it would not prove enough."""
        goal, job, states = self.goal, self.goal.job, f"{transitions.size} states"
        try:
            seconds, is_proven = Transient(max_seconds=limit).forecast(transitions, float(job.grid[-1]))
        except ValueError as refusal:
            return None, str(refusal)
        if seconds == inf:
            return None, f"{states}, over {limit:.2g} s"
        if not is_proven:
            return None, f"{states}, but its error would not be proven"
        at_best = job.distribution(Distribution(space, job.grid[:1], np.eye(1, len(space)), 1e-15))  # at time 0
        if error_reached(goal.asked, at_best, goal.tops) > goal.asked.value:
            return None, f"{states}, whose rounding alone is more"
        return seconds + tuning.SOLVE_SECONDS + tuning.TIME_SECONDS * job.grid.size, states

    def attempt(self) -> Attained | None:
        """Solve the master equation."""
        job, space = self.goal.job, self.space
        if space is None or self.transitions is None:
            return None
        job.report(f"solving {len(space)} states")
        try:
            table = Transient().probabilities(self.transitions, np.eye(1, len(space))[0], job.grid, space)
        except ValueError as refusal:
            self.cost = CostForecast(self.name, None, str(refusal))
            return None
        return self.judged(job.distribution(Distribution(space, job.grid, *table)))


class Projection(SolvedWay):
    """A finite state projection. Its cost shows only as it goes: it is tried for a share of what the others cost."""

    name = FiniteStateProjection.name
    remark = "not tried"

    def __init__(self, goal: Goal) -> None:
        super().__init__(goal)
        self._at_most = inf

    @property
    def at_most(self) -> float:
        """The time, s, after which an attempt is given up."""
        return self._at_most

    def forecast(self, rivals: float) -> None:
        """Settle how long it is tried; not at all if another way is cheap."""
        self._at_most = min(tuning.PROJECTING * rivals, self.goal.budget) if rivals > tuning.TRIED else inf

    def attempt(self) -> Attained | None:
        """Project, and give up when that is forecast to take too long."""
        job, asked, tops = self.goal.job, self.goal.asked, self.goal.tops
        if asked.of != "distribution" and not np.isfinite(tops).all():
            self.cost = self.cost._replace(remark="no bound on the counts outside its states")
            return None
        least = FiniteStateProjection.least_tolerance or 0.0
        tolerance = min(max(tolerance_for(asked, tops) / 2, least), 1e-3)
        job.report("trying a projection")
        began = time.process_time()
        try:
            method = FiniteStateProjection(tolerance, max_seconds=self._at_most, trial=tuning.TRIAL)
            with progress_line(shown=False):  # it may be given up, long before it would end
                found = job.distribution(method.solve(job.model.network, job.model.initial, job.grid))
        except ValueError:
            self.cost = self.cost._replace(remark=f"given up: over {self._at_most:.2g} s, or too many states")
            return None
        self.cost = CostForecast(self.name, time.process_time() - began, "as it took")
        return self.judged(found)


def largest_counts(network: Network, start: Ints) -> Floats:
    """Upper bounds (S,) of the counts; inf if none is known.

    The stated conserved quantities give some, and so does the number of all copies where nothing makes it grow.
    """
    may_grow = bool(network.events) or _made(network).max(initial=0.0) > 0.0
    copies = float(sum(map(int, start)))
    if copies > LARGEST_COUNT:
        copies = float(np.nextafter(copies, np.inf))
    tops = np.full(len(network.species), np.inf if may_grow else copies)
    for weights in network.conserved.values():
        if weights.min() >= 0.0:
            shares = divided(weights @ start.astype(float), weights, np.inf)
            tops = np.minimum(tops, np.floor(shares * (1.0 + 1e-12)))
    return tops


def is_endless(network: Network) -> bool:
    """Whether a channel that needs nothing makes copies for ever, so that there are infinitely many states."""
    if network.events or not network.is_mass_action:
        return False
    of_nothing = network.propensities(np.zeros(len(network.species), dtype=np.int64))
    return bool((of_nothing[_made(network) > 0.0] > 0.0).any())


def _made(network: Network) -> Floats:
    """Copies (R,) that a firing adds in all."""
    change = network.sparse_stoichiometry
    return np.bincount(change.rows, change.copies, minlength=len(network.channels)).astype(float)


def error_reached(asked: AskedAccuracy, found: Distribution, tops: Floats) -> float:
    """Bound on the error of `found`, in the unit of `asked`; inf if nothing is proven.

    tops : (V,) largest counts, inside the states of `found` and outside
    """
    if not found.is_bound:
        return inf
    if asked.of == "distribution":
        return found.error
    if not np.isfinite(tops).all():
        return inf
    rounding = SLACK * len(found.space)
    if asked.of == "mean":
        figures, errors = found.mean(), (found.error + rounding) * tops
    else:
        figures = found.sd()
        # At worst all of the error is on the state farthest out, and it moves the mean.
        off = (found.error + found.error**2 + 2 * rounding) * tops**2
        errors = np.maximum(
            np.sqrt(figures**2 + off) - figures, figures - np.sqrt(np.maximum(figures**2 - off, 0.0))
        ).max(axis=0)
    return asked.value * float((errors / asked.tolerances(figures)).max())


def tolerance_for(asked: AskedAccuracy, tops: Floats) -> float:
    """Largest error of all probabilities together by which the accuracy is sure to be reached."""
    if asked.of == "distribution":
        return asked.value
    least = asked.tolerances(np.zeros((1, tops.size)))  # relative ones are no less than those of one copy
    shares = least[tops > 0.0] / tops[tops > 0.0]
    return float((shares if asked.of == "mean" else shares**2).min(initial=1.0))
