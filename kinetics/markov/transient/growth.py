"""How a set of packed states grows, so that it is there before the probability."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from kinetics.markov.transient.packed import PackedChain, Rows
from kinetics.native import packed
from kinetics.support.arrays import Floats, Ints

FEWEST, MOST = 4, 64  # steps between two looks at where the probability goes
CAUTION, LEAST_CAUTION, MOST_CAUTION = 3e-2, 1e-9, 1.0
LAYERS = 64  # events that a set grows by at once, at most
FEW, MANY = 0.02, 0.2  # of a set: if it grows by fewer, the next look is later; if by more, sooner


@dataclass(eq=False)
class SetGrowth:
    """The growth of a set of states; nothing in it is relied on by a bound, which counts what is lost all the same.

    planned : probability that may be lost in a unit of time because the set does not grow to where it goes
    caution : share of it that is planned with: states gain probability between two looks
    check_size : refuses so many states
    stride : steps until the next look
    """

    chain: PackedChain
    planned: float
    caution: float
    check_size: Callable[[int], None]
    stride: int = FEWEST

    def dare(self) -> None:
        """Grow less: little was lost."""
        self.caution = min(3.0 * self.caution, MOST_CAUTION)

    def beware(self) -> None:
        """Grow more: too much was lost."""
        self.caution = max(self.caution / 8.0, LEAST_CAUTION)

    def grown(
        self, rows: Rows, vector: Floats, rate: float, span: float, weight: float, leads: packed.Bits
    ) -> tuple[Rows, Floats]:
        """The set with the states that the probabilities (N,) are about to reach within a time `span`, and those.

        rate : states with a larger exit rate are left out
        weight : probability that what is lost now matters
        leads : bits (N, W) of the channels that lead out of the set

        A state k events away is reached with a chance of about the product of the expected events, over k!. As many of
        the least likely are left out as may be lost.
        """
        size, budget = rows.keys.size, self.caution * self.planned * span / max(weight, 1e-300)
        source, chances, among = rows, vector, rows
        for layer in range(1, LAYERS):
            floor = budget * layer / (span * self.chain.n_channels * source.keys.size)
            keys, flows = self.chain.spilled(source, chances, leads, floor, among.keys)
            flows = flows * (span / layer)
            chosen = likeliest(flows, budget)
            if not chosen.any():
                break
            more = self.chain.rows(np.ascontiguousarray(keys[chosen]))
            slow = more.exits <= rate
            if not slow.all():
                chosen[np.flatnonzero(chosen)[~slow]] = False
                more = more.picked(slow)
            if not more.keys.size:
                break
            among = merged(among, more)
            source, chances, leads = more, flows[chosen], more.able
            self.check_size(among.keys.size)
        added = among.keys.size - size
        if added < FEW * size:
            self.stride = min(self.stride + self.stride // 2 + 1, MOST)
        elif added > MANY * size:
            self.stride = max(self.stride // 2, FEWEST)
        if not added:
            return rows, vector
        return among, moved(vector, np.searchsorted(among.keys, rows.keys), among.keys.size)


def merged(rows: Rows, more: Rows) -> Rows:
    """Both sets, which have no state in common."""
    places = np.searchsorted(more.keys, rows.keys) + np.arange(rows.keys.size)
    others = np.searchsorted(rows.keys, more.keys) + np.arange(more.keys.size)
    both: list[NDArray[Any]] = []
    pairs: Any = zip(rows, more, strict=True)
    for one, other in pairs:
        together = np.empty((places.size + others.size, *one.shape[1:]), one.dtype)
        together[places], together[others] = one, other
        both.append(together)
    return Rows(*both)


def moved(values: Floats, places: Ints, size: int) -> Floats:
    """Values (..., N) at their places among `size` others, which are 0."""
    found = np.zeros((*values.shape[:-1], size))
    found[..., places] = values
    return found


def likeliest(values: Floats, rest: float) -> NDArray[np.bool_]:
    """The places (N,) of the largest values; all others sum to at most `rest`.

    Linear: by powers of two, of which one is sorted.

    >>> likeliest(np.array([0.5, 0.1, 0.2, 0.3]), 0.35).tolist()
    [True, False, False, True]
    """
    if not values.size or rest <= 0.0:
        return np.asarray(values > 0.0)
    _, powers = np.frexp(values)
    powers[values == 0.0] = -1100
    low = int(powers.min())
    sums = np.cumsum(np.bincount(powers - low, values))
    edge = low + int(np.searchsorted(sums, rest, side="right"))  # all below this power are left out
    is_large = powers >= edge
    some = np.flatnonzero(powers == edge)
    spent = float(sums[edge - low - 1]) if edge > low else 0.0
    order = some[np.argsort(values[some])]
    is_large[order[spent + np.cumsum(values[order]) <= rest]] = False
    return np.asarray(is_large)
