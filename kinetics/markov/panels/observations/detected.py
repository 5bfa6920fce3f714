"""Counts of which each copy is seen with some probability, independently of all others."""

from __future__ import annotations

from dataclasses import dataclass
from math import inf
from typing import ClassVar

import numpy as np

from kinetics.markov.panels.observations.base import Observation
from kinetics.support.arrays import Floats, real_number
from kinetics.support.packages import special


@dataclass(frozen=True)
class Detected(Observation):
    """Each copy is seen with probability p: of n copies a binomial number.

    >>> import numpy as np
    >>> from kinetics.markov.panels.observations import Detected
    >>> Detected(0.5).weights(np.array([1.0, 2.0, 3.0]), seen=2.0).round(12).tolist()
    [0.0, 0.25, 0.375]
    """

    name: ClassVar[str] = "detected"
    most: ClassVar[float] = 1.0

    p: float

    def __post_init__(self) -> None:
        if not 0.0 < real_number("p", self.p) <= 1.0:
            raise ValueError(f"p = {self.p:g}; expected a probability above 0 and at most 1 of seeing a copy")

    @property
    def parameter(self) -> float:
        """p."""
        return self.p

    def with_parameter(self, value: float) -> Detected:
        """Another p."""
        return Detected(value)

    def support(self, seen: float) -> tuple[float, float]:
        """The number and more. ValueError: it is no whole number of at least 0."""
        if seen != int(seen) or seen < 0:
            raise ValueError(f"{seen:g} is no number of copies seen; expected a whole number of at least 0")
        return (seen, seen) if self.p == 1.0 else (seen, inf)

    def drawn(self, counts: Floats, seen: float, rng: np.random.Generator) -> Floats:  # noqa: ARG002
        """Binomial numbers."""
        return rng.binomial(counts.astype(np.int64), self.p).astype(np.float64)

    def weights(self, counts: Floats, seen: float) -> Floats:
        """Binomial probabilities."""
        if self.p == 1.0:
            return np.asarray(counts == seen, dtype=np.float64)
        missed = counts - seen
        logs = special.gammaln(counts + 1) - special.gammaln(seen + 1) - special.gammaln(np.maximum(missed, 0.0) + 1)
        found = np.exp(logs + seen * np.log(self.p) + missed * np.log1p(-self.p))
        return np.asarray(np.where(missed >= 0, found, 0.0))

    def slopes(self, counts: Floats, seen: float) -> Floats:
        """Derivatives (N,) of the binomial probabilities by p; at p = 1 from below."""
        if self.p == 1.0:
            return np.where(counts == seen, seen, 0.0) - np.where(counts == seen + 1, seen + 1.0, 0.0)
        return self.weights(counts, seen) * (seen / self.p - (counts - seen) / (1.0 - self.p))
