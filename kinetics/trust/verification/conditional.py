"""Conditional means at a later time from every state now: the backward master equation, with its error."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from kinetics.markov.transient.poisson import ROUNDOFF, poisson_window, window_error
from kinetics.markov.transient.states import StateSpace
from kinetics.markov.transient.uniformisation import DiscreteChain
from kinetics.support.arrays import Floats

TOLERANCE = 1e-13
MOST_WORK = 2e9  # products of a backward pass, some seconds; more is left out
MATRIX_STATES = 600  # of which all transition probabilities are computed
SHORT = 16.0  # uniformised steps of the matrix that is squared
LARGEST_ERROR = 1e-6  # beyond, a matrix is of no use


class Expectations(NamedTuple):
    """Expectations (N, K) of K functions from each of N states, and their error for functions of at most 1.

    For a matrix, whose functions are the indicators of all states, the error is that of a row's sum.
    """

    values: Floats
    error: float


def chain_of(space: StateSpace) -> DiscreteChain:
    """The uniformised chain of a space; probability that leaves a projection is truncated."""
    return DiscreteChain.of(space.transitions(), most_out=len(space.network.channels))


def expected_after(chain: DiscreteChain, functions: Floats, gap: float) -> Expectations | None:
    """Expectations of functions (N, K), none negative and at most 1, after `gap` tu; None if it takes too long.

    Uniformisation of du/dt = Q u. The steps are those of the forward equation, whose bound on rounding holds: every
    step changes each term of a row by so many roundings, whichever side the vector stands on.
    """
    mean = chain.rate * gap
    first, weights = poisson_window(mean, TOLERANCE)
    steps = first + weights.size
    if steps * (chain.arrays.shares.size + chain.size) * functions.shape[1] > MOST_WORK:
        return None
    one_step = chain.transposed.T.tocsr()
    now, found = functions, np.zeros_like(functions)
    for step in range(steps):
        if step:
            now = one_step @ now
        if step >= first:
            found += weights[step - first] * now
    error = window_error(mean, first, weights, TOLERANCE) + chain.rounding(steps) + ROUNDOFF * (weights.size + 2)
    return Expectations(found, error)


def transition_matrix(chain: DiscreteChain, gap: float) -> Expectations | None:
    """Probabilities (N, N) from state to state after `gap` tu; None for many states, or where errors grow too large.

    Uniformisation of a short step, then squaring: products of substochastic matrices at most add up their errors, and
    a product of non-negative numbers rounds by at most N + 2 roundings.
    """
    n = chain.size
    if n > MATRIX_STATES:
        return None
    squarings = max(0, int(np.ceil(np.log2(max(chain.rate * gap, 1.0) / SHORT))))
    made = expected_after(chain, np.eye(n), gap / 2.0**squarings)
    if made is None:
        return None
    matrix, error = made
    for _ in range(squarings):
        matrix = matrix @ matrix
        error = 2.0 * error + error**2 + 1.01 * (n + 2) * ROUNDOFF * (1.0 + error) ** 2
    return Expectations(matrix, error) if error < LARGEST_ERROR else None
