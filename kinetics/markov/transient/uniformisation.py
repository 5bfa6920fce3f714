"""Uniformisation: a Markov chain as a discrete chain that steps at the times of a Poisson process.

With q at least the largest exit rate, P = 1 + Q/q is a stochastic matrix and p(t) = sum over n of Poisson(n; q t) p P^n
(Jensen 1953, doi:10.1080/03461238.1953.10419459;
Grassmann 1977, doi:10.1016/0305-0548(77)90007-7). Every term is positive, so nothing cancels and no probability falls
below zero.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from kinetics.markov.transient.poisson import ROUNDOFF, poisson_bounds, poisson_tails, poisson_window, window_error
from kinetics.markov.transient.transitions import RATE_ERROR, Transitions
from kinetics.native import twins
from kinetics.native.rate_tables import RateTable
from kinetics.support.arrays import Floats, Ints
from kinetics.support.cli.progress import forecast
from kinetics.support.packages import sparse
from kinetics.support.tables import rough

BLOCK = 64  # steps whose vectors are kept and mixed by one matrix product
BLOCK_BYTES = 2**29  # of these vectors
MAX_STEPS = 5_000_000
STEP_SECONDS = 7e-10  # a step takes this for every transition and every state, on a common machine


class Arrays(NamedTuple):
    """A chain as `kernels.markov` reads it."""

    begins: NDArray[np.uint32]
    sources: NDArray[np.uint32]
    shares: Floats
    exits: Floats


@dataclass(frozen=True, eq=False)
class DiscreteChain:
    """The uniformised chain of a generator; if exits exceed the rates that stay inside, it loses mass.

    rate : q, 1/tu
    arrays : inflows and exits of every state as shares of q
    terms : most rates into plus most rates out of one state
    rate_error : relative error of each rate, in roundings
    """

    rate: float
    arrays: Arrays
    terms: int
    rate_error: float = RATE_ERROR

    @classmethod
    def of(cls, transitions: Transitions, most_out: int | None = None) -> DiscreteChain:
        """The chain of all states; what leaks is lost. most_out : as in `from_rates`"""
        rows, columns, rates, *_ = transitions
        return cls.from_rates(rows, columns, rates, transitions.exits, most_out, transitions.roundings)

    @classmethod
    def from_rates(
        cls,
        rows: Ints,
        columns: Ints,
        rates: Floats,
        exits: Floats,
        most_out: int | None = None,
        rate_error: float = RATE_ERROR,
    ) -> DiscreteChain:
        """The chain that goes from rows (K,) to columns (K,) at rates (K,), and leaves its states at exits (N,).

        most_out : most rates behind one exit. None: as many as lead on from there
        rate_error : of each rate, in roundings
        """
        rate = float(exits.max(initial=0.0)) or 1.0
        n = exits.size
        moves = RateTable.of(columns, rows, rates / rate, n)
        most_in, most_on = (int(np.bincount(ends, minlength=1).max()) for ends in (columns, rows))
        terms = most_in + (most_on if most_out is None else most_out)
        arrays = Arrays(moves.indptr.astype(np.uint32), moves.indices.astype(np.uint32), moves.data, exits / rate)
        return cls(rate, arrays, terms, rate_error)

    @property
    def size(self) -> int:
        """Number of states."""
        return self.arrays.exits.size

    @cached_property
    def inflows(self) -> Any:
        """csr_array (N, N): of each state, in a row, the shares of q at which the others lead to it."""
        begins, sources, shares, _ = self.arrays
        return sparse.csr_array(
            (shares, sources.astype(np.int64), begins.astype(np.int64)), shape=(self.size, self.size)
        )

    @cached_property
    def transposed(self) -> Any:
        """csr_array (N, N), P transposed: `transposed @ p` is p P."""
        stays: Any = sparse.dia_array((1.0 - self.arrays.exits[None, :], [0]), shape=self.inflows.shape)
        return sparse.csr_array(self.inflows + stays)

    def steps_until(self, time: float, tolerance: float) -> int:
        """Steps after which, but for `tolerance`, all of the Poisson probability at `time` has been seen."""
        return poisson_bounds(self.rate * time, tolerance)[1]

    @property
    def step_seconds(self) -> float:
        """About what a step takes."""
        return STEP_SECONDS * (self.arrays.shares.size + self.size)

    def rounding(self, steps: float, jumps: float | None = None, rate_error: float | None = None) -> float:
        """Bound on the summed error by rounding of a vector after so many steps, and of the rates behind them.

        jumps : expected number of events on the way; at most the steps
        rate_error : of the rates, in roundings; None: what it is

        The last addition of a step rounds each probability once. All else in it is in proportion to what moves: a
        product and a sum of `terms` positive numbers, and rates that came with errors of their own. These change a
        solution by no more than what they add and take on its way, twice their share of what moves.
        """
        jumps = steps if jumps is None else jumps
        return summed_rounding(steps, jumps, self.terms, self.rate_error if rate_error is None else rate_error)


def summed_rounding(steps: float, jumps: float, terms: int, rate_error: float) -> float:
    """Bound on the summed error by rounding: `DiscreteChain.rounding` for a chain that is not stored.

    steps, jumps : of the uniformised chain, and expected events among them
    terms : most rates into plus most rates out of one state; rate_error : of each rate, in roundings
    """
    return 1.001 * ROUNDOFF * (steps + (terms + 2.0 * rate_error + 6.0) * jumps)


class Mixtures(NamedTuple):
    """p(t) (T, N) at several times; steps (N,) spent in each state on the way; bound on the summed absolute error."""

    probabilities: Floats
    stays: Floats
    error: float


def mixtures(chain: DiscreteChain, start: Floats, times: Sequence[float] | Floats, tolerance: float) -> Mixtures:
    """Probabilities at all `times` from one pass of steps.

    start : (N,), not negative, with a sum of at most 1
    tolerance : largest probability that may be left out at a time; the error holds it and every rounding
    Where the distribution has settled, the steps end early: no later step changes it by more than the last one did,
    because a stochastic matrix enlarges no difference. They end once that, in all steps to come, is less than these
    would round.
    """
    if not chain.arrays.exits.any():
        return Mixtures(np.tile(start, (len(times), 1)), np.zeros_like(start), 0.0)
    means = [chain.rate * float(time) for time in times]
    # p(t) = sum over k of Poisson(k; q t) p P^k; each time needs a window of k, and all share the steps.
    windows = [poisson_window(mean, tolerance / 2) for mean in means]
    ends = np.array([first + weights.size for first, weights in windows])
    firsts = np.array([first for first, _ in windows])
    n_steps = int(ends.max(initial=1))
    block = max(1, min(BLOCK, BLOCK_BYTES // (8 * start.size), n_steps))
    vectors, flows = np.empty((block + 1, start.size)), np.empty(block)
    mixed, stays, jumps = np.zeros((len(windows), start.size)), np.zeros(start.size), 0.0
    tails = poisson_tails(*windows[int(np.argmax(means))], tolerance)
    vectors[-1], drift = start, 0.0
    for begin in range(0, n_steps, block):
        end = min(begin + block, n_steps)
        vectors[0] = vectors[-1]
        twins.advance(*chain.arrays, vectors[: end - begin + 1], flows[: end - begin])
        # Expected events on the way, for the bound on rounding: flow of step k times the chance of more than k steps.
        jumps += float((flows[: end - begin] * tails[begin:end]).sum())
        stays += vectors[: end - begin].sum(axis=0)
        active = np.flatnonzero((firsts < end) & (ends > begin))
        if active.size:
            weights = _weights_between(begin, end, [windows[i] for i in active])
            twins.mix(active, weights, vectors[: end - begin], mixed)
        last, left = end - begin, n_steps - end
        # Steady-state detection: P enlarges no difference, so all later steps move p by at most `left` last changes.
        drift = 1.01 * left * float(np.abs(vectors[last] - vectors[last - 1]).sum())
        flow = float(flows[last - 1])
        if left and drift <= chain.rounding(left, left * flow, min(chain.rate_error, RATE_ERROR)):
            # The steps not taken get the last vector in their place.
            shares = np.array([weights[max(end - first, 0) :].sum() for first, weights in windows])
            mixed += shares[:, None] * vectors[last]
            stays += left * vectors[last]
            jumps += flow * float(tails[end:].sum())
            break
    errors = [
        window_error(mean, first, window, tolerance / 2) + ROUNDOFF * (block + window.size / block + 2)
        for mean, (first, window) in zip(means, windows, strict=True)
    ]
    return Mixtures(mixed, stays, max(errors, default=0.0) + chain.rounding(n_steps, jumps) + drift)


def _weights_between(begin: int, end: int, windows: Sequence[tuple[int, Floats]]) -> Floats:
    """Weights (windows, end - begin) of the steps from `begin` to before `end`."""
    table = np.zeros((len(windows), end - begin))
    for row, (first, weights) in zip(table, windows, strict=True):
        low, high = max(begin, first), min(end, first + weights.size)
        row[low - begin : high - begin] = weights[low - first : high - first]
    return table


class Absorption:
    """How much of the probability has reached the last state of a chain by each step; grows as far as it is asked.

    start : (N,) probabilities
    """

    def __init__(self, chain: DiscreteChain, start: Floats) -> None:
        self._chain = chain
        self._vector = start.copy()
        self._absorbed: Floats = np.empty(0)
        self._alive: Floats = np.empty(0)
        self._flows: Floats = np.empty(0)

    def at(self, time: float, tolerance: float) -> tuple[float, float, float]:
        """Probability that the last state has been reached by `time`, that it has not, and a bound on their errors."""
        mean = self._chain.rate * time
        first, weights = poisson_window(mean, tolerance)
        last = first + weights.size
        self._extend(last)
        window = slice(first, last)
        error = window_error(mean, first, weights, tolerance)
        error += self._chain.rounding(
            last, float((self._flows[:last] * poisson_tails(first, weights, tolerance)).sum())
        )
        error += ROUNDOFF * (weights.size + self._chain.size + 2)  # the two sums
        return float(weights @ self._absorbed[window]), float(weights @ self._alive[window]), error

    def _extend(self, n_steps: int) -> None:
        begin = self._absorbed.size
        if n_steps <= begin:
            return
        forecast((n_steps - begin) * self._chain.step_seconds, f"{rough(n_steps)} steps over {self._chain.size} states")
        # By half as much again each time, so that many small requests copy little.
        more = max(n_steps, begin + begin // 2) - begin
        absorbed, alive, flows = np.empty(more), np.empty(more), np.empty(more)
        twins.absorb(*self._chain.arrays, self._vector, absorbed, alive, flows)
        self._absorbed = np.concatenate([self._absorbed, absorbed])
        self._alive = np.concatenate([self._alive, alive])
        self._flows = np.concatenate([self._flows, flows])
