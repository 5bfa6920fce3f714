"""What a value of a chain gains or loses as the rates of each channel grow, with limits."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from kinetics.passage.backward import LimitedValue
from kinetics.solving.transitions import Transitions, totals
from kinetics.support.arrays import Floats, Ints


class Slopes(NamedTuple):
    """The derivatives of an answer by the logarithm of all rates of each of C channels.

    answer : the value itself
    value, wide : (C,) in its units, and how far off they may be
    is_bound : whether `wide` is proven
    """

    answer: LimitedValue
    value: Floats
    wide: Floats
    is_bound: bool

    @classmethod
    def none(cls, answer: LimitedValue, n_channels: int) -> Slopes:
        """Of an answer that no rate changes."""
        return cls(answer, np.zeros(n_channels), np.zeros(n_channels), answer.is_bound)


class ChannelEntries(NamedTuple):
    """The entries of a chain, with the channel (K,), of C, that each belongs to."""

    transitions: Transitions
    n_channels: int

    @property
    def channels(self) -> Ints:
        """The channel (K,) of each entry."""
        channels = self.transitions.channels
        if channels is None:
            raise ValueError("the entries of this chain belong to no channels; say which")
        return channels

    @property
    def most(self) -> int:
        """Most entries of one channel: how many numbers `by_channel` adds up."""
        return int(np.bincount(self.channels, minlength=1).max())

    def by_channel(self, values: Floats) -> Floats:
        """Sums (C,) of values (K,) over the entries of each channel."""
        return totals(self.channels, values, self.n_channels)
