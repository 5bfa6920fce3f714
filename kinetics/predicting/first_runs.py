"""The first runs of an ensemble: what a run costs, and the rates of all channels in them."""

from __future__ import annotations

from math import ceil, inf, log
from typing import NamedTuple

import numpy as np

from kinetics.network import Network
from kinetics.predicting import tuning
from kinetics.predicting.tuning import FIRST_RUNS
from kinetics.sampling import SamplingMethod
from kinetics.sampling.cost_model import NetworkSize
from kinetics.sampling.run_source import RunSource
from kinetics.sampling.watch import MARGIN
from kinetics.support.arrays import Floats, Ints


class SeenRates(NamedTuple):
    """Propensities that some of the first runs met.

    times : (L,) from 0 to the last
    states : (runs, L, S); propensities : (runs, L, R)
    """

    times: Floats
    states: Ints
    propensities: Floats


class FirstRuns(NamedTuple):
    """Predicted CPU time of a run (s) and, if the first runs were made to the end, their counts and rates.

    counts : (`FIRST_RUNS`, T, S)
    """

    seconds: float
    counts: Ints | None = None
    seen: SeenRates | None = None


def first_runs(
    network: Network, method: SamplingMethod, source: RunSource, grid: Floats, outputs: int, most: float,
    threads: int | None = 1,
) -> FirstRuns:  # fmt: skip
    """Make the first runs until the last of `grid` (T,), unless a run is predicted to cost more than `most` s.

    source : all counts of the runs of `network` by `method`
    outputs : counts that each run adds to the statistics
    Runs are made in stretches that grow, each from time 0, and given up when the rest, at the rate of the last time,
    would cost too much. The predicted cost is that of the events, the integral of the propensities over the runs, and
    does not depend on the clock.
    """
    event = 1e-9 * method.cost(NetworkSize.of(network, source.start))
    last, end = float(grid[-1]), 0.0
    counted = tuning.PROPENSITIES // (tuning.LOOKED_AT.size * max(len(network.channels), 1))
    counted = min(max(counted, tuning.FEWEST_COUNTED), FIRST_RUNS)
    rate = float(network.propensities(source.start, 0.0).sum())
    events, left, found = 0.0, rate * last, None
    while found is None:
        further = max(tuning.FIRST_EVENTS, _stretch(events, left))
        if left > MARGIN * source.max_events:
            further = inf  # it is truncated, most likely: as soon as its end is known, which a stretch is not
        is_short = FIRST_RUNS * (events + further) * event < tuning.THREADED
        end = min(last, end + further / rate) if rate > 0.0 else last
        looked_at = end * tuning.LOOKED_AT
        times = np.union1d(looked_at, grid if end == last else [])
        made = source.counts(times, FIRST_RUNS, threads=1 if is_short else threads)
        seen = _rates(network, looked_at, made[:counted, np.searchsorted(times, looked_at)])
        rates = seen.propensities.sum(axis=-1).mean(axis=0)
        events, rate = float(np.trapezoid(rates, looked_at)), float(rates[-1])
        left = rate * (last - end)
        if end == last:
            found = made[:, np.searchsorted(times, grid)], seen
        elif most < (events + left) * event and left <= MARGIN * source.max_events:
            events += left
            break
    return FirstRuns(events * event + 1e-9 * method.start_cost + tuning.OUTPUT * outputs, *(found or ()))


def _stretch(events: float, left: float) -> float:
    """Events of the next stretch: the fewest stretches of equal growth, at most `STRETCH`, that do the events left."""
    if events == 0.0 or left == 0.0:
        return 0.0
    times = 1.0 + left / events
    stretches = ceil(log(times) / log(tuning.STRETCH))
    return 1.001 * left if stretches <= 1 else events * (times ** (1 / stretches) - 1.0)


def _rates(network: Network, times: Floats, states: Ints) -> SeenRates:
    if not network.laws and not network.events:
        return SeenRates(times, states, network.propensities(states))
    by_time = [network.propensities(states[:, i], t) for i, t in enumerate(times)]
    return SeenRates(times, states, np.stack(by_time, axis=1))
