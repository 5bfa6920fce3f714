"""The probability that one target is reached, given that another one is: `P=? [ F<=5 a || F b ]`.

A chain is followed together with what it has met so far (Baier et al. 2014, doi:10.1007/978-3-642-54862-8_43, for no
time bounds): each state comes three times, with no target met, with the first only and with the second only; both are
one last state. The answer is the quotient of two probabilities with relative errors.
"""

from __future__ import annotations

import time
from dataclasses import replace
from fractions import Fraction

import numpy as np

from kinetics.markov.by_state import until_by_state
from kinetics.markov.chain import EQUATIONS, Chain, Target
from kinetics.markov.passage.until import Mask, until
from kinetics.markov.transient import Transitions
from kinetics.markov.transient.poisson import ROUNDOFF
from kinetics.markov.transient_means import mean_at, one_time
from kinetics.support.answer import Answer, weakest
from kinetics.support.arrays import Floats, Ints
from kinetics.support.tables import counted


def conditional(chain: Chain, target: Target, given: Target, by: float | None, given_by: float | None) -> Answer:
    """Probability of reaching the target by a time, tu, given that another is reached by its own; None for ever.

    Cost: three times that of `Chain.until` without a time; with two different times, some five times that.
    ValueError: what is given has probability 0, or the chain is truncated

    >>> from kinetics import Chain
    >>> from kinetics.markov.conditional import conditional
    >>> fork = Chain([[0, 1, 3], [0, 0, 0], [0, 2, 0]], 0)  # 0 leads to 1 at once, or by way of 2
    >>> round(conditional(fork, [False, False, True], [False, True, False], None, None).value, 9)
    0.75
    """
    chain.check_complete("a conditional probability")
    began, ends = time.process_time(), (by, given_by)
    goals = chain.states(target), chain.states(given)
    condition = chain.until(goals[1], by=given_by)
    if condition.high == 0.0:
        raise ValueError("what is given has probability 0, so nothing has a probability given it; ask for another")
    both = _both(chain, goals, ends)
    # The two errors are relative, so that a quotient of tiny probabilities has digits, too.
    low = both.low / condition.high * (1.0 - 2.0 * ROUNDOFF)
    high = both.high / condition.low * (1.0 + 2.0 * ROUNDOFF) if condition.low > 0.0 else 1.0
    value = both.value / condition.value if condition.value > 0.0 else low
    found = Answer(min(max(value, low), high), low, high, weakest(both, condition), both.method)
    return replace(found.clipped(), cpu_seconds=time.process_time() - began, why=counted(len(chain), "state"))


def _both(chain: Chain, goals: tuple[Mask, Mask], ends: tuple[float | None, float | None]) -> Answer:
    """The probability that both targets are reached, each by its own time."""
    together, start = _with_memory(chain, *goals)
    n, last = len(chain), start.size - 1
    if ends == (None, None):
        done = np.arange(start.size) == last
        found = until(together, start, np.ones_like(done), done).found
        return replace(found, method=EQUATIONS)
    first = 0 if ends[1] is None or (ends[0] is not None and ends[0] <= ends[1]) else 1  # whose time is up first
    end, other = one_time("by", ends[first]), ends[1 - first]  # type: ignore[arg-type]
    rest = None if other is None else one_time("by", other) - end
    values = np.zeros((3, start.size))
    values[:, last] = 1.0
    if rest != 0.0:
        # Then the first must have been met, and what is left is to meet the second one from there.
        later = until_by_state(chain, goals[1 - first], by=rest)
        is_exact = rest is None or Fraction(other) - Fraction(end) == Fraction(rest)  # type: ignore[arg-type]
        slip = 0.0 if is_exact else 4.0 * ROUNDOFF * (rest or 0.0) * float(chain.transitions.exits.max(initial=0.0))
        ends_of = later.value, np.maximum(later.low - slip, 0.0), np.minimum(later.high + slip, 1.0)
        values[:, (first + 1) * n : (first + 2) * n] = np.array(ends_of)
    if (values[1] == values[2]).all():
        return mean_at(together, start, values[0], end).clipped()
    value, low, high = (mean_at(together, start, each, end) for each in values)
    return replace(value, low=min(low.low, value.value), high=max(high.high, value.value)).clipped()


def _with_memory(chain: Chain, one: Mask, other: Mask) -> tuple[Transitions, Floats]:
    """The chain on 3 N + 1 states: none met, only the one, only the other; and the last for both. With its start."""
    n, (rows, columns, rates, _, rate_error, _) = len(chain), chain.transitions
    met = one.astype(np.int64) + 2 * other.astype(np.int64)

    def place(before: int, states: Ints) -> Ints:
        now = before | met[states]
        return np.where(now == 3, 3 * n, now * n + states)

    places = [(before * n + rows, place(before, columns)) for before in range(3)]
    starts, ends = (np.concatenate([pair[k] for pair in places]) for k in range(2))
    start = np.zeros(3 * n + 1)
    np.add.at(start, place(0, np.arange(n)), np.asarray(chain.initial))
    return Transitions(starts, ends, np.tile(rates, 3), np.zeros(3 * n + 1), rate_error), start
