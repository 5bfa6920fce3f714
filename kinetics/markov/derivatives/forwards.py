"""The pass forwards: the distribution after each step of a uniformised chain, as far as later steps matter."""

from __future__ import annotations

from collections.abc import Iterator
from math import ceil, sqrt
from typing import Any

import numpy as np

from kinetics.markov.passage.backward import sums_after
from kinetics.markov.transient.poisson import ROUNDOFF
from kinetics.native import twins
from kinetics.support.arrays import Floats
from kinetics.support.memory import check_memory

KEPT_BYTES = 2**28  # of all vectors; beyond, those of a block of steps are made again from its first
THINNED = 8  # steps from one to the next that tells how much is known


class Forwards:
    """v_n = start P^n (N,) of the steps n that matter, from the last block of `length` steps to the first.

    They are kept as long as `KEPT_BYTES` hold them; of the others only the first of each block is, and the rest is made
    again, at the cost of that part of one more pass a function.

    moves, stays : P off its diagonal (N, N) by rows, and on it (N,)
    weights : (n,) of the steps; functions : (F, N), between 0 and 1
    n_steps : how many of the steps matter
    rest : what the others add at most to the weighted sum of v_n f, or to its derivative by the logarithm of any rates
    """

    def __init__(self, moves: Any, stays: Floats, start: Floats, weights: Floats, functions: Floats) -> None:
        self._moves = twins.backward_moves(*places(moves.transposed()), stays)
        most, n = weights.size, start.size
        self.length = ceil(sqrt(most))
        rows = min(KEPT_BYTES / (8.0 * n), most) + 3.0 * self.length
        check_memory(f"the steps of {n} states", 8.0 * n * rows, "ask for an earlier time or start from smaller counts")
        # of n steps each changes the mean of f by less than 1, with a weight that stands for those after it
        after = 1.01 * sums_after(np.arange(1.0, most + 1.0) * weights)
        known, held, now = np.zeros(len(functions)), 0.0, start
        self._blocks: list[Floats] = []
        for begin in range(0, most, self.length):
            end = min(begin + self.length, most)
            block = self._steps(now, end - begin)
            share = weights[begin:end:THINNED]
            if share.any():
                known += functions @ (share @ block[:-1:THINNED])  # no more than the value
            now = block[-1].copy()
            held += block.nbytes
            self._blocks.append(block if held <= KEPT_BYTES else block[:1].copy())
            self.n_steps, self.rest = end, float(after[end - 1])
            if (self.rest <= end * ROUNDOFF * known).all():  # less than the steps round
                break

    def _steps(self, first: Floats, size: int) -> Floats:
        """The vectors (size + 1, N) of a block from its first, and the first of the next."""
        block = np.empty((size + 1, first.size))
        block[0] = first
        twins.powers(self._moves, block)
        return block

    def backwards(self) -> Iterator[tuple[int, Floats]]:
        """Yield the first step of each block and its vectors (B, N), from the last block to the first."""
        for b in reversed(range(len(self._blocks))):
            begin, block = b * self.length, self._blocks[b]
            if len(block) == 1:
                block = self._steps(block[0], min(self.length, self.n_steps - begin))
            yield begin, block[:-1]


def places(matrix: Any) -> tuple[Any, Any, Floats]:
    """A matrix by rows, as kernels read it: with unsigned places, which Numba need not look at."""
    return matrix.indptr.astype(np.uint32), matrix.indices.astype(np.uint32), matrix.data
