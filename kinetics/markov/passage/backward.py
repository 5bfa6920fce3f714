"""Expected values at one time, by a pass backwards from what is asked, with a bound relative to the value.

With P the uniformised chain of rate q and f >= 0 a value of each state, the mean of f at t is the sum over n of
Poisson(n; q t) start P^n f. Every term is positive, so each step adds a few roundings relative to its result, however
small that is; a pass forwards knows the same sum only to the rounding of 1. Uniformisation: Jensen (1953),
doi:10.1080/03461238.1953.10419459; backwards: Katoen et al. (2001), doi:10.1007/3-540-44804-7_2.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import cached_property
from typing import Any

import numpy as np

from kinetics.markov.transient.poisson import ROUNDOFF, poisson_bounds, poisson_window
from kinetics.markov.transient.transitions import Transitions
from kinetics.markov.transient.uniformisation import MAX_STEPS, STEP_SECONDS
from kinetics.native import twins
from kinetics.native.rate_tables import RateTable
from kinetics.support.answer import PROVEN, Answer
from kinetics.support.arrays import Floats
from kinetics.support.cli.progress import forecast
from kinetics.support.tables import rough

LEFT_OUT = 1e-302  # of the Poisson probability: what is smaller is not known relatively
LOST = 1e-300  # by this and by underflow together, of the largest value
BACKWARD_LOST = 2.0 * LOST  # of one pass from every state
SPARE = 1.0 + 2.0**-5  # q over the largest exit rate, so that something stays everywhere and its rounding is small
LOOK = 16  # steps between two looks at whether more of them matter, at first


def steps_until(transitions: Transitions, time: float, spare: float = SPARE) -> float:
    """Steps that a pass backwards takes until a time, tu."""
    mean = jump_rate(transitions, spare) * time
    return poisson_bounds(mean, LEFT_OUT)[1] if mean < np.inf else np.inf


def expected_at(transitions: Transitions, start: Floats, values: Floats, time: float) -> Answer:
    """Mean of `values` (N,), none negative, over the states at a time, tu.

    The steps are q t and a margin for the tails; ValueError if they are too many.
    """
    return BackwardPass(transitions, start, values).at(time)


def expected_integral(transitions: Transitions, start: Floats, values: Floats, time: float) -> Answer:
    """Mean of the integral of `values` (N,), none negative, over the states from 0 to a time, tu."""
    return BackwardPass(transitions, start, values).integral(time)


def uniformised(
    transitions: Transitions,
    vector: Floats,
    times: Sequence[float],
    *,
    is_backwards: bool,
    left_out: float = LEFT_OUT,
    integrates: bool = False,
) -> tuple[Floats, float]:
    """Vectors (T, N) at rising times, tu, from one (N,) between 0 and 1, and their relative error.

    is_backwards : the mean of a function at that time from every state; else the probability of every state
    left_out : of the Poisson probability of more steps, which is beyond that error, as are numbers below 1e-300
    integrates : the integral of these from 0 to each time, of which 1e-300 times the time may be left out

    ValueError: too many steps
    """
    last = times[-1]
    steps = steps_until(transitions, last)
    if steps > MAX_STEPS:
        raise ValueError(
            f"the chain is too stiff: {steps:.3g} steps from one time to one {last:g} tu away, at most {MAX_STEPS}"
        )
    if last == 0.0 or not transitions.rates.any():
        found = np.tile(vector, (len(times), 1))
        return (found * np.asarray(times)[:, None], ROUNDOFF) if integrates else (found, 0.0)
    forecast(steps * STEP_SECONDS * (vector.size + transitions.rates.size), f"{rough(steps)} steps")
    moves, stays, roundings = one_step(transitions)
    windows = [poisson_window(jump_rate(transitions) * time, left_out) for time in times]
    first, weights = windows[-1]
    n_steps = first + weights.size
    shares = np.zeros((len(times), n_steps))
    for row, (begin, window) in zip(shares, windows, strict=True):
        row[begin : begin + window.size] = sums_after(window) if integrates else window
        row[:begin] = 1.0 if integrates else 0.0
    if integrates:  # of the number of steps N: P(N > n) / q, as in `BackwardPass.integral`
        shares /= jump_rate(transitions)
    found = twins.summed_steps(moves if is_backwards else moves.transposed(), stays, shares, vector)
    if not is_backwards:
        # forwards, a state adds up what all others bring: as many products as lead to it
        roundings += 2.0 * (int(np.bincount(transitions.columns, minlength=1).max()) + 2.0)
    # as in `BackwardPass`: each step rounds, rates are wrong in jumps and waits, and weights are added up
    jumps = n_steps + float(transitions.exits.max()) * last
    added = 2.0 * weights.size + (n_steps + 4.0 if integrates else 0.0)
    relative = n_steps * roundings + jumps * (transitions.roundings + 1.0) + added + 4.0
    wrong = np.expm1(ROUNDOFF * relative)
    means = [jump_rate(transitions) * time for time in times]
    wrong += max(
        float(weights_errors(mean, begin, window.size).max())
        for mean, (begin, window) in zip(means, windows, strict=True)
    )
    return found, 1.01 * float(wrong)


class BackwardPass:
    """Means of `values` (N,), none negative, from a start (N,) at any times; the pass goes on where a time needs more.

    Only states that are reached and lead to a value are stepped through. If no value changes by more than a step
    rounds, later ones change no more, because P is positive: they are taken as they are.
    """

    def __init__(self, transitions: Transitions, start: Floats, values: Floats) -> None:
        at_once = float(start @ values)
        self._at_once = Answer.within(at_once, ROUNDOFF * start.size, transitions.is_certified)
        self._chain, begins, last = that_matter(transitions, start, values)
        self._rate, self._scale = jump_rate(self._chain), float(last.max(initial=0.0)) or 1.0
        self._now, self._before = last / self._scale, np.empty(last.size)
        self._begins = np.flatnonzero(begins)
        self._chances = begins[self._begins]
        self._blocks: list[Floats] = []  # of means before each step
        self._ends: list[int] = []  # of blocks
        self._tops: list[float] = []  # the largest value after each block
        self._is_settled = False

    def at(self, time: float) -> Answer:
        """The mean of the values at a time, tu."""
        if time == 0.0 or not self._chain.rates.any():
            return self._at_once if time > 0.0 else replace(self._at_once, kind=PROVEN)
        first, weights = self._window(time)
        shares, doubts = np.zeros(first + weights.size), np.zeros(first + weights.size)
        shares[first:], doubts[first:] = weights, weights_errors(self._rate * time, first, weights.size)
        means, errors, rest = self._known(shares, time)
        terms = shares[: means.size] * means
        wrong = float(terms @ (errors + doubts[: means.size])) + rest
        wrong += ROUNDOFF * _sum_terms(terms) * float(terms.sum())
        return self._within(float(terms.sum()), wrong, 1.0)

    def integral(self, time: float) -> Answer:
        """The mean of the values integrated from 0 to a time, tu."""
        if time == 0.0:
            return Answer(0.0, 0.0, 0.0)
        if not self._chain.rates.any():
            once = self._at_once
            whole = replace(once, value=once.value * time, low=once.low * time, high=once.high * time)
            return whole.inflated(2.0 * ROUNDOFF)
        first, weights = self._window(time)
        # of the number of steps N: P(N > n), whose sum over n is its mean
        tails, wrongs = np.ones(first + weights.size), np.zeros(first + weights.size)
        tails[first:] = sums_after(weights)
        # before the window a tail is 1; in it, as wrong as its weights, and rounded with each that it adds
        wrongs[first:] = sums_after(weights * weights_errors(self._rate * time, first, weights.size))
        wrongs += ROUNDOFF * weights.size * tails
        means, errors, rest = self._known(tails / self._rate, time)
        terms = tails[: means.size] * means / self._rate
        wrong = float(terms @ errors) + 1.01 * float(wrongs[: means.size] @ means) / self._rate + rest
        wrong += ROUNDOFF * (_sum_terms(terms) + 3.0) * float(terms.sum())
        return self._within(float(terms.sum()), wrong, time)

    def second_moment(self, time: float, left: bool = False) -> float:
        """Mean of the integral of 2 t times the values, or of 2 (time - t), for t from 0 to a time, tu; no bounds."""
        if not self._chain.rates.any():
            return self._at_once.value * time**2
        first, weights = self._window(time)
        tails = np.ones(first + weights.size)
        tails[first:] = sums_after(weights)
        # 2 t Poisson(n; q t) has the integral 2 (n + 1) P(N > n + 1) / q**2, the other that of all later tails
        shares = sums_after(tails) if left else np.arange(1, tails.size + 1) * np.append(tails[1:], 0.0)
        shares *= 2.0 / self._rate**2
        means, *_ = self._known(shares, time)
        return float(shares[: means.size] @ means)

    def _window(self, time: float) -> tuple[int, Floats]:
        steps = steps_until(self._chain, time)
        if steps > MAX_STEPS:
            raise ValueError(
                f"the chain is too stiff for a pass backwards: {steps:.3g} steps until {time:g} tu, at most "
                f"{MAX_STEPS}; ask for an earlier time"
            )
        left = 0.0 if self._is_settled else steps - (self._ends[-1] if self._ends else 0)
        n, listed = self._now.size, self._chain.rates.size
        forecast(max(left, 0.0) * STEP_SECONDS * (n + listed), f"up to {rough(left)} steps back over {n} states")
        return poisson_window(self._rate * time, LEFT_OUT)

    def _within(self, value: float, wrong: float, unit: float) -> Answer:
        lost = LOST * self._scale * unit
        return Answer.within(value, 0.0, self._chain.is_certified, 1.001 * wrong + lost)

    def _known(self, shares: Floats, time: float) -> tuple[Floats, Floats, float]:
        """Means (n,) before so many steps that the sum of shares (n_steps,) of them is known; their relative errors.

        And a bound on what the other steps add to the sum: no value is ever larger than the largest before.
        """
        n_steps, after = shares.size, 1.01 * sums_after(shares)
        known, rest, end, k = 0.0, 0.0, 0, 0
        while end < n_steps and not (self._is_settled and k == len(self._blocks)):
            if k == len(self._blocks):
                self._step_back()
            begin, end = end, min(self._ends[k], n_steps)
            known += float(shares[begin:end] @ self._blocks[k][: end - begin])
            rest = float(after[end - 1] * self._tops[k])
            k += 1
            if rest <= end * ROUNDOFF * known:  # less than the steps round
                n_steps = end
        means = np.concatenate(self._blocks[:k])[:n_steps]
        steps, roundings = np.arange(n_steps), self._moves[1]
        drifts = np.maximum(steps - (end - 1.0), 0.0) * (2.0 * roundings + 4.0)
        if end < n_steps:
            means, rest = np.append(means, np.full(n_steps - end, means[-1])), 0.0
        # A rate that is wrong by e is so in each of the jumps, at most one a step; and in the waits between them,
        # together no longer than the time, as if by so many jumps as are expected.
        jumps = steps + self._chain.exits.max() * time
        relative = steps * roundings + jumps * (self._chain.roundings + 1.0) + self._begins.size + 4 + drifts
        return means * self._scale, np.expm1(ROUNDOFF * relative), rest * self._scale

    def _step_back(self) -> None:
        """One more block of steps, longer the more there are."""
        done = self._ends[-1] if self._ends else 0
        moves, roundings = self._moves
        means = np.empty(LOOK + done // 64)
        twins.retreat(moves, self._begins, self._chances, self._now, self._before, means)
        self._blocks.append(means)
        self._ends.append(done + means.size)
        self._tops.append(float(self._now.max()))
        self._is_settled = bool((np.abs(self._now - self._before) <= roundings * ROUNDOFF * self._before).all())

    @cached_property
    def _moves(self) -> tuple[Any, float]:
        """P as `twins.retreat` reads it, and how many roundings of a result a step with it adds at most."""
        moves, stays, roundings = one_step(self._chain)
        places = moves.indptr.astype(np.uint32), moves.indices.astype(np.uint32)
        return twins.backward_moves(*places, moves.data, stays), roundings


def that_matter(transitions: Transitions, start: Floats, values: Floats) -> tuple[Transitions, Floats, Floats]:
    """Chain, start and values of the states that are reached and lead to a value; all others are one state without."""
    kept = transitions.reached_from(start > 0) & transitions.leading_to(values > 0)
    if kept.all():
        return transitions, start, values
    return transitions.within(kept), np.append(start[kept], 0.0), np.append(values[kept], 0.0)


def sums_after(values: Floats) -> Floats:
    """For each value (n,), the sum of all values after it."""
    return np.append(np.cumsum(values[::-1])[::-1][1:], 0.0)


def _sum_terms(terms: Floats) -> float:
    """Roundings of a sum in pairs, of products that round three times, after numpy's blocks of 128."""
    return float(np.log2(terms.size + 1.0)) + 128.0


def jump_rate(transitions: Transitions, spare: float = SPARE) -> float:
    """q, 1/tu: so many times the largest exit rate."""
    return spare * float(transitions.exits.max(initial=0.0))


def one_step(transitions: Transitions, spare: float = SPARE) -> tuple[RateTable, Floats, float]:
    """P off its diagonal (N, N) by rows, its diagonal (N,), and how many roundings a step backwards adds at most."""
    n, rate = transitions.size, jump_rate(transitions, spare)
    moves = RateTable.of(transitions.rows, transitions.columns, transitions.rates / rate, n)
    wide = np.concatenate([moves.data.astype(np.longdouble), np.zeros(1, np.longdouble)])
    exits = np.where(np.diff(moves.indptr) > 0, np.add.reduceat(wide, moves.indptr[:-1]), 0.0)
    merged = int(np.bincount(transitions.rows, minlength=1).max())
    finer = float(np.finfo(np.longdouble).eps / np.finfo(np.float64).eps)
    # staying is what shares leave, which are at most 1 / spare; then a product and a sum a state, itself included
    roundings = spare * merged * finer / (spare - 1.0) + 2.0 + 2.0 * (merged + 2.0)
    return moves, np.asarray(1.0 - exits, dtype=np.float64), roundings


def weights_errors(mean: float, first: int, size: int) -> Floats:
    """Relative errors (size,) of the weights at most.

    Those of the ratios away from the mode, of their sum, and of the mean itself, which counts n - mean times.
    """
    away = np.abs(np.arange(first, first + size) - int(mean))
    return ROUNDOFF * (3.0 * away + 2.0 * float(mean**0.5) + 60.0 + float(np.log2(size)))
