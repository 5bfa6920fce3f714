"""`Sensitivity`: what the rates do to the answers of a chain, exactly: all derivatives at once, with limits."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from kinetics.chain.chain import Chain, Mask, Target
from kinetics.chain.checks import square
from kinetics.derivatives import (
    ChannelEntries,
    Derivatives,
    Slopes,
    slopes_always,
    slopes_at,
    slopes_by_squaring,
    slopes_earned,
    slopes_in_the_end,
    slopes_until,
    slopes_up_to,
)
from kinetics.derivatives.squaring import MAX_SQUARED
from kinetics.passage.backward import steps_until
from kinetics.support.arrays import Floats, real_number, rising_times

ADJOINT, SQUARING, ELIMINATION = "adjoint uniformisation", "squaring, with its derivative", "elimination, adjoint"
FEW_STEPS = 200_000  # up to here a small chain is stepped through, with a proven bound


class Sensitivity:
    """The questions of a `Chain`, answered by the derivatives of its answer by the parameters of its rates.

    chain : of a network, whose parameters are the rate constants of its channels (of a rate law, a factor before it);
        any other, with `parameters`
    parameters : name -> (N, N) sparse: how the rates between states depend on it, d ln(rate) / d ln(parameter); 1
        where a rate is in proportion to it, as with a mask

    By `until` and `reward` at or up to a time: one pass forwards and one backwards, or for small and stiff chains three
    times the products of the dense method, with an estimated error; ever, until a target or in the end: one elimination
    and two substitutions. ValueError: a chain from elsewhere without parameters, and what the chain refuses.
    """

    def __init__(self, chain: Chain, parameters: Mapping[str, Any] | None = None) -> None:
        transitions, space = chain.transitions, chain.space
        self._chain, self._start = chain, np.asarray(chain.initial)
        self._shares: Floats | None = None
        self._constants: Floats | None = None
        if parameters is None:
            if space is None:
                raise ValueError(
                    "this chain comes from no network, so its rates have no names; give parameters, as in "
                    "{'k': mask}, with the rates (N, N) that are in proportion to each"
                )
            self._names = space.network.channels
            self._constants = np.asarray(space.network.known_rates, dtype=float)
            self._entries = ChannelEntries(transitions, len(space.network.channels))
            return
        if not parameters:
            raise ValueError("no parameters; give at least one, as in {'k': mask}")
        n_entries = transitions.rates.size
        self._names = tuple(parameters)
        tables = [square(f"parameter {name!r}", given, len(chain)) for name, given in parameters.items()]
        self._shares = np.array([each[transitions.rows, transitions.columns] for each in tables]).reshape(-1, n_entries)
        self._entries = ChannelEntries(transitions._replace(channels=np.arange(n_entries)), n_entries)

    def until(self, target: Target, through: Target | None = None, by: float | None = None) -> Derivatives:
        """Of `Chain.until`."""
        goal = self._chain.states(target)
        ways = np.ones(len(goal), dtype=bool) if through is None else self._chain.states(through, "through")
        if by is None:
            return self._answer(lambda: slopes_until(self._entries, self._start, ways, goal), ELIMINATION)
        return _probability(self._in_time(goal.astype(float), by, goal | ~ways))

    def always(self, states: Target, by: float | None = None) -> Derivatives:
        """Of `Chain.always`."""
        kept = self._chain.states(states)
        if by is None:
            return self._answer(lambda: slopes_always(self._entries, self._start, kept), ELIMINATION)
        return _probability(self._in_time(kept.astype(float), by, ~kept))

    def in_the_end(self, states: Target) -> Derivatives:
        """Of `Chain.in_the_end`."""
        held = self._chain.states(states).astype(float)
        return _probability(self._answer(lambda: slopes_in_the_end(self._entries, self._start, held), ELIMINATION))

    def passage(self, target: Target) -> Derivatives:
        """Of the mean of the first-passage time to a target that is certain."""
        goal = self._chain.states(target)
        ones = np.ones(goal.size)
        return self._answer(lambda: slopes_earned(self._entries, self._start, ones, goal), ELIMINATION)

    def reward(
        self,
        name: str | None = None,
        at: float | None = None,
        up_to: float | None = None,
        until: Target | None = None,
        stationary: bool = False,
    ) -> Derivatives:
        """Of `Chain.reward`."""
        given = self._chain.reward_asked(name, at, up_to, until, stationary)
        earning, worth = np.asarray(given.rates), self._chain.worth(given)
        if at is not None:
            return self._in_time(earning, at)
        if up_to is not None:
            end = _time("up_to", up_to)
            return self._answer(lambda: slopes_up_to(self._entries, self._start, earning, end, worth), ADJOINT)
        if until is not None:
            goal = self._chain.states(until)
            return self._answer(lambda: slopes_earned(self._entries, self._start, earning, goal, worth), ELIMINATION)
        return self._answer(lambda: slopes_in_the_end(self._entries, self._start, earning, worth), ELIMINATION)

    def _in_time(self, values: Floats, by: float, stops: Mask | None = None) -> Derivatives:
        """Of the mean of values at a time, of the chain that is stopped."""
        end, entries = _time("by", by), self._entries
        if stops is not None:
            entries = entries._replace(transitions=entries.transitions.stopped(stops))
        asked, space = (entries, self._start, values[None, :], end), self._chain.space
        if len(self._chain) > MAX_SQUARED or steps_until(entries.transitions, end) <= FEW_STEPS:
            return self._answer(lambda: slopes_at(*asked)[0], ADJOINT)
        if stops is not None and space is not None:
            space = replace(space, is_stopped=space.is_stopped | stops)
        return self._answer(lambda: slopes_by_squaring(*asked, space)[0], SQUARING)

    def _answer(self, question: Callable[[], Slopes], method: str) -> Derivatives:
        began = time.process_time()
        answer, value, wide, is_bound = question()
        if self._shares is not None:
            wide = np.abs(self._shares) @ (wide + 2.0**-52 * value.size * np.abs(value))
            value = self._shares @ value
        limits = value - wide, value + wide
        seconds = time.process_time() - began
        return Derivatives(self._names, answer, value, *limits, is_bound, self._constants, method, seconds)


def _probability(found: Derivatives) -> Derivatives:
    return replace(found, answer=found.answer.capped())


def _time(name: str, given: float) -> float:
    return float(rising_times([real_number(name, given)])[0])
