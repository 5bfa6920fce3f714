"""Counts that were rounded, so that each is known to lie in an interval."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from kinetics.markov.panels.observations.base import Observation
from kinetics.support.arrays import Floats, real_number


@dataclass(frozen=True)
class Rounded(Observation):
    """The count lies within `half` of the number, ends included: numbers rounded to tens have half = 5.

    >>> import numpy as np
    >>> from kinetics.markov.panels.observations import Rounded
    >>> Rounded(0.5).weights(np.array([2.0, 3.0, 4.0]), seen=2.5).tolist()
    [1.0, 1.0, 0.0]
    """

    name: ClassVar[str] = "rounded"
    is_certified: ClassVar[bool] = True

    half: float

    def __post_init__(self) -> None:
        if not real_number("half", self.half) >= 0.0:
            raise ValueError(f"half = {self.half:g}; expected half the width of the interval, at least 0")

    def support(self, seen: float) -> tuple[float, float]:
        """The interval. ValueError: no count is in it."""
        if seen + self.half < 0:
            raise ValueError(f"{seen:g} with {self.half:g} on both sides holds no count of at least 0")
        return seen - self.half, seen + self.half

    def drawn(self, counts: Floats, seen: float, rng: np.random.Generator) -> Floats:  # noqa: ARG002
        """`seen` for counts in its interval, the others as they are: on the side on which they lie."""
        return np.where(self.weights(counts, seen) > 0.0, seen, counts)

    def weights(self, counts: Floats, seen: float) -> Floats:
        """1 in the interval, else 0."""
        return np.asarray((counts >= seen - self.half) & (counts <= seen + self.half), dtype=np.float64)
