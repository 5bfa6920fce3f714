"""Derivatives of an expected value at a time, or of its integral, by all rates: one pass forwards and one backwards.

With P = 1 + Q / q the uniformised chain, the value is the sum over n of w_n start P^n f: w_n is the Poisson
probability of n steps, or for the integral that of more than n, over q. A channel adds Q_r to Q, in proportion to its
rate, so its derivative by ln k_r is the sum over n of v_n (Q_r / q) l_(n+1), with v_n = start P^n forwards and
l_n = P l_(n+1) + w_n f backwards: the adjoint of all rates at once (reverse mode).

Only states that are reached and lead to a value are stepped through, and steps end when all later ones together add
less than these round: about three times the cost of the value. If the value has settled long before the time, so
that its pass stops, these go on: of differences that no longer change, a limit would say too little.

Every rounding in v and l is as if an entry of P were wrong by a small share, k, at one step. So the computed
derivative is a mean over the paths of n steps, in which the score of a path, M = sum of dln P / dln k_r over its steps,
comes with each step's wrong factors. A rate that is wrong counts in each jump, and in the waits as in so many jumps as
are expected. Two bounds follow, and for each channel the smaller is taken.

- Terms of one sign, as in the value itself: n k times the sum of all that is added and subtracted.
- The score is a martingale: the mean of its square is that of the sum of its steps' squares, about the number of the
  channel's firings (Plyasunov & Arkin 2007, doi:10.1016/j.jcp.2006.06.047). By Cauchy and Schwarz the mean of f |M| is
  at most sqrt(mean f**2 * mean M**2). A step's wrong factor meets the scores before it, and those after it: in all
  2 n k of these means.
"""

from __future__ import annotations

from math import exp, expm1
from typing import NamedTuple

import numpy as np

from kinetics.markov.derivatives.forwards import Forwards, places
from kinetics.markov.derivatives.gradient import ChannelEntries, Gradient
from kinetics.markov.passage.backward import (
    LEFT_OUT,
    LOST,
    expected_at,
    jump_rate,
    one_step,
    steps_until,
    sums_after,
    weights_errors,
)
from kinetics.markov.passage.until import rate_reward
from kinetics.markov.transient.poisson import ROUNDOFF, poisson_window
from kinetics.markov.transient.transitions import Transitions
from kinetics.markov.transient.uniformisation import MAX_STEPS
from kinetics.native import twins
from kinetics.support.answer import Answer
from kinetics.support.arrays import Floats, Ints


class Weights(NamedTuple):
    """The steps until a time, tu: their weights (n,), the unit of their sum, and the relative error of a weight."""

    time: float
    values: Floats
    unit: float
    error: float


def gradient_at(entries: ChannelEntries, start: Floats, functions: Floats, time: float) -> list[Gradient]:
    """Gradient of the means of F functions (F, N), none negative, at a time, tu; one pass backwards each.

    ValueError: too many steps, or too little memory

    >>> import numpy as np
    >>> from kinetics import Network, reachable
    >>> from kinetics.markov.derivatives import ChannelEntries, gradient_at
    >>> entries = ChannelEntries(reachable(Network.from_text("A -> B, 2"), {"A": 1}).transitions(), n_channels=1)
    >>> (found,) = gradient_at(entries, np.array([1.0, 0.0]), np.array([[1.0, 0.0]]), time=0.5)
    >>> round(found.answer.value, 6), found.value.round(6).tolist()  # exp(-k t), and -k t exp(-k t)
    (0.367879, [-0.367879])
    """
    kept = Kept.of(entries, start, functions)
    if time == 0.0 or not kept.entries.transitions.rates.any():
        chain = entries.transitions
        return [Gradient.none(expected_at(chain, start, values, time), entries.n_channels) for values in functions]
    (first, window), error = _window(kept.entries.transitions, time)
    passes = Passes(kept, Weights(time, np.append(np.zeros(first), window), 1.0, error))
    return [passes.gradient(f) for f in range(len(functions))]


class Adjoint(NamedTuple):
    """A mean, how it depends on the state in which the chain begins (N,), and its derivatives (K,) by the logarithm of
    the rate of each transition.

    >>> import numpy as np
    >>> from kinetics.markov.derivatives import Adjoint
    >>> Adjoint(0.5, np.array([0.5, 1.0]), np.array([-0.2])).mean
    0.5
    """

    mean: float
    later: Floats
    derivatives: Floats


def adjoint_at(chain: Transitions, start: Floats, values: Floats, time: float) -> Adjoint:
    """The mean of `values` (N,), none negative, at a time, tu, with all its derivatives, from a start (N,).

    `later` is 0 for states that are not reached from the start. No bounds; ValueError: too many steps, or too little
    memory

    >>> import numpy as np
    >>> from kinetics import Network, reachable
    >>> from kinetics.markov.derivatives import adjoint_at
    >>> chain = reachable(Network.from_text("A -> B, 2"), {"A": 1}).transitions()
    >>> found = adjoint_at(chain, np.array([1.0, 0.0]), np.array([1.0, 0.0]), time=0.5)  # of A: 1/e, and -1/e
    >>> round(found.mean, 6), found.derivatives.round(6).tolist()
    (0.367879, [-0.367879])
    """
    entries = ChannelEntries(chain._replace(channels=np.arange(chain.rates.size)), chain.rates.size)
    kept = Kept.of(entries, start, values[None, :])
    if time == 0.0 or not kept.entries.transitions.rates.any():
        return Adjoint(float(start @ values), values, np.zeros(chain.rates.size))
    (first, window), error = _window(kept.entries.transitions, time)
    weights = Weights(time, np.append(np.zeros(first), window), 1.0, error)
    found, by_entry = Passes(kept, weights).adjoint(0)
    later = np.zeros(start.size)
    later[kept.places] = found[: kept.places.size]
    return Adjoint(float(start @ later), later, by_entry)


def gradient_up_to(
    entries: ChannelEntries, start: Floats, rewards: Floats, time: float, impulses: Floats | None = None
) -> Gradient:
    """Gradient of the mean of a reward accumulated up to a time, tu.

    rewards : (N,) rates in each state; impulses : (K,) at each jump, none negative

    >>> import numpy as np
    >>> from kinetics import Network, reachable
    >>> from kinetics.markov.derivatives import ChannelEntries, gradient_up_to
    >>> entries = ChannelEntries(reachable(Network.from_text("A -> B, 2"), {"A": 1}).transitions(), n_channels=1)
    >>> found = gradient_up_to(entries, np.array([1.0, 0.0]), np.array([1.0, 0.0]), time=0.5)  # of the time spent in A
    >>> round(found.answer.value, 6), found.value.round(6).tolist()  # (1 - 1/e) / 2, and 1/e - 1/2
    (0.31606, [-0.132121])
    """
    total, rounded = rate_reward(entries.transitions, rewards, impulses)
    kept = Kept.of(entries, start, total[None, :], impulses)
    chain = kept.entries.transitions
    if time == 0.0 or not chain.rates.any():
        value, is_bound = float(start @ total) * time, time == 0.0 or entries.transitions.is_certified
        return Gradient.none(Answer.within(value, ROUNDOFF * (start.size + 2), is_bound), entries.n_channels)
    (first, window), error = _window(chain, time)
    tails = np.append(np.ones(first), sums_after(window)) / jump_rate(chain)
    error += ROUNDOFF * (window.size + 2) + rounded
    return Passes(kept, Weights(time, tails, time, error)).gradient(0)


def _window(chain: Transitions, time: float) -> tuple[tuple[int, Floats], float]:
    """The Poisson weights and where they begin, and the largest relative error of one."""
    steps = steps_until(chain, time)
    if steps > MAX_STEPS:
        raise ValueError(
            f"the chain is too stiff for derivatives by uniformisation: {steps:.3g} steps until {time:g} tu, at most "
            f"{MAX_STEPS}; ask for an earlier time"
        )
    mean = jump_rate(chain) * time
    first, window = poisson_window(mean, LEFT_OUT)
    return (first, window), float(weights_errors(mean, first, window.size).max())


class Kept(NamedTuple):
    """A question reduced to the states that matter: reachable and coreachable to a value; the others become one state.

    start : (N,); functions : (F, N), each at most 1, in units of `scales` (F,)
    impulses : (K,) what each jump adds to the values of the state that it leaves, in proportion to its rate
    places : of the states that matter, among all
    """

    entries: ChannelEntries
    start: Floats
    functions: Floats
    scales: Floats
    impulses: Floats | None
    places: Ints

    @classmethod
    def of(cls, entries: ChannelEntries, start: Floats, functions: Floats, impulses: Floats | None = None) -> Kept:
        """The reduced question for functions (F, N) of all states."""
        chain = entries.transitions
        scales = np.where(functions.any(axis=1), functions.max(axis=1), 1.0)
        shares = functions / scales[:, None]
        kept = chain.reached_from(start > 0) & chain.leading_to(shares.max(axis=0) > 0)
        places = np.flatnonzero(kept)
        if kept.all():
            return cls(entries, start, shares, scales, impulses, places)
        inside = entries._replace(transitions=chain.within(kept))
        start, shares = np.append(start[kept], 0.0), np.append(shares[:, kept], np.zeros((len(shares), 1)), axis=1)
        return cls(inside, start, shares, scales, None if impulses is None else impulses[kept[chain.rows]], places)


class Back(NamedTuple):
    """The result of an adjoint (backward) pass.

    later : (N,) l_0
    gained : of every entry of P off its diagonal the sum of v (l there - l here)
    held : (N,) the sum of v l of every state
    occupation : (N,) the weights of the steps after each visit of a state
    spent : (N,) those at the visits, where they are asked for
    """

    later: Floats
    gained: Floats
    held: Floats
    occupation: Floats
    spent: Floats


class Passes:
    """The pass forwards, and those backwards on top of it."""

    def __init__(self, kept: Kept, weights: Weights) -> None:
        chain = kept.entries.transitions
        self._kept, self._weights = kept, weights
        moves, self._stays, roundings = one_step(chain)
        self._moves, self._rate = twins.backward_moves(*places(moves), self._stays), jump_rate(chain)
        self._n_moves = moves.nnz
        n, inflows = chain.size, int(np.bincount(chain.columns, minlength=1).max())
        self._forwards = Forwards(moves, self._stays, kept.start, weights.values, kept.functions)
        steps = self._forwards.n_steps
        each = roundings + 2.0 * (inflows + 2.0)
        rates = (chain.roundings + 1.0) * (steps + float(chain.exits.max()) * weights.time)
        self._wrong = 1.01 * ROUNDOFF * (steps * each + rates)
        self._lost = (LOST * weights.values.size + self._forwards.rest) * weights.unit
        # where each entry is in P
        keys = np.repeat(np.arange(n), np.diff(moves.indptr)) * n + moves.indices
        self._places = np.searchsorted(keys, chain.rows * n + chain.columns)

    def gradient(self, f: int) -> Gradient:
        """The gradient of the mean of one of the functions."""
        entries, start, functions, scales, impulses, _ = self._kept
        chain, scale, lost = entries.transitions, float(scales[f]), self._lost
        found = self._back(functions[f])
        mean, share = float(start @ found.later), chain.rates / self._rate
        terms = share * found.gained[self._places]
        value = entries.by_channel(terms)
        # all that is added and subtracted on the way to these terms
        size = 2.0 * entries.by_channel(share * found.held[chain.rows]) + value
        stays = self._stays[chain.rows]
        firings = entries.by_channel(share * (1.0 + share / stays) * found.occupation[chain.rows])
        wrong, error = self._wrong, self._weights.error + 4.0 * ROUNDOFF
        relative = expm1(wrong) + error
        scores = wrong * exp(wrong) * (2.0 + wrong * exp(wrong)) + error
        wide = np.minimum(relative * size, scores * np.sqrt(mean * firings))
        rounded = 2.0 * self._forwards.length + chain.roundings + 16.0
        added = rounded * size + entries.most * entries.by_channel(np.abs(terms))
        wide = 1.02 * wide + 1.01 * ROUNDOFF * added + lost
        if impulses is not None:
            direct = entries.by_channel(chain.rates * impulses * found.spent[chain.rows] / scale)
            relative += ROUNDOFF * (entries.most + rounded)
            value, wide = value + direct, wide + 1.01 * relative * direct
        answer = Answer.within(mean * scale, relative + ROUNDOFF * (start.size + 2), chain.is_certified, lost * scale)
        return Gradient(answer, value * scale, wide * scale, chain.is_certified)

    def adjoint(self, f: int) -> tuple[Floats, Floats]:
        """Means (N,) of one of the functions from each state, and derivatives (C,) of that from the start by ln rate of
        each channel."""
        entries, scale = self._kept.entries, float(self._kept.scales[f])
        found = self._back(self._kept.functions[f])
        share = entries.transitions.rates / self._rate
        return found.later * scale, entries.by_channel(share * found.gained[self._places]) * scale

    def _back(self, values: Floats) -> Back:
        """A pass backwards of a function (N,).

        Added up within blocks first, so that the roundings are those of 2 sqrt(n) additions.
        """
        n, weights, steps = values.size, self._weights.values, self._forwards.n_steps
        after, later, spent = sums_after(weights[:steps]), np.zeros(n), np.zeros(n)
        sums = [np.zeros(self._n_moves), np.zeros(n), np.zeros(n)]
        for begin, vectors in self._forwards.backwards():
            block = slice(begin, begin + len(vectors))
            parts = [np.zeros_like(each) for each in sums]
            twins.steps_back(self._moves, vectors, weights[block], after[block], values, later, *parts)
            for s, found in enumerate(parts):
                sums[s] += found
            if self._kept.impulses is not None:
                spent += weights[block] @ vectors
        gained, held, occupation = sums
        return Back(later, gained, held, occupation, spent)
