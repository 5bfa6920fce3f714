"""The budget of a compilation: counted steps, equal on any machine, and a time limit."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager


class OutOfStepsError(Exception):
    """A search has used up its steps."""


class Budget:
    """Steps that are left to the search at work, and the end of all work.

    time_limit : s; clock : in s, time.monotonic but in tests
    started : on the clock, when the time began to count; None: now
    effort : by what the steps of every search are multiplied
    steps : all that were taken so far
    """

    def __init__(
        self,
        time_limit: float = math.inf,
        clock: Callable[[], float] = time.monotonic,
        effort: float = 1.0,
        started: float | None = None,
    ):
        self.time_limit, self.clock, self.effort = time_limit, clock, effort
        self.start = clock() if started is None else started
        self.end = self.start + time_limit
        self.steps = 0
        self.last = math.inf  # the step beyond which the search at work must not go

    def step(self, steps: int = 1) -> None:
        """Take a step, or several. OutOfStepsError after the last one; TimeoutError when time is up."""
        self.steps += steps
        if self.steps > self.last:
            raise OutOfStepsError
        self.check()

    def times(self, number: int) -> int:
        """So many, times the effort; at least one."""
        return max(1, round(self.effort * number))

    def check(self) -> None:
        """TimeoutError when time is up."""
        if self.clock() > self.end:
            raise TimeoutError

    @contextmanager
    def within(self, share: float) -> Iterator[None]:
        """Within, TimeoutError after that share of the time that was given in all."""
        end = self.end
        self.end = min(end, self.start + share * (end - self.start))
        try:
            yield
        finally:
            self.end = end

    @contextmanager
    def at_most(self, steps: int) -> Iterator[None]:
        """Within, OutOfStepsError after so many steps, times the effort, or after those an outer search still has."""
        outer = self.last
        self.last = min(outer, self.steps + self.effort * steps)
        try:
            yield
        finally:
            self.last = outer
