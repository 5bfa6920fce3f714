"""What a run is foretold to cost, from the events of the first runs, which are made only as far as is worth it."""

from __future__ import annotations

from math import ceil, log
from typing import NamedTuple

import numpy as np

from kinetics.network import Network
from kinetics.sampling import SamplingMethod
from kinetics.sampling.cost_model import NetworkSize
from kinetics.support.arrays import Floats, Ints

FIRST_RUNS = 16
COUNTED = 2  # of them, whose events are foretold
LOOKED_AT = np.linspace(0.0, 1.0, 33) ** 3  # of a stretch: most at its beginning, where stiff chains are busiest
FIRST_EVENTS = 2e3  # of a run, in the first stretch
STEADY, RISING = 500.0, 8.0  # growth of events by the next, at most: less where events came ever quicker
MIDDLE = 26  # of `LOOKED_AT`
THREADED = 0.02  # s of work; threads for less would cost more than they save
# Seconds on a common machine, beside those of events: of a run; of a count that enters the statistics; of statistics.
RUN, OUTPUT, STATISTICS = 1e-6, 1.5e-8, 1e-2


def _stretch(events: float, left: float, growth: float) -> float:
    """Events of the next stretch, where the fewest stretches that are left all grow alike: nearly all is done once."""
    if events == 0.0 or left == 0.0:
        return 0.0
    times = 1.0 + left / events
    stretches = ceil(log(times) / log(growth))
    return 1.001 * left if stretches == 1 else events * (times ** (1 / stretches) - 1.0)


class FirstRuns(NamedTuple):
    """What a run takes, s of processor time; and the counts (`FIRST_RUNS`, T, S) of the first, None where not made."""

    seconds: float
    counts: Ints | None


def first_runs(
    network: Network, method: SamplingMethod, start: Ints, grid: Floats, outputs: int, most: float, seed: int,
    threads: int | None = 1,
) -> FirstRuns:  # fmt: skip
    """The first runs until the last of `grid` (T,), and what each takes; a lower limit of that beyond `most` s.

    outputs : counts that each run adds to the statistics
    Events are the integral of the propensities that runs meet. Runs are made in stretches that grow, each from time 0,
    and no further once the rest, at the rate of the last time, would cost more than `most` a run. The foretold cost
    does not depend on the clock.
    """
    event = 1e-9 * method.cost(NetworkSize.of(network, start))
    last, end = float(grid[-1]), 0.0
    is_steady = not network.laws and not network.events
    rate = float(network.propensities(start, 0.0).sum())
    events, growth, counts = 0.0, RISING, None
    while counts is None:
        further = max(FIRST_EVENTS, _stretch(events, rate * (last - end), growth))
        is_short = FIRST_RUNS * (events + further) * event < THREADED
        end = min(last, end + further / rate) if rate > 0.0 else last
        looked_at = end * LOOKED_AT
        times = np.union1d(looked_at, grid if end == last else [])
        made = method.simulate(network, start, times, FIRST_RUNS, seed, 1 if is_short else threads).counts
        seen = made[:COUNTED, np.searchsorted(times, looked_at)]
        if is_steady:
            rates = network.propensities(seen).sum(axis=-1).mean(axis=0)
        else:
            rates = np.array([network.propensities(seen[:, i], t).sum(-1).mean() for i, t in enumerate(looked_at)])
        events, rate = float(np.trapezoid(rates, looked_at)), float(rates[-1])
        growth = RISING if rate > 1.5 * rates[MIDDLE] else STEADY
        if end == last:
            counts = made[:, np.searchsorted(times, grid)]
        elif (events + rate * (last - end)) * event > most:
            events += rate * (last - end)
            break
    return FirstRuns(events * event + RUN + OUTPUT * outputs, counts)
