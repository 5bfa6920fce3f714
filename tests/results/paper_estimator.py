"""The estimator of the paper (eqs 12 to 15): the mean over initial states of inverse mean waiting times."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from kinetics.runs import RESTART, JumpPath
from kinetics.support.arrays import Floats


def paper_estimate(paths: Sequence[JumpPath]) -> dict[str, float]:
    """Rate constants by the paper's eqs 12 to 15, in our convention (per docking way).

    For each initial state a clock runs while the system is in that state, on through restarts and runs of the same
    kind. From the mean wait between the firings of a channel, the rate in that state is 1 / (mean wait * ways * h), and
    these rates are averaged over the initial states. The last, censored wait is dropped, so the mean of n waits is too
    short: the rate is too high by n / (n - 1) on average, which averaging over initial states does not cure. The rate
    is nan for a channel that never fired first. Returns channel -> rate constant, 1/tu.
    """
    groups: dict[bytes, list[JumpPath]] = {}
    for path in paths:
        groups.setdefault(path.initial.tobytes() + path.open_channels.tobytes(), []).append(path)
    rates = [_rates_in_one_state(group) for group in groups.values()]
    network = paths[0].network
    collected = {name: [row[j] for row in rates if np.isfinite(row[j])] for j, name in enumerate(network.channels)}
    return {name: float(np.mean(seen)) if seen else float("nan") for name, seen in collected.items()}


def _rates_in_one_state(paths: Sequence[JumpPath]) -> Floats:
    """Eqs 14 and 15 for runs from one initial state: (R,) rates, nan where a channel never fired first."""
    network = paths[0].network
    clock = 0.0
    fired: list[tuple[float, int]] = []
    for path in paths:
        edges = np.concatenate(([0.0], path.times, [path.end]))
        before = np.concatenate(([RESTART], path.channels))
        after = np.concatenate((path.channels, [RESTART]))
        for i in np.flatnonzero(before == RESTART):
            clock += edges[i + 1] - edges[i]
            if after[i] != RESTART:
                fired.append((clock, int(after[i])))
    combinations = network.combinations_of(paths[0].initial)
    rates = np.full(len(network.channels), np.nan)
    for j in {channel for _, channel in fired}:
        moments = [moment for moment, channel in fired if channel == j]
        mean_wait = moments[-1] / len(moments)  # the waits between firings add up to the last moment
        rates[j] = 1 / (mean_wait * network.ways[j] * combinations[j])
    return rates
