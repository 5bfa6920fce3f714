"""Which channels share a rate constant: none, all of an event, or those of one rate class, as fine as is asked for.

A channel is the finest grouping: each has a constant of its own. By class, the ways of a channel have the constants of
their rate classes, whatever book they are of; classes may in turn share constants, by what they have in common.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Literal

import numpy as np
from numpy.typing import NDArray

from calibration.estimating.exposure import require_same
from kinetics.network import Network
from kinetics.rates import class_keys
from kinetics.support.arrays import Floats, Ints

if TYPE_CHECKING:
    from kinetics.assembly import Derivation, RateClass

Sharing = Literal["event", "touched", "faces", "sizes"]
SHARINGS: tuple[Sharing, ...] = (
    "event",
    "touched",
    "faces",
    "sizes",
)  # what the classes of one constant have in common


@dataclass(frozen=True, eq=False)
class Grouping:
    """The constants of the channels of some networks.

    keys : names of the K constants
    networks : those whose runs it covers
    sorts : for each network the sort (R,) of each channel, -1 for a channel that is not looked at
    shares : (L, K) part of the ways of each sort of channel that has each constant
    classes : the K rate classes behind the keys; none by channel
    """

    keys: tuple[str, ...]
    networks: tuple[Network, ...]
    sorts: tuple[Ints, ...]
    shares: Floats
    classes: tuple[RateClass, ...] = ()

    @classmethod
    def by_channel(cls, network: Network, channels: Sequence[str]) -> Grouping:
        """One constant for each of these channels."""
        sorts = np.full(len(network.channels), -1, dtype=np.int64)
        sorts[[network.channel_places[name] for name in channels]] = np.arange(len(channels))
        return cls(tuple(channels), (network,), (sorts,), np.eye(len(channels)))

    @classmethod
    def by_class(cls, derivations: Sequence[Derivation], event: Literal["join", "break"]) -> Grouping:
        """One constant for each rate class of this event in any of the books."""
        classes = tuple(sorted({c for book in derivations for c in book.rate_classes if c.event == event}))
        places = {c: i for i, c in enumerate(classes)}
        rows: dict[tuple[tuple[int, float], ...], int] = {}
        sorts = []
        for book in derivations:
            known = np.full(len(book.events), -1, dtype=np.int64)
            for channel, ways in enumerate(book.events.values()):
                total = sum(ways.values())
                row = tuple(sorted((places[c], n / total) for c, n in ways.items() if c in places))
                if row:
                    known[channel] = rows.setdefault(row, len(rows))
            sorts.append(known)
        shares = np.zeros((len(rows), len(classes)))
        for row, sort in rows.items():
            for place, share in row:
                shares[sort, place] = share
        networks = tuple(book.network for book in derivations)
        return cls(tuple(map(str, classes)), networks, tuple(sorts), shares, classes)

    def sharing(self, common: Sharing, is_measured: NDArray[np.bool_]) -> Grouping:
        """One constant for all measured classes (K,) that have this in common, under the keys of a rates file."""
        named = [class_keys(c)[-1 - SHARINGS.index(common)] for c in self.classes]
        keys = tuple(dict.fromkeys(named[k] for k in np.flatnonzero(is_measured).tolist()))
        members = np.array([[float(name == key) for key in keys] for name in named]).reshape(len(named), len(keys))
        return replace(self, keys=keys, shares=self.shares @ members, classes=())

    @property
    def is_mixed(self) -> bool:
        """True if a channel has ways with different constants, so that its events have to be shared out."""
        return bool((np.count_nonzero(self.shares, axis=1) > 1).any())

    def sorts_of(self, network: Network) -> Ints:
        """Sort (R,) of each channel of a network. ValueError: it is none of those that are covered."""
        for known, sorts in zip(self.networks, self.sorts, strict=True):
            if known.fingerprint == network.fingerprint:
                require_same(known, network)
                return sorts
        require_same(self.networks[0], network)
        raise AssertionError("a network of this fingerprint is covered")
