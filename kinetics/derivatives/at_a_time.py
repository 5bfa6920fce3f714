"""Derivatives of an expected value at a time, or of its integral, by all rates: one pass forwards and one backwards.

With P = 1 + Q / q the uniformised chain, the value is the sum over n of w_n start P^n f: w_n is the Poisson
probability of n steps, or for the integral that of more than n, over q. A channel adds Q_r to Q, in proportion to its
rate, so its derivative by ln k_r is the sum over n of v_n (Q_r / q) l_(n+1), with v_n = start P^n forwards and
l_n = P l_(n+1) + w_n f backwards: the adjoint of all rates at once (reverse mode).

Every rounding in v and l is as if an entry of P were wrong by a small share, k, at one step. So the computed
derivative is a mean over the paths of n steps, in which the score of a path, M = sum of dln P / dln k_r over its steps,
comes with each step's wrong factors. Two bounds follow, and for each channel the smaller is taken.

- Terms of one sign, as in the value itself: n k times the sum of all that is added and subtracted.
- The score is a martingale: the mean of its square is that of the sum of its steps' squares, about the number of the
  channel's firings (Plyasunov & Arkin 2007, doi:10.1016/j.jcp.2006.06.047). By Cauchy and Schwarz the mean of f |M| is
  at most sqrt(mean f**2 * mean M**2). A step's wrong factor meets the scores before it, and those after it: in all
  2 n k of these means.
"""

from __future__ import annotations

from collections.abc import Iterator
from math import ceil, exp, expm1, sqrt
from typing import Any, NamedTuple

import numpy as np

from kinetics.derivatives.slopes import ChannelEntries, Slopes
from kinetics.passage.backward import (
    LEFT_OUT,
    LOST,
    LimitedValue,
    expected_at,
    jump_rate,
    one_step,
    steps_until,
    sums_after,
    weights_errors,
)
from kinetics.passage.until import earning_with
from kinetics.solving.poisson import ROUNDOFF, poisson_window
from kinetics.solving.uniformisation import MAX_STEPS
from kinetics.support.arrays import Floats
from kinetics.support.memory import check_memory

SPARE = 1.25  # q over the largest exit rate: as a rate in doubt changes what stays, much has to
KEPT_BYTES = 2**27  # of all vectors of the pass forwards; beyond, they are made again from every sqrt(n)-th


class Weights(NamedTuple):
    """Of the steps: their weights (n,), and the relative error of these."""

    values: Floats
    error: float


def slopes_at(entries: ChannelEntries, start: Floats, functions: Floats, time: float) -> list[Slopes]:
    """Of the means of F functions (F, N), none negative, at a time, tu; one pass backwards each.

    ValueError: too many steps, or too little memory
    """
    chain = entries.transitions
    if time == 0.0 or not chain.rates.any():
        return [Slopes.none(expected_at(chain, start, values, time), entries.n_channels) for values in functions]
    n_steps, (first, window), error = _window(entries, time)
    weights = Weights(np.append(np.zeros(first), window), error)
    passes = Passes(entries, start, weights)
    return [passes.slopes(values, LOST * n_steps) for values in functions]


def slopes_up_to(
    entries: ChannelEntries, start: Floats, earning: Floats, time: float, worth: Floats | None = None
) -> Slopes:
    """Of the mean of what is earned up to a time, tu.

    earning : (N,) a time unit in each state; worth : (K,) at each jump, none negative
    """
    chain = entries.transitions
    if time == 0.0 or not chain.rates.any():
        value = float(start @ earning) * time
        limited = LimitedValue.within(value, ROUNDOFF * (start.size + 2), time == 0.0 or chain.is_certified)
        return Slopes.none(limited, entries.n_channels)
    n_steps, (first, window), error = _window(entries, time)
    tails = np.append(np.ones(first), sums_after(window)) / jump_rate(chain, SPARE)
    weights = Weights(tails, error + ROUNDOFF * (window.size + 2))
    return Passes(entries, start, weights).slopes(earning, LOST * n_steps * time, worth)


def _window(entries: ChannelEntries, time: float) -> tuple[int, tuple[int, Floats], float]:
    """The number of steps, the Poisson weights and where they begin, and the largest relative error of one."""
    steps = steps_until(entries.transitions, time, SPARE)
    if steps > MAX_STEPS:
        raise ValueError(
            f"the chain is too stiff for derivatives by uniformisation: {steps:.3g} steps until {time:g} tu, at most "
            f"{MAX_STEPS}; ask for an earlier time"
        )
    mean = jump_rate(entries.transitions, SPARE) * time
    first, window = poisson_window(mean, LEFT_OUT)
    return first + window.size, (first, window), float(weights_errors(mean, first, window.size).max())


class Passes:
    """The pass forwards, and those backwards on top of it.

    occupation : (N,) expected weight of the steps after each visit of a state
    """

    def __init__(self, entries: ChannelEntries, start: Floats, weights: Weights) -> None:
        chain = entries.transitions
        self._entries, self._start, self._weights = entries, start, weights
        matrix, roundings = one_step(chain, SPARE)
        matrix.sort_indices()
        self._matrix, self._rate = matrix, jump_rate(chain, SPARE)
        n_steps, n = weights.values.size, chain.size
        inflows = int(np.bincount(chain.columns, minlength=1).max())
        # a rate that is wrong by e moves what stays, a fifth at least, by up to four times as much
        each = ROUNDOFF * (roundings + 2.0 * (inflows + 2.0) + 4.0 * (chain.roundings + 1.0))
        self._wrong = 1.01 * n_steps * each
        # where each entry is in P
        keys = np.repeat(np.arange(n), np.diff(matrix.indptr)) * n + matrix.indices
        self._places = np.searchsorted(keys, chain.rows * n + chain.columns)
        self._forwards = Forwards(matrix, start, sums_after(weights.values))
        self.occupation = self._forwards.mixed

    def slopes(self, values: Floats, lost: float, worth: Floats | None = None) -> Slopes:
        """Of the mean of `values` (N,).

        lost : relative to the largest value, what is left out and underflows
        worth : (K,) what each jump adds to the values of the state that it leaves, in proportion to its rate
        """
        chain, entries = self._entries.transitions, self._entries
        values, rounded_values = earning_with(chain, values, worth)
        scale = float(values.max()) or 1.0
        later, gained, held = self._back(values / scale)
        mean, share = float(self._start @ later), chain.rates / self._rate
        terms = share * gained[self._places]
        value = entries.by_channel(terms)
        # all that is added and subtracted on the way to these terms
        size = 2.0 * entries.by_channel(share * held[chain.rows]) + value
        stays = self._matrix.diagonal()[chain.rows]
        firings = entries.by_channel(share * (1.0 + share / stays) * self.occupation[chain.rows])
        wrong, error = self._wrong, self._weights.error + 4.0 * ROUNDOFF + rounded_values
        relative = expm1(wrong) + error
        scores = wrong * exp(wrong) * (2.0 + wrong * exp(wrong)) + error
        wide = np.minimum(relative * size, scores * np.sqrt(mean * firings))
        rounded = 2.0 * self._forwards.length + chain.roundings + 16.0
        added = rounded * size + entries.most * entries.by_channel(np.abs(terms))
        wide = 1.02 * wide + 1.01 * ROUNDOFF * added + lost
        if worth is not None:
            spent = sum(self._weights.values[n : n + len(block)] @ block for n, block in self._forwards.backwards())
            direct = entries.by_channel(chain.rates * worth * np.asarray(spent)[chain.rows] / scale)
            relative += ROUNDOFF * (entries.most + rounded)
            value, wide = value + direct, wide + 1.01 * relative * direct
        answer = LimitedValue.within(
            mean * scale, relative + ROUNDOFF * (self._start.size + 2), chain.is_certified, lost * scale
        )
        return Slopes(answer, value * scale, wide * scale, chain.is_certified)

    def _back(self, values: Floats) -> tuple[Floats, Floats, Floats]:
        """l_0 (N,); of every entry of P the sum of v (l there - l here); of every state that of v l.

        Added up within blocks first, so that the roundings are those of 2 sqrt(n) additions.
        """
        from kinetics.kernels import markov

        one_step_arrays, later = arrays(self._matrix), np.zeros(values.size)
        gained, held = np.zeros(self._matrix.nnz), np.zeros(values.size)
        for begin, vectors in self._forwards.backwards():
            more, longer = np.zeros_like(gained), np.zeros_like(held)
            weights = self._weights.values[begin : begin + len(vectors)]
            markov.steps_back(*one_step_arrays, vectors, weights, values, later, more, longer)
            gained += more
            held += longer
        return later, gained, held


def arrays(matrix: Any) -> tuple[Any, Any, Floats]:
    """A matrix by rows, as kernels read it: with unsigned places, which Numba need not look at."""
    return matrix.indptr.astype(np.uint32), matrix.indices.astype(np.uint32), matrix.data


class Forwards:
    """v_n = start P^n (N,) for all steps n, from the last block of `length` steps to the first.

    They are kept where all of them fit into `KEPT_BYTES`; else only the first of each block is, and the others are made
    again, at the cost of one more pass a function.

    mixed : (N,) sum over n of weights (n_steps,) times v_n
    """

    def __init__(self, matrix: Any, start: Floats, weights: Floats) -> None:
        from kinetics.kernels import markov

        self._arrays = arrays(matrix.T.tocsr())
        n, self._n_steps = start.size, weights.size
        self.length = ceil(sqrt(self._n_steps))
        n_blocks = ceil(self._n_steps / self.length)
        keeps = 8.0 * n * self._n_steps <= KEPT_BYTES
        rows = self._n_steps if keeps else n_blocks + self.length
        check_memory(f"the steps of {n} states", 8.0 * n * rows, "ask for an earlier time, or start from fewer copies")
        self._block = np.empty((1 if keeps else self.length, n))
        self._vectors = np.empty((self._n_steps if keeps else n_blocks, n))
        self._keeps, mixed, now = keeps, np.zeros((1, n)), start.copy()
        for b, begin in enumerate(range(0, self._n_steps, self.length)):
            block = self._vectors[begin : begin + self.length] if keeps else self._block[: self._n_steps - begin]
            self._fill(block, now)
            self._vectors[begin if keeps else b] = now
            markov.mix(np.zeros(1, dtype=np.int64), weights[None, begin : begin + len(block)], block, mixed)
            now = self._next(block[-1])
        self.mixed = mixed[0]

    def _fill(self, block: Floats, first: Floats) -> None:
        """The rows of a block, from its first."""
        from kinetics.kernels import markov

        block[0] = first
        markov.powers(*self._arrays, block)

    def _next(self, vector: Floats) -> Floats:
        pair = np.array([vector, vector])
        self._fill(pair, vector)
        return pair[1]

    def backwards(self) -> Iterator[tuple[int, Floats]]:
        """Where each block begins and its vectors (B, N), the last block first."""
        for begin in reversed(range(0, self._n_steps, self.length)):
            end = min(begin + self.length, self._n_steps)
            if self._keeps:
                yield begin, self._vectors[begin:end]
            else:
                self._fill(self._block[: end - begin], self._vectors[begin // self.length])
                yield begin, self._block[: end - begin]
