"""Expected values at one time, by a pass backwards from what is asked, with a bound relative to the value.

With P the uniformised chain of rate q and f >= 0 a value of each state, the mean of f at t is the sum over n of
Poisson(n; q t) start P^n f. Every term is positive, so each step adds a few roundings relative to its result, however
small that is; a pass forwards knows the same sum only to the rounding of 1. Uniformisation: Jensen (1953),
doi:10.1080/03461238.1953.10419459; backwards: Katoen et al. (2001), doi:10.1007/3-540-44804-7_2.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from kinetics.solving.poisson import ROUNDOFF, poisson_bounds, poisson_window
from kinetics.solving.transitions import RATE_ERROR, Transitions
from kinetics.solving.uniformisation import MAX_STEPS
from kinetics.support.arrays import Floats

LEFT_OUT = 1e-302  # of the Poisson probability: what is smaller is not known relatively
LOST = 1e-300  # by this and by underflow together, of the largest value
SPARE = 1.25  # q over the largest exit rate, so that staying is a fifth at least and its rounding small beside it
LOOK = 64  # steps between two looks at whether the values have settled


class LimitedValue(NamedTuple):
    """A value of at least 0, its limits, and whether these are proven."""

    value: float
    low: float
    high: float
    is_bound: bool

    @classmethod
    def within(cls, value: float, relative: float, is_bound: bool, absolute: float = 0.0) -> LimitedValue:
        """The value with limits by a relative and an absolute error."""
        wide = relative * value * 1.001 + absolute
        return cls(value, max(value - wide, 0.0), value + wide, is_bound)

    def capped(self) -> LimitedValue:
        """The same of a probability: at most 1."""
        return self._replace(value=min(self.value, 1.0), low=min(self.low, 1.0), high=min(self.high, 1.0))

    def wider(self, relative: float) -> LimitedValue:
        """The same, where what was added up has a relative error of its own."""
        more = 1.001 * relative
        return self._replace(low=self.low * (1.0 - more), high=self.high * (1.0 + more))


def steps_until(transitions: Transitions, time: float) -> float:
    """Steps that a pass backwards takes until a time, tu."""
    mean = jump_rate(transitions) * time
    return poisson_bounds(mean, LEFT_OUT)[1] if mean < np.inf else np.inf


def expected_at(transitions: Transitions, start: Floats, values: Floats, time: float) -> LimitedValue:
    """Mean of `values` (N,), none negative, over the states at a time, tu.

    The steps are q t and a margin for the tails; ValueError where they are too many.
    """
    if time == 0.0 or not transitions.rates.any():
        return LimitedValue.within(float(start @ values), ROUNDOFF * start.size, True)
    means, errors = _passed_back(transitions, start, values, time)
    mean = jump_rate(transitions) * time
    first, weights = poisson_window(mean, LEFT_OUT)
    window = slice(first, first + weights.size)
    terms = weights * means[window]
    wrong = float(terms @ (errors[window] + weights_errors(mean, first, weights.size)))
    wrong += ROUNDOFF * _sum_terms(terms) * float(terms.sum())
    return _within(float(terms.sum()), wrong, transitions, LOST * float(values.max()))


def expected_integral(transitions: Transitions, start: Floats, values: Floats, time: float) -> LimitedValue:
    """Mean of the integral of `values` (N,), none negative, over the states from 0 to a time, tu."""
    if time == 0.0:
        return LimitedValue(0.0, 0.0, 0.0, True)
    if not transitions.rates.any():
        return LimitedValue.within(float(start @ values) * time, ROUNDOFF * (start.size + 1), True)
    means, errors = _passed_back(transitions, start, values, time)
    rate = jump_rate(transitions)
    first, weights = poisson_window(rate * time, LEFT_OUT)
    # of the number of steps N: P(N > n), whose sum over n is its mean
    tails, wrongs = np.ones(means.size), np.zeros(means.size)
    tails[first:] = sums_after(weights)
    # before the window a tail is 1; in it, as wrong as its weights, and rounded with each that it adds
    wrongs[first:] = sums_after(weights * weights_errors(rate * time, first, weights.size))
    wrongs += ROUNDOFF * weights.size * tails
    terms = tails * means / rate
    wrong = float(terms @ errors) + 1.01 * float(wrongs @ means) / rate
    wrong += ROUNDOFF * (_sum_terms(terms) + 3.0) * float(terms.sum())
    return _within(float(terms.sum()), wrong, transitions, LOST * float(values.max()) * time)


def sums_after(values: Floats) -> Floats:
    """Of each value, the sum (n,) of those after it."""
    return np.append(np.cumsum(values[::-1])[::-1][1:], 0.0)


def _within(value: float, wrong: float, transitions: Transitions, lost: float) -> LimitedValue:
    return LimitedValue.within(value, 0.0, transitions.is_certified, 1.001 * wrong + lost)


def _sum_terms(terms: Floats) -> float:
    """Roundings of a sum in pairs, of products that round three times, after numpy's blocks of 128."""
    return float(np.log2(terms.size + 1.0)) + 128.0


def jump_rate(transitions: Transitions) -> float:
    """q, 1/tu, above every exit rate."""
    return SPARE * float(transitions.exits.max(initial=0.0))


def _passed_back(transitions: Transitions, start: Floats, values: Floats, time: float) -> tuple[Floats, Floats]:
    """start P^n values (n_steps,) for all steps until a time, and bounds (n_steps,) on their relative errors.

    Where no value changes by more than a step rounds, later ones change no more, because P is positive: they are taken
    as they are.
    """
    steps = steps_until(transitions, time)
    if steps > MAX_STEPS:
        raise ValueError(
            f"the chain is too stiff for a pass backwards: {steps:.3g} steps until {time:g} tu, at most {MAX_STEPS}; "
            f"ask for an earlier time"
        )
    n_steps = int(steps) + 1
    matrix, roundings = one_step(transitions)
    begins = np.flatnonzero(start)
    chances, means = start[begins], np.empty(n_steps)
    scale = float(values.max()) or 1.0
    vector, drifts = values / scale, np.zeros(n_steps)
    for n in range(n_steps):
        means[n] = chances @ vector[begins]
        after = matrix @ vector
        if n % LOOK == 0:
            change = _largest_change(vector, after)
            if change <= roundings * ROUNDOFF:
                means[n + 1 :] = means[n]
                drifts[n + 1 :] = np.arange(1, n_steps - n) * (change + (roundings + 4.0) * ROUNDOFF)
                break
        vector = after
    # A rate that is wrong by e is so in each of the jumps, at most one a step; and in the waits between them, together
    # no longer than the time, as if by so many jumps as are expected.
    jumps = np.arange(n_steps) + transitions.exits.max() * time
    relative = ROUNDOFF * (np.arange(n_steps) * roundings + jumps * (RATE_ERROR + 1) + begins.size + 4) + drifts
    return means * scale, np.expm1(relative)


def one_step(transitions: Transitions) -> tuple[Any, float]:
    """P (N, N) by rows, and how many roundings of a result a step backwards with it adds at most."""
    from scipy.sparse import csr_array, dia_array

    n, rate = transitions.size, jump_rate(transitions)
    shares: Any = csr_array((transitions.rates / rate, (transitions.rows, transitions.columns)), shape=(n, n))
    wide = np.concatenate([shares.data.astype(np.longdouble), np.zeros(1, np.longdouble)])
    exits = np.where(np.diff(shares.indptr) > 0, np.add.reduceat(wide, shares.indptr[:-1]), 0.0)
    stays: Any = dia_array((np.asarray(1.0 - exits, dtype=np.float64)[None, :], [0]), shape=(n, n))
    merged = int(np.bincount(transitions.rows, minlength=1).max())
    finer = float(np.finfo(np.longdouble).eps / np.finfo(np.float64).eps)
    # staying, at least a fifth, from shares of at most four fifths; then a product and a sum a state, itself included
    return csr_array(shares + stays), 4.0 * merged * finer + 2.0 + 2.0 * (merged + 2.0)


def _largest_change(before: Floats, after: Floats) -> float:
    """The largest relative change of any value; inf where one is no longer 0."""
    held = before > 0.0
    if after[~held].any():
        return float("inf")
    if not held.any():
        return 0.0
    with np.errstate(over="ignore"):  # from the smallest numbers, which have lost their digits
        return float(np.abs(after[held] / before[held] - 1.0).max())


def weights_errors(mean: float, first: int, size: int) -> Floats:
    """Relative errors (size,) of the weights at most.

    Those of the ratios away from the mode, of their sum, and of the mean itself, which counts n - mean times.
    """
    away = np.abs(np.arange(first, first + size) - int(mean))
    return ROUNDOFF * (3.0 * away + 2.0 * mean**0.5 + 60.0 + float(np.log2(size)))
