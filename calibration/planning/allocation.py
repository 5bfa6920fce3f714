"""How many runs of each tank give every rate the wanted precision at the least cost: a linear programme."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike

from kinetics.support.arrays import Floats, Ints, divided, reals
from kinetics.support.intervals import exact_limits
from kinetics.support.packages import optimize

MOST_EVENTS = 1e12


def half_width(events: ArrayLike) -> Floats:
    """Half the width of the exact 95 % interval of a rate, relative to the rate, where so many events are expected.

    Close to 1.96 / sqrt(events); inf for none.
    """
    n = np.asarray(events, dtype=float)
    low, high = exact_limits(n, 1.0)
    return divided(high - low, 2 * n, np.inf)


def events_for(width: float) -> float:
    """Events that give a relative half-width: 395 for 10 %."""
    if not (math.isfinite(width) and width > 0):
        raise ValueError(f"width = {width}; expected a finite share above 0, such as 0.1")
    if width < (narrowest := float(half_width(MOST_EVENTS))):
        raise ValueError(
            f"width = {width:.2g}; expected {narrowest:.2g} or more, which takes {MOST_EVENTS:.0e} events of every kind"
        )
    log_n = optimize.brentq(lambda x: math.log(float(half_width(math.exp(x))) / width), -20.0, math.log(MOST_EVENTS))
    return math.exp(log_n)


def allocate(events: ArrayLike, costs: ArrayLike, needed: float) -> Ints:
    """Whole numbers of runs (K,) that together give `needed` events of every kind, at nearly the least cost.

    events : (K, G) events of each kind in a run of each tank; costs : (K,) of a run, above 0

    The linear programme is solved exactly. Its runs, of at most G tanks, are rounded up, and what the rounding made
    superfluous is left out again, the most expensive first: at most G runs above the least.
    ValueError: a kind of which no tank shows events.
    """
    table = reals("events", events, (None, None), minimum=0)
    prices = reals("costs", costs, (len(table),), minimum=0)
    if not (table.max(axis=0) > 0).all():
        raise ValueError(f"no tank shows events of kind {int(np.argmin(table.max(axis=0)))}; give other tanks")
    # in units of the best tank's runs, so that the programme is well scaled whatever is needed
    found = optimize.linprog(
        prices / prices.max(), A_ub=-table.T / table.max(axis=0)[:, None], b_ub=-1 / table.max(axis=0)
    )
    if found.status:
        raise ValueError(f"the linear programme was not solved: {found.message}")
    runs = np.ceil(np.asarray(found.x) * needed - 1e-9)
    for tank in np.argsort(-prices, kind="stable"):
        shown = table[tank] > 0
        spare = (runs @ table - needed * (1 - 1e-9))[shown] / table[tank][shown]
        runs[tank] -= max(np.floor(spare.min(initial=runs[tank])) - 2, 0)  # then one by one, as rounding decides
        while runs[tank] > 0 and ((runs @ table - table[tank]) >= needed * (1 - 1e-9)).all():
            runs[tank] -= 1
    return runs.astype(np.int64)


def affordable(events: ArrayLike, costs: ArrayLike, budget: float) -> Ints:
    """The runs (K,) of the smallest width whose cost is within a budget; all 0 if even the cheapest is above it."""
    table, prices = np.asarray(events, dtype=float), np.asarray(costs, dtype=float)
    best = np.zeros(len(prices), dtype=np.int64)
    low, high = math.log(1e-6), math.log(MOST_EVENTS)
    for _ in range(60):
        middle = (low + high) / 2
        runs = allocate(table, prices, math.exp(middle))
        if runs @ prices > budget:
            high = middle
            continue
        low = middle
        if (runs @ table).min() >= (best @ table).min():
            best = runs
    return best
