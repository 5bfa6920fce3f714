"""Whether a network has no end: some way of mass action that can be gone again and again, and leaves more each time.

A channel of mass action that can fire can also fire where there are more copies of anything. So where a way of such
channels leads from one state to another that has no fewer copies of any species, and more of one, it can be gone from
there too, without end (Karp & Miller 1969, doi:10.1016/S0022-0000(69)80011-5). What is found is thus proven; that
nothing is found proves nothing.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from kinetics.network import Network
from kinetics.support.arrays import Ints

WALKS, STEPS = 20, 100  # random walks, and their events
MOST_COMPARED = 2 * 10**8  # counts, on all walks together


def endless_growth(network: Network, reached: Ints) -> str:
    """A sentence on what grows without bound from some of the states reached (N, S); "" if nothing is found."""
    needed, changes = network.sparse_reactants, network.sparse_stoichiometry
    works = changes.has_entries
    if network.rate_constants is not None:
        works &= network.rate_constants * network.ways > 0
    works[[network.channel_places[name] for name in network.laws]] = False
    loses = np.zeros(works.size, dtype=bool)
    loses[changes.rows[changes.copies < 0]] = True
    for r in np.flatnonzero(works & ~loses).tolist():
        species, copies = needed.row(r)
        if (reached[:, species] >= copies).all(axis=1).any():
            risen = network.species[changes.row(r)[0][0]]
            return f"channel {network.channels[r]!r} raises {risen} without bound, and uses nothing up"
    rng = np.random.default_rng(0)
    steps = max(10, min(STEPS, int((2 * MOST_COMPARED / (WALKS * reached.shape[1])) ** 0.5)))
    walks = (_walked(network, reached[rng.integers(len(reached))], works, steps, rng) for _ in range(WALKS))
    return next(filter(None, walks), "")


def _walked(network: Network, start: Ints, works: NDArray[np.bool_], steps: int, rng: np.random.Generator) -> str:
    """A sentence on species of which a random walk has more than at an earlier state, all others being no fewer."""
    needed, changes = network.sparse_reactants, network.sparse_stoichiometry
    past = np.empty((steps + 1, start.size), dtype=np.int64)
    past[0] = state = start
    for k in range(steps):
        able = works.copy()
        able[needed.rows[state[needed.columns] < needed.copies]] = False
        if not able.any():
            return ""
        species, copies = changes.row(int(rng.choice(np.flatnonzero(able))))
        state = state.copy()
        state[species] += copies
        before = past[: k + 1]
        less = (before <= state).all(axis=1) & (before < state).any(axis=1)
        if less.any():
            risen = np.flatnonzero(before[np.argmax(less)] < state)
            names = ", ".join(network.species[s] for s in risen[:3])
            return f"some channels together raise {names} without bound, and use nothing up"
        past[k + 1] = state
    return ""
