"""Probabilities of rare events by importance splitting, for networks whose states cannot be listed."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from kinetics.markov.passage.level_surrogate import LevelBins, LevelChances, LevelJumps
from kinetics.network import Model, Network
from kinetics.support.arrays import Counts, Floats, Ints, rising_times, whole_number
from kinetics.support.shown import ResultTable, Shown, facts

Level = Callable[[Ints], NDArray[np.float64]]
Value = Callable[[Floats, Floats], NDArray[np.float64]]  # of levels (n,) and clocks (n,)

SHARE = 0.2  # of the runs of the pilot that define the next stage
MAX_STAGES = 1000
MAX_EVENTS = 1_000_000  # of the longest run
PILOT = 1000  # runs at each stage, at least
OLDER = 0.01  # weight of what was learnt from runs that did not have to hurry
REPLICATES = 20  # independent estimates, whose scatter gives the interval
STUDENT = 2.093024054408263  # 97.5 % quantile at 19 degrees of freedom
TRUSTED = 0.1  # relative standard error


@dataclass(frozen=True, repr=False)
class RareEvent(Shown):
    """An estimate of the probability that a level is reached by a given time.

    probability, standard_error : unbiased estimate and its sampling error, from independent replicates
    low, high : 95 % interval: by Student's distribution where the replicates agree (`is_trusted`); otherwise a lower
        limit alone, by Markov's inequality, which holds for any unbiased estimate that is not negative
    chances : approximate probabilities of the event at which runs were split; the last, 1, is the event itself
    runs : number of runs begun at each stage, over all replicates

    >>> from kinetics import Network, rare_event
    >>> pair = Network.from_text("A -> B, 1")
    >>> found = rare_event(pair, {"A": 2}, lambda states: states[:, 1], threshold=2, end=0.01, seed=1)
    >>> found.low < 9.9005e-05 < found.high, found.is_trusted  # (1 - exp(-0.01))^2
    (True, True)
    """

    probability: float
    standard_error: float
    low: float
    high: float
    chances: tuple[float, ...]
    runs: int
    seed: int

    @property
    def is_trusted(self) -> bool:
        """True if the replicates agree to a tenth or better, as the two-sided interval requires."""
        return self.probability > 0.0 and self.standard_error <= TRUSTED * self.probability

    @property
    def headline(self) -> str:
        """The estimate with its interval, on one line."""
        return f"probability {self.probability:.4g} [{self.low:.4g}, {self.high:.4g}]"

    def summary(self) -> ResultTable:
        """The estimate, its error and its cost in runs."""
        values = {
            "probability": f"{self.probability:.6g}",
            "standard error": f"{self.standard_error:.2g}",
            "95 % interval": f"[{self.low:.4g}, {self.high:.4g}]",
            "stages": str(len(self.chances)),
            "runs of each stage": str(self.runs),
            "seed": str(self.seed),
        }
        trust = "the replicates agree" if self.is_trusted else "the replicates scatter too widely: give more runs"
        return facts(self.headline, values, [f"sampled by importance splitting; {trust}"])

    def __str__(self) -> str:
        text = (
            f"{self.probability:.4g} [{self.low:.4g}, {self.high:.4g}] by {len(self.chances)} stages of "
            f"{self.runs} runs (seed {self.seed})"
        )
        return text if self.is_trusted else f"{text}; the replicates scatter too widely: give more runs"


def rare_event(
    model: Model | Network,
    initial: Counts | None,
    level: Level,
    threshold: float,
    end: float,
    runs: int = 20_000,
    seed: int = 0,
) -> RareEvent:
    """Estimate the probability that `level` reaches `threshold` by `end`, tu, by importance splitting.

    initial : counts at time 0 that go before the model's; None for these
    level : function of states (n, S) with values (n,) that rise on the way to the event, as lambda states: states[:, 0]
    runs : number of runs begun at each stage
    ValueError: the event was not reached, or wrong input

    In importance splitting (Kahn & Harris 1951), runs of each stage start where earlier runs entered it, a share of
    them reaches the next stage, and the probability is the product of the shares. A stage is a chance of the event
    given level and time left, from a chain on the levels that is learnt in a pilot. A run that is late must therefore
    have come further to enter a stage, which serves events that leave no time to spare as well as those that do. The
    stages are fixed before the estimate, which keeps it unbiased (Amrein & Künsch 2011, doi:10.1145/1899396.1899401),
    whatever the level.

    The interval is valid where the level measures the progress of a run: runs that enter a stage in different states
    must have similar chances from there on. If the event comes almost only by a path that few runs take at first and
    that the level does not show (a hidden switch), all replicates may miss it and agree on too small a number; `low`
    then still holds, but `high` does not. Cost: the events of all runs at all stages, of which there are about
    log(1 / p) / 1.6. Where the states can be listed, `first_passage` and `committor` need no sampling: choose those.

    >>> from kinetics import Chain, Network, rare_event
    >>> turnover = Network.from_text("0 <-> A, 1, 1")
    >>> found = rare_event(turnover, {"A": 0}, lambda states: states[:, 0], threshold=8, end=5.0, runs=4000, seed=1)
    >>> exact = Chain.of(turnover, {"A": 0}, stop="A >= 8").until("A >= 8", by=5.0)
    >>> found.low < exact.value < found.high, found.is_trusted, f"{exact.value:.4g}"
    (True, True, '0.0001639')
    """
    horizon = float(rising_times([end])[0])
    given = Model.of(model, initial)
    network, start = given.network, given.initial
    n = whole_number("runs", runs, 10 * REPLICATES) // REPLICATES
    network.known_rates  # noqa: B018
    sequences = np.random.SeedSequence(whole_number("seed", seed, 0)).spawn(REPLICATES + 1)
    begin = np.atleast_1d(np.asarray(level(start[None, :]), dtype=float))
    if begin.shape != (1,):
        raise ValueError(f"level gives shape {begin.shape} for one state; expected one value a state, (1,)")
    if begin[0] >= threshold:
        return RareEvent(1.0, 0.0, 1.0, 1.0, (1.0,), n * REPLICATES, seed)
    if horizon == 0.0:
        return RareEvent(0.0, 0.0, 0.0, 0.0, (1.0,), n * REPLICATES, seed)
    pilot, *others = (_Runner(network, level, horizon, np.random.default_rng(each)) for each in sequences)
    progress, chances = _learn(pilot, start, threshold, max(n, PILOT))
    estimates = np.array([_estimate(runner, start, progress, chances, n) for runner in others])
    mean, error = float(estimates.mean()), float(estimates.std(ddof=1) / REPLICATES**0.5)
    if 0.0 < error <= TRUSTED * mean:
        low, high = max(mean - STUDENT * error, 0.0), min(mean + STUDENT * error, 1.0)
    else:
        low, high = 0.05 * mean, 1.0
    return RareEvent(mean, error, low, high, chances, n * REPLICATES, seed)


def _learn(runner: _Runner, start: Ints, threshold: float, n: int) -> tuple[LevelChances, tuple[float, ...]]:
    """The chance of the event from each state, and the chances at which to split.

    First from runs that climb the levels with all the time at each; then from runs that had to make it by the end.
    """
    ladder, levels = _pilot(runner, start, _level_alone, threshold, n, has_all_time=True)
    jumps = LevelJumps(LevelBins(levels, threshold))
    states = np.tile(start, (n, 1))
    for goal in ladder:
        found = runner.run(states, np.zeros(n), _level_alone, goal, jumps)
        hits = np.flatnonzero(found.tops >= goal)
        if not hits.size:
            break
        states = found.states[runner.rng.choice(hits, n)]
    later = LevelJumps(jumps.bins)
    _pilot(runner, start, LevelChances(jumps, runner.end), 1.0, n, jumps=later)
    later.times += OLDER * jumps.times
    later.counts += OLDER * jumps.counts
    progress = LevelChances(later, runner.end)
    return progress, _pilot(runner, start, progress, 1.0, n)[0]


def _level_alone(levels: Floats, _: Floats) -> Floats:
    return levels


def _pilot(
    runner: _Runner,
    start: Ints,
    value: Value,
    threshold: float,
    n: int,
    has_all_time: bool = False,
    jumps: LevelJumps | None = None,
) -> tuple[tuple[float, ...], Floats]:
    """Values that about a fifth of the runs reach from the one before, and the levels that were seen.

    has_all_time : at each stage the clock is put back to 0
    """
    states, clocks = np.tile(start, (n, 1)), np.zeros(n)
    goals: list[float] = []
    seen = [runner.levels(states[:1])]
    reached = float(value(seen[0], clocks[:1])[0])
    while reached < threshold:
        first = runner.run(states, clocks, value, threshold, jumps, seen)
        goal = min(float(np.quantile(first.tops, 1.0 - SHARE, method="higher")), threshold)
        if goal <= reached:  # few go further; the next value that any reached
            goal = float(first.tops[first.tops > reached].min(initial=np.inf))
        if goal == np.inf or len(goals) == MAX_STAGES:
            raise ValueError(
                f"the event was not reached: the pilot runs got to level {np.concatenate(seen).max():g}; give more "
                f"runs, a later time, or a level that rises step by step towards the event"
            )
        entered = runner.run(states, clocks, value, goal)
        hits = np.flatnonzero(entered.tops >= goal)
        if hits.size:
            chosen = runner.rng.choice(hits, n)
            states, clocks = entered.states[chosen], np.zeros(n) if has_all_time else entered.clocks[chosen]
            reached = goal
            goals.append(goal)
    return tuple(goals), np.unique(np.concatenate(seen))


def _estimate(runner: _Runner, start: Ints, value: Value, goals: tuple[float, ...], n: int) -> float:
    """Product of the shares that reach each stage, runs starting evenly where earlier ones entered the one before."""
    states, clocks, probability = np.tile(start, (n, 1)), np.zeros(n), 1.0
    for goal in goals:
        found = runner.run(states, clocks, value, goal)
        hits = np.flatnonzero(found.tops >= goal)
        probability *= hits.size / n
        if not hits.size:
            break
        chosen = runner.rng.choice(hits, n)
        states, clocks = found.states[chosen], found.clocks[chosen]
    return probability


@dataclass(frozen=True)
class _Runs:
    """States (n, S) and clocks (n,) where the runs stopped, and the highest values (n,) they saw."""

    states: Ints
    clocks: Floats
    tops: Floats


@dataclass(frozen=True)
class _Runner:
    """Direct method for many runs side by side."""

    network: Network
    level: Level
    end: float
    rng: np.random.Generator

    def levels(self, states: Ints) -> Floats:
        """Levels (n,) of states (n, S)."""
        return np.asarray(self.level(states), dtype=float)

    def run(
        self,
        states: Ints,
        clocks: Floats,
        value: Value,
        goal: float,
        jumps: LevelJumps | None = None,
        seen: list[Floats] | None = None,
    ) -> _Runs:
        """Run on from states (n, S) at clocks (n,) until the value of each reaches the goal, or until the end.

        jumps, seen : note jumps between levels, and the levels themselves
        """
        states, clocks = states.copy(), clocks.copy()
        changes = self.network.sparse_stoichiometry
        levels = self.levels(states)
        tops = value(levels, clocks).copy()
        going = np.flatnonzero(tops < goal)
        for _ in range(MAX_EVENTS):
            if not going.size:
                return _Runs(states, clocks, tops)
            ladder = np.cumsum(self.network.propensities(states[going]), axis=1)
            total = ladder[:, -1]
            waits = np.full(going.size, np.inf)
            np.divide(self.rng.exponential(size=going.size), total, out=waits, where=total > 0)
            spent = np.minimum(waits, self.end - clocks[going])
            clocks[going] += waits
            before = levels[going]
            fires = np.flatnonzero(clocks[going] <= self.end)
            going, ladder, total = going[fires], ladder[fires], total[fires]
            marks = self.rng.random(going.size) * total
            chosen = np.minimum((ladder <= marks[:, None]).sum(axis=1), ladder.shape[1] - 1)
            states[going] = changes.added_to(states[going], chosen)
            levels[going] = self.levels(states[going])
            if jumps is not None:
                jumps.note(before, spent, fires, levels[going])
            if seen is not None:
                seen.append(np.unique(levels[going]))
            tops[going] = np.maximum(tops[going], value(levels[going], clocks[going]))
            going = going[tops[going] < goal]
        raise ValueError(f"a run has over {MAX_EVENTS} events until {self.end:g} tu; ask for an earlier time")
