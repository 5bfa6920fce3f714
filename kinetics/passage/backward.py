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
SPARE = 1.0 + 2.0**-5  # q over the largest exit rate, so that something stays everywhere and its rounding is small
LOOK = 16  # steps between two looks at whether more of them matter


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


def steps_until(transitions: Transitions, time: float, spare: float = SPARE) -> float:
    """Steps that a pass backwards takes until a time, tu."""
    mean = jump_rate(transitions, spare) * time
    return poisson_bounds(mean, LEFT_OUT)[1] if mean < np.inf else np.inf


def expected_at(transitions: Transitions, start: Floats, values: Floats, time: float) -> LimitedValue:
    """Mean of `values` (N,), none negative, over the states at a time, tu.

    The steps are q t and a margin for the tails; ValueError where they are too many.
    """
    chain, begins, worth = that_matter(transitions, start, values)
    if time == 0.0 or not chain.rates.any():
        return LimitedValue.within(float(start @ values), ROUNDOFF * start.size, True)
    _check_steps(chain, time)
    mean = jump_rate(chain) * time
    first, weights = poisson_window(mean, LEFT_OUT)
    shares, doubts = np.zeros(first + weights.size), np.zeros(first + weights.size)
    shares[first:], doubts[first:] = weights, weights_errors(mean, first, weights.size)
    means, errors, rest = _passed_back(chain, begins, worth, time, shares)
    terms, doubts = shares[: means.size] * means, doubts[: means.size]
    wrong = float(terms @ (errors + doubts)) + rest
    wrong += ROUNDOFF * _sum_terms(terms) * float(terms.sum())
    return _within(float(terms.sum()), wrong, chain, LOST * float(worth.max()))


def expected_integral(transitions: Transitions, start: Floats, values: Floats, time: float) -> LimitedValue:
    """Mean of the integral of `values` (N,), none negative, over the states from 0 to a time, tu."""
    if time == 0.0:
        return LimitedValue(0.0, 0.0, 0.0, True)
    chain, begins, worth = that_matter(transitions, start, values)
    if not chain.rates.any():
        return LimitedValue.within(float(start @ values) * time, ROUNDOFF * (start.size + 1), True)
    _check_steps(chain, time)
    rate = jump_rate(chain)
    first, weights = poisson_window(rate * time, LEFT_OUT)
    # of the number of steps N: P(N > n), whose sum over n is its mean
    tails, wrongs = np.ones(first + weights.size), np.zeros(first + weights.size)
    tails[first:] = sums_after(weights)
    # before the window a tail is 1; in it, as wrong as its weights, and rounded with each that it adds
    wrongs[first:] = sums_after(weights * weights_errors(rate * time, first, weights.size))
    wrongs += ROUNDOFF * weights.size * tails
    means, errors, rest = _passed_back(chain, begins, worth, time, tails / rate)
    terms = tails[: means.size] * means / rate
    wrong = float(terms @ errors) + 1.01 * float(wrongs[: means.size] @ means) / rate + rest
    wrong += ROUNDOFF * (_sum_terms(terms) + 3.0) * float(terms.sum())
    return _within(float(terms.sum()), wrong, chain, LOST * float(worth.max()) * time)


def that_matter(transitions: Transitions, start: Floats, values: Floats) -> tuple[Transitions, Floats, Floats]:
    """Chain, start and values of the states that are reached and lead to a value; all others are one state without."""
    kept = transitions.reached_from(start > 0) & transitions.leading_to(values > 0)
    if kept.all():
        return transitions, start, values
    return transitions.within(kept), np.append(start[kept], 0.0), np.append(values[kept], 0.0)


def sums_after(values: Floats) -> Floats:
    """Of each value, the sum (n,) of those after it."""
    return np.append(np.cumsum(values[::-1])[::-1][1:], 0.0)


def _within(value: float, wrong: float, transitions: Transitions, lost: float) -> LimitedValue:
    return LimitedValue.within(value, 0.0, transitions.is_certified, 1.001 * wrong + lost)


def _sum_terms(terms: Floats) -> float:
    """Roundings of a sum in pairs, of products that round three times, after numpy's blocks of 128."""
    return float(np.log2(terms.size + 1.0)) + 128.0


def jump_rate(transitions: Transitions, spare: float = SPARE) -> float:
    """q, 1/tu: so many times the largest exit rate."""
    return spare * float(transitions.exits.max(initial=0.0))


def _check_steps(transitions: Transitions, time: float) -> None:
    steps = steps_until(transitions, time)
    if steps > MAX_STEPS:
        raise ValueError(
            f"the chain is too stiff for a pass backwards: {steps:.3g} steps until {time:g} tu, at most {MAX_STEPS}; "
            f"ask for an earlier time"
        )


def _passed_back(
    transitions: Transitions, start: Floats, values: Floats, time: float, shares: Floats
) -> tuple[Floats, Floats, float]:
    """start P^n values (n,) until the sum of shares (n_steps,) of them is known; bounds (n,) on their relative errors.

    And a bound on what the other steps, for which no value is larger than the largest before, add to the sum. Where no
    value changes by more than a step rounds, later ones change no more, because P is positive: they are taken as they
    are.
    """
    from kinetics.kernels import markov

    arrays, roundings = _arrays(transitions)
    settled = roundings * ROUNDOFF
    begins = np.flatnonzero(start)
    n_steps, chances, after = shares.size, start[begins], 1.01 * sums_after(shares)
    scale, rest, known = float(values.max()), 0.0, 0.0
    now, means, drifts = values / scale, np.empty(n_steps), np.zeros(n_steps)
    before = np.empty_like(now)
    for done in range(0, n_steps, LOOK):
        block = slice(done, min(done + LOOK, n_steps))
        markov.retreat(*arrays, begins, chances, now, before, means[block])
        known += float(shares[block] @ means[block])
        rest, last = float(after[block.stop - 1] * now.max()), block.stop
        if rest <= last * ROUNDOFF * known:  # less than the steps round
            n_steps = last
            break
        if (np.abs(now - before) <= settled * before).all():
            means[last:] = means[last - 1]
            drifts[last:] = np.arange(1, n_steps - last + 1) * (settled + (roundings + 4.0) * ROUNDOFF)
            rest = 0.0
            break
    # A rate that is wrong by e is so in each of the jumps, at most one a step; and in the waits between them, together
    # no longer than the time, as if by so many jumps as are expected.
    steps = np.arange(n_steps)
    jumps = steps + transitions.exits.max() * time
    relative = ROUNDOFF * (steps * roundings + jumps * (RATE_ERROR + 1) + begins.size + 4) + drifts[:n_steps]
    return means[:n_steps] * scale, np.expm1(relative), rest * scale


def _arrays(transitions: Transitions) -> tuple[tuple[Any, ...], float]:
    """P as `kernels.markov.retreat` reads it, and how many roundings of a result a step with it adds at most."""
    moves, stays, roundings = _moves(transitions, SPARE)
    return (moves.indptr.astype(np.uint32), moves.indices.astype(np.uint32), moves.data, stays), roundings


def one_step(transitions: Transitions, spare: float = SPARE) -> tuple[Any, float]:
    """P (N, N) by rows, and how many roundings of a result a step backwards with it adds at most."""
    from scipy.sparse import csr_array, dia_array

    moves, stays, roundings = _moves(transitions, spare)
    diagonal: Any = dia_array((stays[None, :], [0]), shape=moves.shape)
    return csr_array(moves + diagonal), roundings


def _moves(transitions: Transitions, spare: float) -> tuple[Any, Floats, float]:
    """P off its diagonal (N, N), the diagonal (N,), and roundings as above."""
    from scipy.sparse import csr_array

    n, rate = transitions.size, jump_rate(transitions, spare)
    moves: Any = csr_array((transitions.rates / rate, (transitions.rows, transitions.columns)), shape=(n, n))
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
    return ROUNDOFF * (3.0 * away + 2.0 * mean**0.5 + 60.0 + float(np.log2(size)))
