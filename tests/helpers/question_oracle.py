"""Answers from every state of a small chain by dense matrices in forty digits: slow, and nothing of ours in them.

rates : (n, n) off the diagonal; masks : lists of truths (n,); results : lists of n mpmath numbers
"""

import mpmath
import numpy as np
from random_chains import exact_generator

DIGITS = 40
BITS = 256  # of fixed-point numbers
ONE = 1 << BITS
CLOSE = 1e-33  # what rounding in so many digits may leave of a difference of probabilities


def column(values):
    return mpmath.matrix([mpmath.mpf(float(value)) if isinstance(value, float | int | bool) else value
                          for value in values])  # fmt: skip


def exponential(table, time):
    """exp(table t) by Taylor's series and squaring, as whole numbers of 2**-BITS, which is quick in Python."""
    power = np.array([[fixed(each * time) for each in row] for row in table.tolist()], dtype=object)
    halvings = max(0, int(np.abs(power).sum(axis=1).max()).bit_length() - BITS + 2)
    power = power >> halvings
    term = np.array([[ONE * (i == j) for i in range(len(power))] for j in range(len(power))], dtype=object)
    whole = term
    for m in range(1, 60):
        term = (term.dot(power) >> BITS) // m
        whole = whole + term
    for _ in range(halvings):
        whole = whole.dot(whole) >> BITS
    return whole


def fixed(number):
    return int(mpmath.nint(mpmath.ldexp(number, BITS)))


def moved(rates, values, time, stopped=()):
    """exp(Q t) f, from every state; time as an exact number."""
    table = exponential(exact_generator(rates, stopped), time)
    found = table.dot(np.array([fixed(each) for each in column(values)], dtype=object))
    return [mpmath.ldexp(mpmath.mpf(each), -2 * BITS) for each in found.tolist()]


def places(mask):
    return [i for i, here in enumerate(mask) if here]


def closure(rates):
    """Which state leads to which, itself included."""
    n = len(rates)
    found = (np.asarray(rates) > 0) | np.eye(n, dtype=bool)
    for _ in range(n):
        found = (found.astype(int) @ found.astype(int)) > 0
    return found


def ended(rates, ends, known, weights=None):
    """Mean of `known` where the chain ends, and of weights a time unit until then; None of states that may not end."""
    n = len(rates)
    kept = [i for i in range(n) if not ends[i]]
    stopped = np.where(np.asarray(ends)[:, None], 0.0, rates)
    leads = closure(stopped)
    sure = [all(leads[j][places(ends)].any() for j in places(leads[i])) if any(ends) else False for i in range(n)]
    found = [column(known)[i] if ends[i] else None for i in range(n)]
    kept = [i for i in kept if sure[i]]
    if not kept:
        return found
    q = exact_generator(rates)
    table, right = mpmath.zeros(len(kept)), mpmath.zeros(len(kept), 1)
    for row, i in enumerate(kept):
        for other, j in enumerate(kept):
            table[row, other] = -q[i, j]
        right[row] = mpmath.mpf(0) if weights is None else column(weights)[i]
        right[row] += sum(q[i, j] * found[j] for j in range(n) if ends[j])
    for i, value in zip(kept, mpmath.lu_solve(table, right), strict=True):
        found[i] = value
    return found


def until(rates, goal, ways, after=0, by=None):
    """The probability of an until from `after` on, until `by` or for ever."""
    n = len(rates)
    settled = [goal[i] or not ways[i] for i in range(n)]
    if by is None:
        stopped = np.where(np.array(settled)[:, None], 0.0, rates)
        leads = closure(stopped)
        dead = [not leads[i][places(goal)].any() if any(goal) else True for i in range(n)]
        ends = [settled[i] or dead[i] for i in range(n)]
        later = ended(rates, ends, [float(goal[i]) for i in range(n)])
    else:
        later = moved(rates, [float(each) for each in goal], exact(by) - exact(after), places(settled))
    if not after:
        return later
    before = [value if ways[i] else mpmath.mpf(0) for i, value in enumerate(later)]
    return moved(rates, before, exact(after), places([not each for each in ways]))


def exact(number):
    return number if isinstance(number, mpmath.mpf) else mpmath.mpf(float(number))


def steady(rates, values):
    """The mean of values after infinite time."""
    n, leads = len(rates), closure(rates)
    closed = [all(leads[j][i] for j in places(leads[i])) for i in range(n)]
    known = [mpmath.mpf(0)] * n
    for i in places(closed):
        members = places(leads[i])
        inner = exact_generator(np.asarray(rates)[np.ix_(members, members)]).T
        for k in range(len(members)):
            inner[len(members) - 1, k] = 1
        law = mpmath.lu_solve(inner, mpmath.matrix([0] * (len(members) - 1) + [1]))
        known[i] = sum(p * exact(values[j]) for p, j in zip(law, members, strict=True))
    return ended(rates, closed, known)


def total(rates, rewards, time):
    """The mean of a reward up to a time, by a last state into which it is counted."""
    n = len(rates)
    table = mpmath.zeros(n + 1)
    table[:n, :n] = exact_generator(rates)
    for i in range(n):
        table[i, n] = exact(rewards[i])
    found = exponential(table, exact(time))
    return [mpmath.ldexp(mpmath.mpf(int(found[i, n])), -BITS) for i in range(n)]


def variance_until(rates, goal, rewards):
    """The variance of a reward until a goal: the mean square, less the square of the mean."""
    mean = ended(rates, goal, [0.0] * len(rates), [float(each) for each in rewards])
    # of the square, 2 r m accumulates a time unit
    weights = [None if value is None else 2 * exact(r) * value for r, value in zip(rewards, mean, strict=True)]
    square = ended(rates, goal, [0.0] * len(rates), [0 if each is None else each for each in weights])
    return [None if m is None else s - m**2 for s, m in zip(square, mean, strict=True)]


def with_memory(rates, one, other):
    """The chain that knows which of two targets it has met: states (met, i), met of 0 to 3."""
    n = len(rates)
    big, marks = np.zeros((4 * n, 4 * n)), [int(one[i]) + 2 * int(other[i]) for i in range(n)]
    for met in range(4):
        for i in range(n):
            for j in range(n):
                big[met * n + i, (met | marks[j]) * n + j] = rates[i][j]
    return big, [marks[i] * n + i for i in range(n)]


def conditional(rates, one, other, by, given_by):
    """The probability of meeting one target by a time, given the other by its own."""
    n = len(rates)
    big, begins = with_memory(rates, one, other)
    every = [True] * (4 * n)

    def met(bits):
        return [(k // n) & bits == bits for k in range(4 * n)]

    if by == given_by:
        both = until(big, met(3), every, 0, by)
    else:
        first, second = (1, 2) if given_by is None or (by is not None and by < given_by) else (2, 1)
        soon, late = (by, given_by) if first == 1 else (given_by, by)
        rest = until(big, met(second), every, 0, None if late is None else exact(late) - exact(soon))
        values = [value if here else mpmath.mpf(0) for value, here in zip(rest, met(first), strict=True)]
        both = moved(big, values, exact(soon))
    given = until(big, met(2), every, 0, given_by)
    return [both[k] / given[k] if given[k] else None for k in begins]
