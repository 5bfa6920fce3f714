"""Rare events where the states cannot be listed: multilevel splitting."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from kinetics.arrays import Floats, Ints, rising_times
from kinetics.methods.sampling import whole_number
from kinetics.network import Network

Level = Callable[[Ints], NDArray[np.float64]]

SHARE = 0.2  # of the runs of the pilot that define the next level
MAX_LEVELS = 1000
MAX_EVENTS = 1_000_000  # of the longest run
REPLICATES = 20  # independent estimates, whose scatter gives the interval
STUDENT = 2.093024054408263  # 97.5 % quantile at 19 degrees of freedom


@dataclass(frozen=True)
class RareEvent:
    """Probability that a level is reached by a time.

    probability, standard_error : unbiased estimate, and its error by chance, from independent replicates
    low, high : 95 % interval by Student's law; approximate, because the replicates are skewed
    levels : on the way, the last one the event itself
    runs : begun at each level, over all replicates
    """

    probability: float
    standard_error: float
    low: float
    high: float
    levels: tuple[float, ...]
    runs: int
    seed: int

    @property
    def is_trusted(self) -> bool:
        """Whether the replicates agree well enough, to a tenth or better, for the interval to hold."""
        return self.standard_error <= 0.1 * self.probability

    def __str__(self) -> str:
        text = (
            f"{self.probability:.4g} [{self.low:.4g}, {self.high:.4g}] by {len(self.levels)} levels of "
            f"{self.runs} runs (seed {self.seed})"
        )
        return text if self.is_trusted else f"{text}; the replicates scatter too widely: give more runs"


def rare_event(
    network: Network,
    initial: ArrayLike,
    level: Level,
    threshold: float,
    end: float,
    runs: int = 20_000,
    seed: int = 0,
) -> RareEvent:
    """Probability that `level` reaches `threshold` by `end`, tu.

    level : of states (n, S), values (n,) that rise on the way to the event, as in lambda states: states[:, 0]
    runs : begun at each level

    The event is a chain of likely ones: each next level is reached by a share of the runs that start where earlier ones
    entered the level before, and the probability is the product of the shares (Kahn & Harris 1951). Levels come from a
    pilot and are then fixed, which keeps the estimate unbiased (Amrein & Kuensch 2011). Events that must hurry all the
    way need many runs: runs that enter a level late come no further, and few carry the estimate. `is_trusted` tells.
    """
    horizon = float(rising_times([end])[0])
    start = network.state(initial)
    n = whole_number("runs", runs, 10 * REPLICATES) // REPLICATES
    network.known_rates  # noqa: B018
    sequences = np.random.SeedSequence(whole_number("seed", seed, 0)).spawn(REPLICATES + 1)
    begin = np.atleast_1d(np.asarray(level(start[None, :]), dtype=float))
    if begin.shape != (1,):
        raise ValueError(f"level gives shape {begin.shape} for one state; expected one value a state, (1,)")
    if begin[0] >= threshold:
        return RareEvent(1.0, 0.0, 1.0, 1.0, (threshold,), n * REPLICATES, seed)
    pilot, *others = (_Runner(network, level, horizon, np.random.default_rng(each)) for each in sequences)
    levels = _pilot(pilot, start, float(begin[0]), threshold, max(n, 1000))
    estimates = np.array([_estimate(runner, start, levels, n) for runner in others])
    mean, error = float(estimates.mean()), float(estimates.std(ddof=1) / REPLICATES**0.5)
    low, high = max(mean - STUDENT * error, 0.0), min(mean + STUDENT * error, 1.0)
    return RareEvent(mean, error, low, high, levels, n * REPLICATES, seed)


def _pilot(runner: _Runner, start: Ints, reached: float, threshold: float, n: int) -> tuple[float, ...]:
    """Levels that about a fifth of the runs reach from the level before."""
    states, clocks = np.tile(start, (n, 1)), np.zeros(n)
    levels: list[float] = []
    while reached < threshold:
        tops = runner.run(states, clocks, threshold).tops
        goal = min(float(np.quantile(tops, 1.0 - SHARE, method="higher")), threshold)
        if goal <= reached:  # few go further; the next level that any reached
            goal = float(tops[tops > reached].min(initial=np.inf))
        if goal == np.inf or len(levels) == MAX_LEVELS:
            raise ValueError(
                f"no way to level {threshold:g}: the pilot came to {reached:g} and no further; give more runs, a later "
                f"time, or a level that rises step by step on the way to the event"
            )
        entered = runner.run(states, clocks, goal)
        hits = np.flatnonzero(entered.tops >= goal)
        if hits.size:
            chosen = runner.rng.choice(hits, n)
            states, clocks = entered.states[chosen], entered.clocks[chosen]
            reached = goal
            levels.append(goal)
    return tuple(levels)


def _estimate(runner: _Runner, start: Ints, levels: tuple[float, ...], n: int) -> float:
    """Product of the shares that reach each level, runs starting evenly where earlier ones entered the level before."""
    states, clocks, probability = np.tile(start, (n, 1)), np.zeros(n), 1.0
    for goal in levels:
        found = runner.run(states, clocks, goal)
        hits = np.flatnonzero(found.tops >= goal)
        probability *= hits.size / n
        if not hits.size:
            break
        chosen = runner.rng.choice(hits, n)
        states, clocks = found.states[chosen], found.clocks[chosen]
    return probability


@dataclass(frozen=True)
class _Runs:
    """States (n, S) and clocks (n,) where the runs stopped, and the highest levels (n,) they saw."""

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

    def run(self, states: Ints, clocks: Floats, goal: float) -> _Runs:
        """From states (n, S) at clocks (n,), each run until the goal or the end."""
        states, clocks = states.copy(), clocks.copy()
        changes = self.network.stoichiometry
        tops = np.asarray(self.level(states), dtype=float).copy()
        going = np.flatnonzero(tops < goal)
        for _ in range(MAX_EVENTS):
            if not going.size:
                return _Runs(states, clocks, tops)
            ladder = np.cumsum(self.network.propensities(states[going]), axis=1)
            total = ladder[:, -1]
            waits = np.full(going.size, np.inf)
            np.divide(self.rng.exponential(size=going.size), total, out=waits, where=total > 0)
            clocks[going] += waits
            fires = clocks[going] <= self.end
            going, ladder, total = going[fires], ladder[fires], total[fires]
            marks = self.rng.random(going.size) * total
            chosen = np.minimum((ladder <= marks[:, None]).sum(axis=1), ladder.shape[1] - 1)
            states[going] += changes[chosen]
            tops[going] = np.maximum(tops[going], self.level(states[going]))
            going = going[tops[going] < goal]
        raise ValueError(f"a run has over {MAX_EVENTS} events until {self.end:g} tu; ask for an earlier time")
