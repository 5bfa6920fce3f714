"""Derivatives of what happens until a remote end, by cycles between visits of the state that is visited most.

If rates fire f times before an end, the differences of values of two states are f times smaller than these, and
derivatives made of them lose as many digits. But the value of a state b, a mean or a probability, is that of a cycle,
until b comes again or an end, over the probability p that it is an end: E_b = C_b / p. From the start it is
E = C + R E_b, where R is the probability of being at b first. Cycles are short and p, however small, has all its digits
(regeneration: Asmussen 2003, Applied Probability and Queues, ch. VI, doi:10.1007/b97236), so that

    dE = dC + E_b dR + R E_b (dC_b / C_b - dp / p)

comes with bounds relative to E, unless the chain also moves for long elsewhere. Four eliminations.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from kinetics.markov.derivatives.gradient import ChannelEntries, Gradient
from kinetics.markov.passage.until import Mask
from kinetics.markov.transient.poisson import ROUNDOFF
from kinetics.markov.transient.transitions import Transitions
from kinetics.support.arrays import Floats

First = Callable[[ChannelEntries, Floats], Gradient]
Reached = Callable[[ChannelEntries, Floats, Mask, Mask], Gradient]


class Near(NamedTuple):
    """Numbers, and how far off they may be."""

    value: Floats
    wide: Floats

    def plus(self, other: Near) -> Near:
        """The sum of two numbers, with its error bound."""
        value = self.value + other.value
        return Near(value, 1.001 * (self.wide + other.wide) + ROUNDOFF * np.abs(value))

    def times(self, other: Near) -> Near:
        """The product of two numbers, with its error bound."""
        value = self.value * other.value
        wide = np.abs(self.value) * other.wide + self.wide * (np.abs(other.value) + other.wide)
        return Near(value, 1.001 * wide + ROUNDOFF * np.abs(value))

    def over(self, other: Near) -> Near:
        """The ratio to positive numbers; infinitely wide where these may be 0."""
        with np.errstate(all="ignore"):
            value = self.value / other.value
            least = other.value - other.wide
            wide = 1.001 * (self.wide + np.abs(value) * other.wide) / least + ROUNDOFF * np.abs(value)
            return Near(value, np.where(least > 0.0, wide, np.inf))


def by_cycles(
    entries: ChannelEntries, start: Floats, transient: Mask, back: int, first: First, reached: Reached
) -> Near:
    """Derivatives (C,) of a value that is 0 at once, as the mean of a reward in transient states (N,).

    back : the state between whose visits cycles are
    first : of the value until `back` comes again, which is then one more state, the last; from a start (N + 1,)
    reached : of the probability of reaching states on the way through others
    """
    n, chain = start.size, entries.transitions
    columns = np.where(chain.columns == back, n, chain.columns)
    cut = Transitions(chain.rows, columns, chain.rates, np.append(chain.leaks, 0.0), chain.rate_error, chain.channels)
    inside = entries._replace(transitions=cut)
    again, on_the_way, ends = np.arange(n + 1) == n, np.append(transient, False), np.append(~transient, False)
    begins = np.append(np.where(np.arange(n) == back, 0.0, start), start[back])
    there = np.eye(1, n + 1, back)[0]
    _, df = _both(first(inside, begins))
    r, dr = _both(reached(inside, begins, on_the_way, again))
    c, dc = _both(first(inside, there))
    p, dp = _both(reached(inside, there, on_the_way, ends))
    whole, less = c.over(p), dp.over(p)
    change = dc.over(c).plus(less._replace(value=-less.value))
    return df.plus(dr.times(whole)).plus(r.times(whole).times(change))


def _both(gradient: Gradient) -> tuple[Near, Near]:
    """The answer and its derivatives."""
    return Near(np.array(gradient.answer.value), np.array(gradient.answer.error)), Near(gradient.value, gradient.wide)
