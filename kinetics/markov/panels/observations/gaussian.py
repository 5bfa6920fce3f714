"""Counts read by an instrument with an error of its own."""

from __future__ import annotations

from dataclasses import dataclass
from math import inf, pi, sqrt
from typing import ClassVar

import numpy as np

from kinetics.markov.panels.observations.base import Observation
from kinetics.support.arrays import Floats, real_number


@dataclass(frozen=True)
class Gaussian(Observation):
    """The number is the count plus a normal error with standard deviation `sd`, in copies; its density.

    >>> import numpy as np
    >>> from kinetics.markov.panels.observations import Gaussian
    >>> Gaussian(2.0).weights(np.array([10.0]), seen=10.0).round(6).tolist()  # 1 / (2 sqrt(2 pi))
    [0.199471]
    """

    name: ClassVar[str] = "gaussian"

    sd: float

    def __post_init__(self) -> None:
        if not 0.0 < real_number("sd", self.sd) < inf:
            raise ValueError(f"sd = {self.sd:g}; expected the standard deviation of the error, in copies, above 0")

    @property
    def parameter(self) -> float:
        """sd."""
        return self.sd

    def with_parameter(self, value: float) -> Gaussian:
        """Another standard deviation."""
        return Gaussian(value)

    def support(self, seen: float) -> tuple[float, float]:  # noqa: ARG002
        """Any count."""
        return 0.0, inf

    def drawn(self, counts: Floats, seen: float, rng: np.random.Generator) -> Floats:  # noqa: ARG002
        """The counts with an error."""
        return counts + self.sd * rng.standard_normal(counts.shape)

    def weights(self, counts: Floats, seen: float) -> Floats:
        """Normal densities."""
        away = (seen - counts) / self.sd
        return np.asarray(np.exp(-0.5 * away**2) / (self.sd * sqrt(2.0 * pi)))

    def slopes(self, counts: Floats, seen: float) -> Floats:
        """Derivatives (N,) of the densities by the standard deviation."""
        away = (seen - counts) / self.sd
        return self.weights(counts, seen) * (away**2 - 1.0) / self.sd
