"""The distribution of the time at which a chain enters its last state: values with bounds, and quantiles."""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property

import numpy as np

from kinetics.markov.passage.backward import BackwardPass, steps_until
from kinetics.markov.transient.dense import Dense
from kinetics.markov.transient.poisson import ROUNDOFF
from kinetics.markov.transient.transitions import Transitions
from kinetics.markov.transient.uniformisation import MAX_STEPS, Absorption, DiscreteChain
from kinetics.support.answer import Answer, kind_of
from kinetics.support.arrays import Floats

TOLERANCE = 1e-14  # probability that the distribution may leave out at a time
SMALL = 1e-3  # below, values come by a pass backwards, whose error is relative
MOST_STIFF = 200  # states of a chain too stiff for steps; half a second a time, and a quantile asks for a hundred
NEARLY = 1e-9  # by how much a quantile at the edge of what is ever reached is taken lower


class Arrival:
    """When a chain enters its last state, which is never left, from a start spread as `start` (N,).

    Values come from one pass forwards to the latest time asked for, small ones from one backwards likewise; those of a
    small chain that is too stiff for these from its matrix exponential.
    """

    def __init__(self, transitions: Transitions, start: Floats, target: str) -> None:
        self._transitions, self._start, self._target = transitions, start, target
        self.chain = DiscreteChain.of(transitions)
        self._absorption = Absorption(self.chain, start)
        self._known: dict[float, tuple[Answer, Answer]] = {}  # by time: a quantile and its bounds ask for the same ones

    def method_at(self, time: float) -> str:
        """What gives the values at a time."""
        return "uniformisation" if self.chain.steps_until(time, TOLERANCE) <= MAX_STEPS else "matrix exponential"

    def cdf(self, time: float) -> Answer:
        """Probability of having entered it by a time, tu."""
        common = self._common(time)[0]
        return self._finer(common, self._arrived, time)

    def survival(self, time: float) -> Answer:
        """Probability of not having entered it."""
        common = self._common(time)[1]
        return self._finer(common, self._alive, time)

    def _common(self, time: float) -> tuple[Answer, Answer]:
        """Cdf and survival, with absolute errors."""
        if time in self._known:
            return self._known[time]
        steps, is_bound = self.chain.steps_until(time, TOLERANCE), self._transitions.is_certified
        if steps <= MAX_STEPS:
            absorbed, alive, error = self._absorption.at(time, TOLERANCE)
        elif self._start.size > MOST_STIFF:
            raise ValueError(
                f"the distribution of the time until {self._target} needs {steps:.3g} steps at {time:g} tu, at most "
                f"{MAX_STEPS} with more than {MOST_STIFF} states; mean and sd are exact without them, and a time much "
                f"longer than the single waits is nearly exponential"
            )
        else:
            found, error, is_bound = Dense().probabilities(self._transitions, self._start, np.array([time]))
            absorbed, alive = float(found[0, -1]), float(found[0, :-1].sum())
            error += ROUNDOFF * self._start.size  # of that sum
        kind = kind_of(is_bound)
        cdf, survival = (
            Answer(value, max(value - error, 0.0), min(value + error, 1.0), kind) for value in (absorbed, alive)
        )
        self._known[time] = cdf, survival
        return cdf, survival

    def _finer(self, common: Answer, backwards: BackwardPass, time: float) -> Answer:
        if common.value >= SMALL or steps_until(self._transitions, time) > MAX_STEPS:
            return common
        found = backwards.at(time)
        return found if found.high - found.low < common.high - common.low else common

    @cached_property
    def _arrived(self) -> BackwardPass:
        return BackwardPass(self._transitions, self._start, np.eye(1, self._start.size, self._start.size - 1)[0])

    @cached_property
    def _alive(self) -> BackwardPass:
        return BackwardPass(self._transitions, self._start, 1.0 - np.eye(1, self._start.size, self._start.size - 1)[0])

    def quantile(self, q: float) -> float:
        """Time, tu, by which it has been entered with a probability of q, which is one that is ever reached."""
        return self._first(q, lambda found: found.value, np.inf)[1]

    def quantile_bounds(self, q: float, ever: float) -> tuple[float, float]:
        """Limits of the quantile; ever : probability that it is ever entered, at least.

        Before the earlier time the cdf is below q at most; at the later one it is q at least.
        """
        reached = q if q < ever else max(ever - NEARLY, 0.0)
        early = self._first(reached, lambda found: found.high, ever)[0]
        return early, self._first(q, lambda found: found.low, ever)[1] if q < ever else np.inf

    def _first(self, q: float, of: Callable[[Answer], float], ever: float) -> tuple[float, float]:
        """Neighbouring times by bisection, the cdf below q and not; inf if it is not known to come there.

        ever : the cdf after infinite time
        """
        look = self.cdf if q < SMALL else lambda time: self._common(time)[0]
        if of(look(0.0)) >= q:
            return 0.0, 0.0
        early, late = 0.0, 1.0 / self.chain.rate
        while of(found := look(late)) < q:
            if found.high >= ever:  # no later one is known to be higher
                return early, np.inf
            early, late = late, 2.0 * late
        while early < (middle := 0.5 * (early + late)) < late:
            early, late = (middle, late) if of(look(middle)) < q else (early, middle)
        return early, late
