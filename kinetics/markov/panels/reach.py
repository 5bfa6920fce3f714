"""From which states a look can be reached: not from those with too much of what falls slowly, or too little of what
rises slowly.

Let w n be a sum of counts that falls by no more than d at once, by events of single copies alone, which take at most
k w_i n_i per time from each count. It falls no faster than w n / d independent parts that each go at the rate k: after
a time t, the mean of z**(w n / d), 0 < z < 1, is no more than (1 - (1 - z) exp(-k t))**(w n / d) with what was there
before, as in a pure death process. Markov's inequality then bounds the probability of w n <= high. What rises is a pure
birth process (Yule) with immigration, and z > 1. Each z gives a bound; the best of some is taken.

Death and birth processes: Bailey (1964), The Elements of Stochastic Processes, chapter 8; bounds of this kind: Chernoff
(1952), doi:10.1214/aoms/1177729330.
"""

from __future__ import annotations

from collections.abc import Callable
from itertools import combinations
from typing import NamedTuple

import numpy as np

from kinetics.markov.panels.data import PanelData, PanelRun
from kinetics.markov.passage.until import Mask
from kinetics.network import Network
from kinetics.support.arrays import Floats, Ints

NEGLIGIBLE = 1e-17  # the probability with which a look is reached from a state that is left out
MARGIN = 1e-9  # relative, for the rounding of limits
PLACES = np.logspace(-6.0, 6.0, 400)  # of z between its ends


class Pace(NamedTuple):
    """How fast a sum can move in one direction.

    jump : its largest change by one event; 0 if it never moves that way
    rate : 1/tu, most that each part of it changes per time, over that part; inf if there is no bound
    inflow : 1/tu, events of size `jump` that need nothing
    """

    jump: float
    rate: float
    inflow: float


class Sum(NamedTuple):
    """A weighted sum of counts, its range just before a look, and how fast it can fall and rise.

    weights : (S,)
    """

    weights: Floats
    low: float
    high: float
    falls: Pace
    rises: Pace


class Reach:
    """From which states a look of a run can be reached: sums of counts with limits that depend on the time before it.

    The sums are those of what is seen, and of any two that are.

    fired : channels one of which the event at the look stands for; None if there is none
    """

    def __init__(self, network: Network, data: PanelData, run: PanelRun, look: int, fired: Ints | None) -> None:
        rows = zip(data.weights(network), data.observations.values(), run.seen[look], strict=True)
        seen = [(row, *each.support(float(value))) for row, each, value in rows if not np.isnan(value)]
        seen += [(a + b, lows + low, highs + high) for (a, lows, highs), (b, low, high) in combinations(seen, 2)]
        works = np.ones(len(network.channels), dtype=bool) if network.laws else network.known_rates > 0
        # A channel whose events are recorded does not fire before the look.
        works[[network.channel_places[name] for names in data.events for name in names]] = False
        self._sums = []
        for weights, low, high in seen:
            changes = network.stoichiometry @ weights
            by_event = np.zeros(1) if fired is None else changes[fired]
            falls, rises = (_pace(network, weights, way * changes, works) for way in (-1.0, 1.0))
            self._sums.append(Sum(weights, low - by_event.max(), high - by_event.min(), falls, rises))

    def out_of_reach(self, time: float) -> Callable[[Ints], Mask]:
        """Whether the look is out of reach of states (N, S) a time, tu, before it, but for a probability of
        `NEGLIGIBLE`.

        time : inf for whether it can never be reached
        """
        limits = [(each.weights, least(each, time), most(each, time)) for each in self._sums]
        limits = [(weights, low, high) for weights, low, high in limits if low > -np.inf or high < np.inf]

        def is_out(states: Ints) -> Mask:
            found = np.zeros(len(states), dtype=bool)
            for weights, low, high in limits:
                total = states @ weights
                found |= (total < low) | (total > high)
            return found

        return is_out


def _pace(network: Network, weights: Floats, changes: Floats, works: Mask) -> Pace:
    """How fast a sum can move by the working channels (R,) with a positive change (R,)."""
    chosen = np.flatnonzero(works & (changes > 0))
    if not chosen.size:
        return Pace(0.0, 0.0, 0.0)
    jump, needed = float(changes[chosen].max()), network.sparse_reactants
    taken = np.bincount(needed.rows, needed.copies, minlength=len(network.channels)).astype(float)
    taken[[network.channel_places[name] for name in network.channel_laws]] = np.inf
    part = np.zeros(len(network.channels), dtype=np.int64)
    part[needed.rows] = needed.columns
    from_nothing, from_one = chosen[taken[chosen] == 0], chosen[taken[chosen] == 1]
    change = network.known_rates * network.ways * changes
    inflow = float(change[from_nothing].sum()) / jump * (1.0 + MARGIN)
    if (weights < 0).any() or from_nothing.size + from_one.size < chosen.size or not weights[part[from_one]].all():
        return Pace(jump, np.inf, inflow)
    by_part = np.bincount(part[from_one], change[from_one] / weights[part[from_one]], minlength=weights.size)
    return Pace(jump, float(by_part.max()) * (1.0 + MARGIN), inflow)


def most(each: Sum, time: float) -> float:
    """What a sum does not fall from to its range in a time, tu, if it is above, but for a probability of `NEGLIGIBLE`.

    >>> import numpy as np
    >>> from kinetics.markov.panels.reach import Pace, Sum, most
    >>> slowly, never = Pace(jump=1.0, rate=0.1, inflow=0.0), Pace(0.0, 0.0, 0.0)
    >>> round(most(Sum(np.ones(1), low=40.0, high=50.0, falls=slowly, rises=never), time=1.0), 1)
    91.2
    """
    pace, high = each.falls, each.high
    if pace.jump == 0.0 or high == np.inf:
        return high
    stays = np.exp(-pace.rate * time)
    # z = place / (1 + place); what is there at the beginning has 1 - stays (1 - z) in its place
    start, later = -np.log1p(1.0 / PLACES), np.log1p(-stays / (1.0 + PLACES))
    falls = later < 0.0
    limits = (pace.jump * np.log(NEGLIGIBLE) + max(high, 0.0) * start[falls]) / later[falls]
    return float(limits.min(initial=np.inf)) * (1.0 + MARGIN) + MARGIN


def least(each: Sum, time: float) -> float:
    """What a sum does not rise from to its range in a time, tu, if it is below, but for a probability of `NEGLIGIBLE`.

    >>> import numpy as np
    >>> from kinetics.markov.panels.reach import Pace, Sum, least
    >>> slowly, never = Pace(jump=1.0, rate=0.1, inflow=0.0), Pace(0.0, 0.0, 0.0)
    >>> round(least(Sum(np.ones(1), low=40.0, high=50.0, falls=never, rises=slowly), time=1.0), 1)
    13.1
    """
    pace, low = each.rises, each.low
    if pace.jump == 0.0 or low <= 0.0:
        return low
    stays = np.exp(-pace.rate * time)
    if not stays > 0.0:
        return -np.inf
    # z = (1 + place) / (1 + place (1 - stays)); what is there at the beginning has 1 + place in its place
    ahead, later = np.log1p(PLACES * (1.0 - stays)), np.log1p(PLACES)
    brought = pace.inflow * (PLACES * time if pace.rate == 0.0 else ahead / pace.rate)
    limits = (pace.jump * (np.log(NEGLIGIBLE) - brought) + low * (later - ahead)) / later
    return float(limits.max()) * (1.0 - MARGIN) - MARGIN
