"""The forecast cost of runs before any is made: events on short walks, times the measured cost of an event."""

from __future__ import annotations

import os

import numpy as np

from kinetics.network import Network
from kinetics.sampling.auto import Auto
from kinetics.sampling.base import SamplingMethod
from kinetics.sampling.cost_model import NetworkSize
from kinetics.sampling.run_source import RunSource
from kinetics.sampling.watch import MAX_EVENTS
from kinetics.support.arrays import Counts, Floats
from kinetics.support.cli.progress import forecast, is_heard
from kinetics.support.tables import rough

WALKS, STEPS = 3, 60
STRIDE = 0.3  # of all copies: the most events of a step, so that a network that grows cannot grow far within it
WALKED = 2e4  # events of a walk; what is left of it goes on as it was at last
OUTPUT = 6e-9  # s of a count that enters the statistics, on a common machine
UNMEASURED = 1e3  # ns of an event


def forecast_runs(
    network: Network,
    method: SamplingMethod,
    initial: Counts,
    grid: Floats,
    runs: int,
    threads: int | None = 1,
    max_events: int = MAX_EVENTS,
) -> None:
    """Say what `runs` until the last of `grid` (T,) will take, if a command runs, which says it.

    Nothing is said of runs that would come to more than `max_events`: these are truncated as soon as that is seen.
    Rough: counts that still grow at the end of the walks are taken to grow no more. The cost is counted work, so that
    the forecast does not depend on the clock.
    """
    if not is_heard():
        return
    try:
        chosen = method.choose(network, initial) if isinstance(method, Auto) else method
        source = chosen.source(network, initial)
        events = sum(_walked(network, source, float(grid[-1]), walk) for walk in range(WALKS)) / WALKS
    except ValueError:  # the runs themselves will say what is wrong
        return
    if events > max_events:
        return
    cost = chosen.cost(NetworkSize.of(network, source.start))
    each = 1e-9 * (events * (cost if cost < np.inf else UNMEASURED) + chosen.start_cost)
    each += OUTPUT * grid.size * len(network.species)
    what = f"{rough(runs)} runs of some {rough(events)} events"
    forecast(runs * each, what, len(os.sched_getaffinity(0)) if threads is None else threads)


def _walked(network: Network, source: RunSource, end: float, walk: int) -> float:
    """Events until `end`, tu, of one run, which is followed in short steps only so far that its pace can be seen."""
    state, t, events = source.start, 0.0, 0.0
    rate = float(network.propensities(state, t).sum())
    for step in range(STEPS):
        if rate == 0.0 or t >= end or events > WALKED:
            break
        length = min(min(max(STRIDE * float(state.sum()), 1.0), WALKED) / rate, end - t)
        state = source.starting_at(state).counts(np.array([length]), 1, walk * STEPS + step, threads=1)[0, 0]
        t, events = t + length, events + rate * length
        rate = float(network.propensities(state, t).sum())
    return events + rate * max(end - t, 0.0)
