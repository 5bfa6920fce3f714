"""The gradient of a value of a chain by the rates of each channel, with bounds."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from kinetics.markov.transient.transitions import Transitions, totals
from kinetics.support.answer import Answer
from kinetics.support.arrays import Floats, Ints


class Gradient(NamedTuple):
    """The derivatives of an answer by the logarithm of all rates of each of C channels.

    answer : the value itself
    value, wide : (C,) in its units, and how far off they may be
    is_bound : whether `wide` is proven

    >>> import numpy as np
    >>> from kinetics import Network, reachable
    >>> from kinetics.markov.derivatives import ChannelEntries, gradient_until
    >>> entries = ChannelEntries(reachable(Network.from_text("A -> B, 2"), {"A": 1}).transitions(), n_channels=1)
    >>> found = gradient_until(entries, np.array([1.0, 0.0]), np.array([True, True]), np.array([False, True]))
    >>> found.answer.value, found.value.tolist()  # B is certain, whatever the rate
    (1.0, [0.0])
    """

    answer: Answer
    value: Floats
    wide: Floats
    is_bound: bool

    @classmethod
    def none(cls, answer: Answer, n_channels: int) -> Gradient:
        """The gradient of an answer that no rate changes, all 0."""
        return cls(answer, np.zeros(n_channels), np.zeros(n_channels), answer.is_bound)


class ChannelEntries(NamedTuple):
    """The entries of a chain, with the channel (K,), of C, that each belongs to.

    >>> from kinetics import Network, reachable
    >>> from kinetics.markov.derivatives import ChannelEntries
    >>> entries = ChannelEntries(reachable(Network.from_text("A <-> B, 2, 3"), {"A": 2}).transitions(), n_channels=2)
    >>> entries.by_channel(entries.transitions.rates).tolist()  # 2 * 2 + 1 * 2, and 1 * 3 + 2 * 3
    [6.0, 9.0]
    """

    transitions: Transitions
    n_channels: int

    @property
    def channels(self) -> Ints:
        """The channel of each entry (K,) of the transitions."""
        channels = self.transitions.channels
        if channels is None:
            raise ValueError("the transitions of this chain belong to no channels; name them")
        return channels

    @property
    def most(self) -> int:
        """Most entries of one channel: how many numbers `by_channel` adds up."""
        return int(np.bincount(self.channels, minlength=1).max())

    def by_channel(self, values: Floats) -> Floats:
        """Sums (C,) of values (K,) over the entries of each channel."""
        return totals(self.channels, values, self.n_channels)
