"""Priors of parameters: what was believed of one before the data."""

from __future__ import annotations

from dataclasses import dataclass
from math import log, pi, sqrt

SPREAD = 1.959963984540054  # standard deviations of a normal distribution on either side that hold 95 % of it


@dataclass(frozen=True)
class LogNormalPrior:
    """A normal distribution of the logarithm of a parameter, given by the middle 95 % of the parameter.

    low, high : 2.5 % and 97.5 % quantiles, above 0

    ValueError: not 0 < low < high < inf

    >>> from calibration.estimating.priors import LogNormalPrior
    >>> prior = LogNormalPrior(0.1, 10.0)
    >>> round(prior.scored(0.0)[0], 6), round(abs(prior.scored(0.0)[1]), 9)  # density and its slope at the middle, 1
    (-1.080045, 0.0)
    """

    low: float
    high: float

    def __post_init__(self) -> None:
        if not 0.0 < self.low < self.high < float("inf"):
            raise ValueError(f"a prior between {self.low:g} and {self.high:g}; expected two rising numbers above 0")

    @property
    def middle(self) -> float:
        """The median of the logarithm."""
        return 0.5 * (log(self.low) + log(self.high))

    @property
    def sd(self) -> float:
        """Standard deviation of the logarithm."""
        return (log(self.high) - log(self.low)) / (2.0 * SPREAD)

    def scored(self, at: float) -> tuple[float, float]:
        """Log-density of the logarithm at a value of it, and its derivative."""
        off = (at - self.middle) / self.sd
        return -0.5 * off**2 - log(self.sd * sqrt(2.0 * pi)), -off / self.sd
