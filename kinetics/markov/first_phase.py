"""Questions about a time interval, in two phases: forwards to where it begins, then backwards over its length.

With p the distribution at the beginning, of runs that kept to the states allowed until then, the answer is the mean
over p of that of an interval which begins at 0 (Baier et al. 2003, doi:10.1109/TSE.2003.1205180).
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import replace
from fractions import Fraction
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from kinetics.markov.transient import ListingMethod, StateSpace, Transient, Transitions
from kinetics.markov.transient.poisson import ROUNDOFF
from kinetics.markov.transient_means import one_time, stopped_in
from kinetics.support.answer import Answer, kind_of, weakest
from kinetics.support.arrays import Floats
from kinetics.support.cli.progress import allowed

Mask = NDArray[np.bool_]


class FirstPhase(NamedTuple):
    """The state of a chain at the beginning of a time interval: its distribution, and the probability truncated before.

    start : (N,) probabilities, which sum to 1, of runs that kept to the allowed states and met no edge
    share : probability of such a run
    lost : probability of one that kept to the allowed states, and may have passed the edge of a truncated chain
    error : bound on the absolute error of share * start summed over all states, and of what is made of it
    slip : bound on the error of `length`, tu
    length : from the beginning of the interval to its end, tu; inf if it has none
    """

    start: Floats
    share: float
    lost: float
    error: float
    is_bound: bool
    length: float
    slip: float
    cpu_seconds: float

    @classmethod
    def of(
        cls,
        transitions: Transitions,
        initial: Floats,
        allowed_states: Mask,
        truncated: Mask,
        interval: tuple[float, float | None],
        space: StateSpace | None = None,
        method: ListingMethod | None = None,
    ) -> FirstPhase:
        """Compute the first phase of a question about an interval from `after` to `by`, tu, None for ever."""
        began = time.process_time()
        begins, by = one_time("after", interval[0]), interval[1]
        ends = np.inf if by is None else one_time("by", by)
        if ends < begins:
            raise ValueError(f"a target after {begins:g} tu also needs a time by which, no earlier; by = {by}")
        stops, chosen = ~allowed_states, method or Transient(max_seconds=allowed(Transient.max_seconds))
        chain = transitions.stopped(stops)
        rows, error, is_bound = chosen.probabilities(chain, initial, np.array([begins]), stopped_in(space, stops))
        here = np.where(allowed_states & ~truncated, rows[0], 0.0)
        share, lost = float(here.sum()), float(rows[0][allowed_states & truncated].sum())
        length = ends - begins
        is_exact = by is None or Fraction(ends) - Fraction(begins) == Fraction(length)
        slip = 0.0 if is_exact else 2.0 * ROUNDOFF * length
        # a sum, a quotient and a product more, each of the states' share
        wrong = 1.001 * (error + ROUNDOFF * (initial.size + 8))
        seconds = time.process_time() - began
        return cls(here / (share or 1.0), share, lost, wrong, is_bound, length, slip, seconds)

    def then(self, second: Callable[[Floats, float], Answer], fastest: float) -> Answer:
        """The answer of both phases, where `second` answers for a start (N,) and a length of time, tu.

        fastest : largest exit rate, 1/tu
        """
        found = second(self.start, self.length)
        # probabilities are at most 1: no mean changes by more than the start, or what happens in `slip`
        wide = self.error + 2.0 * self.slip * fastest
        low, high = max(found.low * self.share - wide, 0.0), found.high * self.share + wide + 1.001 * self.lost
        kind = weakest(found, replace(found, kind=kind_of(self.is_bound)))
        seconds = found.cpu_seconds + self.cpu_seconds
        return replace(found, value=found.value * self.share, low=low, high=high, kind=kind, cpu_seconds=seconds)
