"""Checks between calls of a kernel while runs are made: interruption, too many events, runs that never end.

Kernels return after a fraction of a second and go on from where they were, with the same bits: Ctrl-C is heard between
calls. A run that has made many events is looked at, and again whenever it has doubled them. It is truncated where it
has made `max_events`, in a crowd with the candidates that thinning throws away; or at once, where its propensities grow
and its rate equations forecast that it will come to more: the figures of times before are the same.
"""

from __future__ import annotations

import threading
from bisect import bisect_left
from collections.abc import Callable
from functools import cached_property
from time import perf_counter
from typing import NamedTuple

import numpy as np

from kinetics.kernels import outcomes
from kinetics.kernels.ensemble_work import BEFORE, EVENTS, LOOK, RUN, Stop, never
from kinetics.runs.truncation import TruncatedRunsError, Truncation
from kinetics.sampling.outlook import Outlook
from kinetics.support.arrays import Floats, Ints, whole_number
from kinetics.support.interrupts import was_interrupted

MAX_EVENTS = 10**9  # of a run, by default
FIRST_LOOK = 100_000  # events
MARGIN = 2.0  # times the events allowed, that a forecast must come to
FIRST_RUNS = 20  # whose share of truncated runs is reported
FIRST_CALL = 10**6  # events of the first call of a kernel, times channels: some milliseconds
MOST_CALL, CALL_SECONDS = 10**9, 0.1  # events of a call, and what it may take
REASON = {
    outcomes.MOST_EVENTS: "events",
    outcomes.ENDLESS_RUN: "forecast",
    outcomes.STALLED_CLOCK: "stalled",
    outcomes.OVERFLOW: "overflow",
}


class CutRun(NamedTuple):
    """A truncated run: why, when, its counts (S,) then, its events or those forecast, and how many
    times of the grid it has passed."""

    outcome: int
    time: float
    counts: Ints
    events: float
    passed: int


class Watch:
    """A watch over the runs of one ensemble, or over one path.

    grid : (T,) the times asked for
    outlook : of the network; None if nothing can be forecast
    first_run : number of the first run
    stops : truncated runs by number, as far as they are known
    complete : by number of the first run of a piece, how many of its runs are done
    is_path : whether all events are needed until the end, so that a truncated run is an error at once
    until : the condition at which runs end, for kernels with the channels of the network; None if there is none.
        Other runs then go on where one is truncated, and no rate equations forecast how many events are to come
    reached : (runs,) when the condition first held in each run, tu; inf if it has not
    """

    def __init__(
        self,
        grid: Floats,
        outlook: Outlook | None = None,
        max_events: int = MAX_EVENTS,
        first_run: int = 0,
        is_path: bool = False,
        until: Stop | None = None,
        runs: int = 1,
    ) -> None:
        self.until, self.reached = until, np.full(0 if until is None else runs, np.inf)
        self.grid, self.outlook, self.first_run, self.is_path = grid, outlook, first_run, is_path
        self.max_events = whole_number("max_events", max_events, 1)
        self.is_stopped = threading.Event()
        self.complete: dict[int, int] = {}
        self.stops: dict[int, CutRun] = {}
        self._first: tuple[int, int] | None = None  # times passed and number of the first run that was truncated
        self._lock = threading.Lock()

    @cached_property
    def most_events(self) -> int:
        """Events of the next call of a kernel."""
        channels = 100 if self.outlook is None else len(self.outlook.network.channels)
        return max(1, FIRST_CALL // max(10, channels))

    @property
    def first_look(self) -> int:
        """Events after which a run is first looked at."""
        return min(FIRST_LOOK, self.max_events)

    def needed(self, run: int) -> int:
        """How many times of the grid a run is to pass."""
        if self._first is None or self.until is not None:
            return self.grid.size
        more, few, followed, _ = self.limits(0)
        return int(more if run < followed else few)

    def limits(self, first_run: int) -> Ints:
        """`needed` of the runs from `first_run` on, and the first look, as kernels read them: see `direct.ensemble`.

        The first runs, up to the truncated one, go on to the first time that is left out, so that it is known how many
        reach it. The figures then end at the same time, whichever run is truncated first.
        """
        few, followed = (self.grid.size, 0) if self._first is None or self.until is not None else self._first
        followed = max(self.first_run + FIRST_RUNS, followed)
        return np.array([min(few + 1, self.grid.size), few, followed - first_run, self.first_look])

    def stop_of(self, channels: Ints) -> Stop:
        """The stop condition as a kernel with channels (G,) reads it."""
        return never(len(channels)) if self.until is None else self.until.of_channels(channels)

    def reached_of(self, first_run: int, runs: int) -> Floats:
        """The part (runs,) of `reached` that belongs to these runs, to be written to."""
        return self.reached[first_run - self.first_run :][:runs]

    def pause(self, began: float) -> None:
        """Between calls of a kernel, `hear` Ctrl-C and set how many events the next call makes.

        began : when the last call did, by `perf_counter`; the next one is to take a fraction of a second
        """
        ratio = CALL_SECONDS / max(perf_counter() - began, 1e-9)
        self.most_events = min(max(1, int(self.most_events * min(max(ratio, 0.1), 10.0))), MOST_CALL)
        self.hear()

    def hear(self) -> None:
        """KeyboardInterrupt if the runs are to stop."""
        if self.is_stopped.is_set():
            raise KeyboardInterrupt

    def look(self, run: int, events: int, time: float, counts: Ints, forecasts: bool = True) -> int:
        """Events of a run with counts (S,) at which to look again; 0 if it is truncated.

        forecasts : whether rate equations may be integrated
        """
        end = float(self.grid[-1])
        if bisect_left(self.grid, time) >= self.needed(run):  # about to be over, without another event
            return 2 * events
        if events >= self.max_events:
            self.stop(run, outcomes.MOST_EVENTS, time, counts, events)
            return 0
        again: float = 2 * events
        if forecasts and self.outlook is not None and self.until is None:
            total = self.outlook.total(counts, time)
            grows = total * time > MARGIN * events or not total < np.inf
            if grows or events + total * (end - time) > self.max_events:
                foreseen = events + self.outlook.events(counts, time, end, self.max_events)
                if foreseen > MARGIN * self.max_events:
                    self.stop(run, outcomes.ENDLESS_RUN, time, counts, foreseen)
                    return 0
                again = 2 * foreseen if foreseen > events else again
        return int(min(again, self.max_events))

    def stop(self, run: int, outcome: int, time: float, counts: Ints, events: float = 0.0) -> None:
        """A run is truncated; other runs need not go further than it has come."""
        passed = int(np.searchsorted(self.grid, time))
        with self._lock:
            self.stops[run] = CutRun(outcome, time, counts.astype(np.int64), events, passed)
            self._first = min(self._first or (passed, run), (passed, run))
        if self.is_path or (self.until is not None and self.grid[-1] == np.finfo(float).max):  # there is no horizon
            raise TruncatedRunsError(self._told(self._first, 1))

    @property
    def n_times(self) -> int:
        """How many times of the grid all runs have passed."""
        return int(self.limits(0)[1])

    def truncation(self, runs: int) -> Truncation | None:
        """The truncation of an ensemble of `runs` runs, for its result; None if all runs reached their end."""
        return None if self._first is None else self._told(self._first, runs)

    def check(self) -> None:
        """Raise a TruncatedRunsError where a run has been truncated."""
        if self._first is not None:
            raise TruncatedRunsError(self._told(self._first, 1))

    def _told(self, passed_first: tuple[int, int], runs: int) -> Truncation:
        few, first = passed_first
        last = max(self.first_run + min(FIRST_RUNS, runs) - 1, first)  # all up to this run are known
        alike = {n: stop for n, stop in self.stops.items() if n <= last and stop.passed == few}
        run = min(alike, key=lambda n: (alike[n].time, n))
        stop = alike[run]
        channel, propensity = ("", 0.0) if self.outlook is None else self.outlook.largest(stop.counts, stop.time)
        return Truncation(
            stop.time,
            run,
            len(alike),
            last + 1 - self.first_run,
            float(self.grid[few - 1]) if few else None,
            float(self.grid[min(few, self.grid.size - 1)]),
            float(self.grid[-1]),
            channel,
            propensity,
            REASON[stop.outcome],
            stop.events,
            self.max_events,
            "" if self.outlook is None else self.outlook.network.time_unit,
        )


def in_turn(
    watch: Watch,
    first_run: int,
    notes: Ints,
    clock: Floats,
    counts: Ints,
    go_on: Callable[[Ints, int], int],
    may_forecast: Callable[[], bool | None] = lambda: True,
) -> None:
    """Runs one after another by a kernel, from number `first_run` on, until all are done or truncated.

    notes, clock, counts (S,) : of the run at hand, see `EnsembleWork`
    go_on(limits, most) : goes on with the runs, see `direct.ensemble`
    may_forecast : whether rate equations say what a run will cost; None if it is not to be looked at yet
    """
    while True:
        began = perf_counter()
        try:
            outcome = go_on(watch.limits(first_run), watch.most_events)
        except SystemError as error:
            if was_interrupted(error):
                raise KeyboardInterrupt from error
            raise
        if outcome == outcomes.REACHED_END:
            return
        watch.complete[first_run] = int(notes[RUN])
        watch.pause(began)
        run, events, time = first_run + int(notes[RUN]), int(notes[EVENTS]), float(clock[0])
        if outcome == outcomes.UNFINISHED:
            forecasts = may_forecast() if events >= notes[LOOK] else None
            if forecasts is None:
                continue
            notes[LOOK] = watch.look(run, events, time, counts, forecasts)
            if notes[LOOK]:
                continue
        else:
            watch.stop(run, outcome, time, counts, events)
        notes[RUN], notes[EVENTS] = notes[RUN] + 1, BEFORE
