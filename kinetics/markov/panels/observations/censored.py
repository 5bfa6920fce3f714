"""Counts of which only an interval is known, cell by cell."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from math import inf
from typing import Any, ClassVar

import numpy as np

from kinetics.markov.panels.observations.base import Observation
from kinetics.support.arrays import Floats


@dataclass(frozen=True)
class Censored(Observation):
    """Some numbers stand for an interval in which the count lies, ends included; all others are counts.

    intervals : the number in the table -> the least and the largest count, which may be inf

    >>> import numpy as np
    >>> from kinetics.markov.panels.observations import Censored
    >>> some = Censored({4.5: (3, 6)})
    >>> some.weights(np.array([2.0, 3.0, 6.0]), seen=4.5).tolist(), some.weights(np.array([2.0, 3.0]), 3.0).tolist()
    ([0.0, 1.0, 1.0], [0.0, 1.0])
    """

    name: ClassVar[str] = "censored"
    is_certified: ClassVar[bool] = True

    intervals: Mapping[float, tuple[float, float]] = field(default_factory=dict)

    def __post_init__(self) -> None:
        for number, (low, high) in self.intervals.items():
            if not low <= number <= high or high < 0.0:
                raise ValueError(f"{number:g} stands for counts from {low:g} to {high:g}; expected it to lie between")

    def support(self, seen: float) -> tuple[float, float]:
        """The interval, or the number itself. ValueError: it is no whole number of at least 0."""
        if seen not in self.intervals and (seen != int(seen) or seen < 0):
            raise ValueError(f"{seen:g} is neither a count nor stands for an interval")
        return self.intervals.get(seen, (seen, seen))

    @property
    def told(self) -> dict[str, Any]:
        """How many numbers stand for intervals."""
        return {"intervals": len(self.intervals)}

    def words(self, seen: float) -> str:
        """What an error says was seen."""
        low, high = self.intervals.get(seen, (seen, seen))
        return f"{low:g}" if low == high else f"{low:g} or more" if high == inf else f"{low:g} to {high:g}"

    def drawn(self, counts: Floats, seen: float, rng: np.random.Generator) -> Floats:  # noqa: ARG002
        """`seen` for counts in its interval, the others as they are: on the side on which they lie."""
        return np.where(self.weights(counts, seen) > 0.0, seen, counts)

    def weights(self, counts: Floats, seen: float) -> Floats:
        """1 in the interval, else 0."""
        low, high = self.intervals.get(seen, (seen, seen))
        return np.asarray((counts >= low) & (counts <= high), dtype=np.float64)
