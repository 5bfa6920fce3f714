"""What a run is foretold to cost, from the events of a few runs that are followed only as far as is worth it."""

from __future__ import annotations

import numpy as np

from kinetics.network import Network
from kinetics.sampling import Auto
from kinetics.sampling.cost_model import NetworkSize
from kinetics.support.arrays import Floats, Ints

FOLLOWED = 2  # runs
LOOKED_AT = np.linspace(0.0, 1.0, 33) ** 3  # of a stretch: most at its beginning, where stiff chains are busiest
FIRST_EVENTS = 1e4
GROWTH = 8.0
# Seconds on a common machine, beside those of events: of a run; of a count that enters the statistics; of statistics.
RUN, OUTPUT, STATISTICS = 1e-6, 1.5e-8, 1e-2


def run_seconds(network: Network, start: Ints, grid: Floats, outputs: int, most: float, seed: int) -> float:
    """Processor time that a run until the last of `grid` takes by `Auto`, s; a lower limit beyond `most`.

    outputs : counts that each run adds to the statistics
    Events are the integral of the propensities that runs meet. They are followed in stretches that grow, and no further
    once the rest, at the rate of the last time, would cost more than `most`. Deterministic.
    """
    method = Auto()
    event = 1e-9 * method.choose(network, start).cost(NetworkSize.of(network, start))
    last, end = float(grid[-1]), 0.0
    is_steady = not network.laws and not network.events
    rate = float(network.propensities(start, 0.0).sum())
    events = 0.0
    while end < last:
        end = min(last, end + max(FIRST_EVENTS, (GROWTH - 1) * events) / rate) if rate > 0.0 else last
        times = end * LOOKED_AT
        counts = method.simulate(network, start, times, FOLLOWED, seed, 1).counts
        if is_steady:
            rates = network.propensities(counts).sum(axis=-1).mean(axis=0)
        else:
            rates = np.array([network.propensities(counts[:, i], t).sum(-1).mean() for i, t in enumerate(times)])
        events, rate = float(np.trapezoid(rates, times)), float(rates[-1])
        if (events + rate * (last - end)) * event > most:
            events += rate * (last - end)
            break
    return events * event + RUN + OUTPUT * outputs
