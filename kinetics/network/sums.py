"""Sums of counts: one species, or several with weights."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from kinetics.network.network import Network
from kinetics.support.arrays import Floats

Counted = str | Mapping[str, float]  # a species, or species with their weights


def summed(network: Network, counted: Counted) -> tuple[Floats, str]:
    """The weight (S,) of each species in a sum, and the sum as text.

    ValueError: an unknown species, or a weight that is no finite number

    >>> from kinetics import Network
    >>> weights, name = summed(Network.from_text("2 A -> D, 1"), {"A": 1, "D": 2})
    >>> weights.tolist(), name
    ([1.0, 2.0], 'A + 2 D')
    """
    if not isinstance(counted, str | Mapping):
        raise ValueError(f"{counted!r} is neither a species nor a sum of them, as in {{'A': 1, 'AB': 2}}")
    parts = {counted: 1.0} if isinstance(counted, str) else dict(counted)
    weights = np.zeros(len(network.species))
    for name, weight in parts.items():
        if not np.isfinite(weight):
            raise ValueError(f"weight of {name!r} is {weight}; expected a finite number")
        weights[network.index(name)] = weight
    return weights, " + ".join(name if weight == 1 else f"{weight:g} {name}" for name, weight in parts.items())


def in_words(name: str, least: int) -> str:
    """A count or a sum of counts that is to be reached.

    >>> in_words("B", 3), in_words("A + 2 B", 3)
    ('3 B', 'A + 2 B >= 3')
    """
    return f"{name} >= {least}" if " " in name else f"{least} {name}"
