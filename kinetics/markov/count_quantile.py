"""Quantiles of a count of a chain at a time, with bounds."""

from __future__ import annotations

import time
from bisect import bisect_left
from dataclasses import replace
from functools import cache

import numpy as np

from kinetics.markov.chain import Chain, reward_asked
from kinetics.markov.transient_means import mean_at, one_time
from kinetics.support.answer import Answer, kind_of


def count_quantile(chain: Chain, name: str | None, at: float, q: float) -> Answer:
    """The least value that a reward does not exceed `at` a time, tu, with probability q or more; 0 < q < 1.

    low, high : the bounds differ where the probability of a value is q within its error, as of a median between two
        values. Of a truncated chain, high is inf if q is not reached within it
    Cost: a pass for each of about log2 n values, of n different ones. ValueError: the reward has impulses

    >>> from kinetics import Chain, Network
    >>> from kinetics.markov.count_quantile import count_quantile
    >>> decay = Chain.of(Network.from_text("A -> B, 1"), {"A": 10})
    >>> count_quantile(decay, "A", 0.5, 0.9).value  # of a binomial number, 10 with probability exp(-1/2)
    8.0
    """
    given, began, now = reward_asked(chain, name, at, None, None, False), time.process_time(), one_time("at", at)
    rates, kept = np.asarray(given.rates), ~chain.truncated
    values = np.unique(rates[kept])

    def mean(weights: np.ndarray) -> Answer:
        return mean_at(chain.transitions, chain.initial, weights.astype(float), now, chain.space)

    away = mean(~kept) if not kept.all() else Answer(0.0, 0.0, 0.0)

    @cache
    def up_to(place: int) -> Answer:
        """The probability of at most the value at a place; truncated states count in its upper bound."""
        if place == values.size - 1 and kept.all():
            return Answer(1.0, 1.0, 1.0, method=probability.method)
        found = mean((rates <= values[place]) & kept)
        return replace(found, high=found.high + away.high)

    probability = mean((rates <= values[0]) & kept)

    def least(end: str) -> float:
        place = bisect_left(range(values.size), q, key=lambda place: getattr(up_to(place), end))
        return float(values[place]) if place < values.size else np.inf

    value, low, high = (least(end) for end in ("value", "high", "low"))
    if away.high >= q:  # even the least value may be exceeded by less than that
        low = 0.0
    kind = kind_of(probability.is_bound and away.is_bound)
    found = replace(probability, value=value, low=low, high=high, kind=kind).inflated(given.error)
    return replace(found, cpu_seconds=time.process_time() - began)
