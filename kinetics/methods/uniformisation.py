"""Uniformisation: a Markov chain as a discrete chain that steps at the times of a Poisson process.

With q at least the largest exit rate, P = 1 + Q/q is a stochastic matrix and p(t) = sum over n of Poisson(n; q t) p P^n
(Jensen 1953). Every term is positive, so nothing cancels and no probability falls below zero.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from kinetics.arrays import Floats

if TYPE_CHECKING:
    from scipy.sparse import csr_array

BLOCK = 64  # steps whose vectors are kept and mixed by one matrix product
MAX_STEPS = 5_000_000
EPSILON = float(np.finfo(float).eps)


@dataclass(frozen=True, eq=False)
class DiscreteChain:
    """The uniformised chain of a generator.

    rate : q, 1/tu
    transposed : csr_array (N, N), P transposed, so that p P is a product with a row-major matrix
    """

    rate: float
    transposed: Any

    @classmethod
    def of(cls, generator: csr_array) -> DiscreteChain:
        """The chain of a generator (N, N) whose rows sum to 0."""
        from scipy.sparse import csr_array, eye_array

        rate = float(-generator.diagonal().min(initial=0.0)) or 1.0
        step = csr_array((eye_array(generator.shape[0]) + generator / rate).T)
        np.maximum(step.data, 0.0, out=step.data)  # a diagonal of 1 - 1 may come out as -1e-16
        return cls(rate, step)

    def steps_until(self, time: float, tolerance: float) -> int:
        """Steps after which, but for `tolerance`, all of the Poisson law at `time` has been seen."""
        return poisson_bounds(self.rate * time, tolerance)[1]

    def rounding(self, steps: int) -> float:
        """Bound on the total error by rounding of a vector after so many steps.

        A step adds at most as many positive products as a row of the transposed matrix holds, each right to two
        roundings, and its matrix is wrong by one more.
        """
        longest = int(np.diff(self.transposed.indptr).max(initial=0))
        return steps * (longest + 3) * EPSILON


def poisson_bounds(mean: float, tolerance: float) -> tuple[int, int]:
    """First and last number outside which a Poisson law has at most `tolerance` (Chernoff's bound on both sides)."""
    depth = np.log(2.0 / tolerance)
    below = np.sqrt(2.0 * mean * depth)
    above = depth / 3.0 + np.sqrt(depth**2 / 9.0 + 2.0 * mean * depth)
    return max(0, int(np.floor(mean - below))), int(np.ceil(mean + above))


def poisson_window(mean: float, tolerance: float) -> tuple[int, Floats]:
    """The numbers first, first + 1, ... and their Poisson probabilities, scaled to sum to 1.

    Grown from the mode by ratios, as Fox & Glynn (1988) do: no factorial, no underflow.
    """
    if mean == 0.0:
        return 0, np.ones(1)
    first, last = poisson_bounds(mean, tolerance)
    mode = int(mean)
    rising = np.cumprod(mean / np.arange(mode + 1, last + 1))
    falling = np.cumprod(np.arange(mode, first, -1) / mean)[::-1]
    weights = np.concatenate([falling, [1.0], rising])
    return first, weights / weights.sum()


def mixtures(chain: DiscreteChain, start: Floats, times: Sequence[float] | Floats, tolerance: float) -> Floats:
    """p(t) (T, N) at all `times` from one pass of steps, each right to `tolerance` and rounding."""
    windows = [poisson_window(chain.rate * float(time), tolerance) for time in times]
    ends = np.array([first + weights.size for first, weights in windows])
    firsts = np.array([first for first, _ in windows])
    mixed = np.zeros((len(windows), start.size))
    vector = start
    n_steps = int(ends.max(initial=0))
    for begin in range(0, n_steps, BLOCK):
        end = min(begin + BLOCK, n_steps)
        vectors = np.empty((end - begin, start.size))
        for row in vectors:
            row[:] = vector
            vector = chain.transposed @ vector
        active = np.flatnonzero((firsts < end) & (ends > begin))
        if active.size:
            mixed[active] += _weights_between(begin, end, [windows[i] for i in active]) @ vectors
    return mixed


def _weights_between(begin: int, end: int, windows: Sequence[tuple[int, Floats]]) -> Floats:
    """Weights (windows, end - begin) of the steps from `begin` to before `end`."""
    table = np.zeros((len(windows), end - begin))
    for row, (first, weights) in zip(table, windows, strict=True):
        low, high = max(begin, first), min(end, first + weights.size)
        row[low - begin : high - begin] = weights[low - first : high - first]
    return table


class Absorption:
    """How much of the probability has reached the last state of a chain by each step; grows as far as it is asked."""

    def __init__(self, chain: DiscreteChain) -> None:
        self._chain = chain
        self._vector = np.zeros(chain.transposed.shape[0])
        self._vector[0] = 1.0
        self._absorbed: NDArray[np.float64] = np.empty(0)
        self._alive: NDArray[np.float64] = np.empty(0)

    def at(self, time: float, tolerance: float) -> tuple[float, float]:
        """Probability that the last state has been reached by `time`, and that it has not."""
        first, weights = poisson_window(self._chain.rate * time, tolerance)
        self._extend(first + weights.size)
        window = slice(first, first + weights.size)
        return float(weights @ self._absorbed[window]), float(weights @ self._alive[window])

    def _extend(self, n_steps: int) -> None:
        begin = self._absorbed.size
        if n_steps <= begin:
            return
        # By half as much again each time, so that many small requests copy little.
        end = max(n_steps, begin + begin // 2)
        self._absorbed = np.concatenate([self._absorbed, np.empty(end - begin)])
        self._alive = np.concatenate([self._alive, np.empty(end - begin)])
        for n in range(begin, end):
            self._absorbed[n] = self._vector[-1]
            self._alive[n] = self._vector[:-1].sum()
            self._vector = self._chain.transposed @ self._vector
