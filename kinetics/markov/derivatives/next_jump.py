"""Derivatives of the probability that the next jump leads to given states."""

from __future__ import annotations

import numpy as np

from kinetics.markov.derivatives.gradient import ChannelEntries, Gradient
from kinetics.markov.transient.poisson import ROUNDOFF
from kinetics.markov.transient.transitions import totals
from kinetics.support.answer import Answer
from kinetics.support.arrays import Floats


def gradient_next(entries: ChannelEntries, start: Floats, chances: Floats, hits: Floats, answer: Answer) -> Gradient:
    """Gradient of the mean over a start (N,) of the `chances` (N,) that the next jump from each state hits.

    hits : (K,) 1 for entries that lead to the states asked for, else 0

    The chance of state i is sum_k r_k h_k / q_i, so that its derivative by ln r_k is r_k / q_i (h_k - chance_i).

    >>> from kinetics import Chain, Network, Sensitivity
    >>> steps = Network.from_text('''A -> B, 1
    ... A -> C, 3''')
    >>> Sensitivity(Chain.of(steps, {"A": 1})).next_jump("B == 1").value.round(9).tolist()  # 1/4 * 3/4
    [0.1875, -0.1875]
    """
    rows, _, rates, *_ = entries.transitions
    exits = totals(rows, rates, start.size)
    shares = start[rows] * rates / exits[rows]
    terms = shares * (hits - chances[rows])
    roundings = 3.0 * (entries.transitions.roundings + float(np.bincount(rows, minlength=1).max())) + 16.0 + rates.size
    wide = 1.01 * ROUNDOFF * roundings * entries.by_channel(shares)
    return Gradient(answer, entries.by_channel(terms), wide, entries.transitions.is_certified)
