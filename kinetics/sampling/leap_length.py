"""The number of events of an exact leap from given counts, found without a kernel, so that `auto` can use it."""

from __future__ import annotations

import numpy as np

from kinetics.kernels.leap_limits import LARGEST_COUNT, MOST_EVENTS, TRIALS, WIDE, next_length
from kinetics.network import Network
from kinetics.sampling.mass_action import MassAction, mass_action, order_refusal
from kinetics.support.arrays import Floats, Ints

FEWEST_COPIES = 10_000  # of the most frequent species; among fewer no leap pays, and nothing is computed
OPEN_EVENTS = 2.0  # of a leap of the best length; from 1 to 4 the cost is the same within a tenth


def events_of_leap(network: Network, initial: Ints) -> float:
    """Events that a leap from `initial` (S,) is expected to hold; 0 if none pays, or not all are of mass action.

    Leaps are as long as leaves `OPEN_EVENTS` undecided, by the search of `kernels.leap_plan.plan_leap`.
    """
    is_worth_it = FEWEST_COPIES <= initial.max(initial=0) <= LARGEST_COUNT
    if not is_worth_it or not network.is_mass_action or order_refusal(network):
        return 0.0
    laws, here = mass_action(network), initial.astype(float)
    with np.errstate(over="ignore", invalid="ignore"):
        means = _propensities(laws, here)
        total = float(means.sum())
        longest = MOST_EVENTS / total if total > 0.0 else np.inf
        if not (longest < np.inf and total < np.inf):
            return 0.0
        length = min(1.0 / total, longest)
        for _ in range(TRIALS):
            low, high = _box(network, here, means * length)
            undecided = length * float((_propensities(laws, high) - _propensities(laws, low)).sum())
            tried, length = length, next_length(length, longest, undecided, OPEN_EVENTS)
            if length == tried:
                break
    fits = undecided < 4.0 * OPEN_EVENTS and high.max() <= LARGEST_COUNT
    return total * length if fits else 0.0


def _propensities(laws: MassAction, counts: Floats) -> Floats:
    """(R,) at counts (S,)."""
    copies = np.append(counts, 1.0)[laws.factors[:, :, 0]]
    factors = np.where(copies >= laws.factors[:, :, 2], copies - laws.factors[:, :, 1], 0.0)
    return np.asarray(laws.coefficients * factors.prod(axis=1))


def _box(network: Network, here: Floats, means: Floats) -> tuple[Floats, Floats]:
    """Counts (S,) that are seldom left by so many events (R,) in the worst order."""
    change = network.sparse_stoichiometry
    widths = []
    for moves in (np.maximum(-change.copies, 0), np.maximum(change.copies, 0)):
        mean = np.bincount(change.columns, means[change.rows] * moves, here.size)
        variance = np.bincount(change.columns, means[change.rows] * moves.astype(float) ** 2, here.size)
        widths.append(np.ceil(mean + WIDE * np.sqrt(variance)))
    return np.maximum(here - widths[0], 0.0), here + widths[1]
