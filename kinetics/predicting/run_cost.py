"""What a run is foretold to cost, from the events of the first runs, which are made only as far as is worth it."""

from __future__ import annotations

from math import ceil, log
from typing import NamedTuple

import numpy as np

from kinetics.network import Network
from kinetics.sampling import SamplingMethod
from kinetics.sampling.cost_model import NetworkSize
from kinetics.sampling.run_source import RunSource
from kinetics.support.arrays import Floats, Ints

FIRST_RUNS = 16
FEWEST_COUNTED, PROPENSITIES = 2, 2**17  # of them, whose events are foretold: as many as have so many propensities
LOOKED_AT = np.linspace(0.0, 1.0, 33) ** 3  # of a stretch: most at its beginning, where stiff chains are busiest
FIRST_EVENTS = 2e3  # of a run, in the first stretch
STEADY, RISING = 500.0, 8.0  # growth of events by the next, at most: less where events came ever quicker
MIDDLE = 26  # of `LOOKED_AT`
THREADED = 0.02  # s of work; threads for less would cost more than they save
# Seconds on a common machine, beside those of events and of starting a run: of a count that enters the statistics, and
# of statistics.
OUTPUT, STATISTICS = 6e-9, 1e-3


def _stretch(events: float, left: float, growth: float) -> float:
    """Events of the next stretch, where the fewest stretches that are left all grow alike: nearly all is done once."""
    if events == 0.0 or left == 0.0:
        return 0.0
    times = 1.0 + left / events
    stretches = ceil(log(times) / log(growth))
    return 1.001 * left if stretches <= 1 else events * (times ** (1 / stretches) - 1.0)


class SeenRates(NamedTuple):
    """Propensities that some of the first runs met.

    times : (L,) from 0 to the last
    states : (runs, L, S); propensities : (runs, L, R)
    """

    times: Floats
    states: Ints
    propensities: Floats


class FirstRuns(NamedTuple):
    """What a run takes, s of processor time; and of the first, None where they were not made to the end: the counts
    (`FIRST_RUNS`, T, S), and the rates of their channels."""

    seconds: float
    counts: Ints | None = None
    seen: SeenRates | None = None


def first_runs(
    network: Network, method: SamplingMethod, source: RunSource, grid: Floats, outputs: int, most: float,
    threads: int | None = 1,
) -> FirstRuns:  # fmt: skip
    """The first runs until the last of `grid` (T,), and what each takes; a lower limit of that beyond `most` s.

    source : all counts of the runs of `network` by `method`
    outputs : counts that each run adds to the statistics
    Events are the integral of the propensities that runs meet. Runs are made in stretches that grow, each from time 0,
    and no further once the rest, at the rate of the last time, would cost more than `most` a run. The foretold cost
    does not depend on the clock.
    """
    start = source.start
    event = 1e-9 * method.cost(NetworkSize.of(network, start))
    last, end = float(grid[-1]), 0.0
    counted = min(max(PROPENSITIES // (LOOKED_AT.size * max(len(network.channels), 1)), FEWEST_COUNTED), FIRST_RUNS)
    rate = float(network.propensities(start, 0.0).sum())
    events, growth, found = 0.0, RISING, None
    while found is None:
        further = max(FIRST_EVENTS, _stretch(events, rate * (last - end), growth))
        is_short = FIRST_RUNS * (events + further) * event < THREADED
        end = min(last, end + further / rate) if rate > 0.0 else last
        looked_at = end * LOOKED_AT
        times = np.union1d(looked_at, grid if end == last else [])
        made = source.counts(times, FIRST_RUNS, threads=1 if is_short else threads)
        seen = _rates(network, looked_at, made[:counted, np.searchsorted(times, looked_at)])
        rates = seen.propensities.sum(axis=-1).mean(axis=0)
        events, rate = float(np.trapezoid(rates, looked_at)), float(rates[-1])
        growth = RISING if rate > 1.5 * rates[MIDDLE] else STEADY
        if end == last:
            found = made[:, np.searchsorted(times, grid)], seen
        elif (events + rate * (last - end)) * event > most:
            events += rate * (last - end)
            break
    return FirstRuns(events * event + 1e-9 * method.start_cost + OUTPUT * outputs, *(found or ()))


def _rates(network: Network, times: Floats, states: Ints) -> SeenRates:
    if not network.laws and not network.events:
        return SeenRates(times, states, network.propensities(states))
    by_time = [network.propensities(states[:, i], t) for i, t in enumerate(times)]
    return SeenRates(times, states, np.stack(by_time, axis=1))
