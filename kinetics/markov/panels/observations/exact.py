"""Counts that are seen as they are."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from kinetics.markov.panels.observations.base import Observation
from kinetics.support.arrays import Floats


@dataclass(frozen=True)
class Exact(Observation):
    """Every copy is seen, and counted right.

    >>> import numpy as np
    >>> from kinetics.markov.panels.observations import Exact
    >>> Exact().weights(np.array([2.0, 3.0, 4.0]), seen=3.0).tolist()
    [0.0, 1.0, 0.0]
    """

    name: ClassVar[str] = "exact"
    is_certified: ClassVar[bool] = True

    def support(self, seen: float) -> tuple[float, float]:
        """The number itself. ValueError: it is no whole number of at least 0."""
        if seen != int(seen) or seen < 0:
            raise ValueError(f"{seen:g} is no count; expected a whole number of at least 0, or say how it was observed")
        return seen, seen

    def drawn(self, counts: Floats, seen: float, rng: np.random.Generator) -> Floats:  # noqa: ARG002
        """The counts."""
        return counts

    def weights(self, counts: Floats, seen: float) -> Floats:
        """1 where the count is the number, else 0."""
        return np.asarray(counts == seen, dtype=np.float64)
