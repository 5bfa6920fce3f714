"""A measured rate constant, whatever it belongs to: interval, evidence, and the exposure to the partners of a break."""

from __future__ import annotations

from kinetics.rates.break_terms import BreakTerms
from kinetics.support.arrays import Floats
from kinetics.support.settings import NotNegative, Positive, Settings


class MeasuredRate(Settings):
    """A rate constant, 1/tu per way and combination, with its interval and its evidence.

    low, high : 95 % interval of the rate
    events, exposure : firings n, and the integral of ways * combinations over the time observed, tu
    """

    rate: NotNegative
    low: NotNegative | None = None
    high: NotNegative | None = None
    events: NotNegative | None = None
    exposure: Positive | None = None

    def __post_init__(self) -> None:
        if (self.low is None) != (self.high is None):
            raise ValueError("low and high must be given together")
        if self.low is not None and self.high is not None and not self.low <= self.rate <= self.high:
            raise ValueError(f"expected low <= rate <= high; {self.low}, {self.rate}, {self.high} came")
        if (self.events is None) != (self.exposure is None):
            raise ValueError("events and exposure must be given together")

    @property
    def exposures(self) -> tuple[float, ...] | None:
        """Exposure to each partner of a break, tu, where known; weighted by the model they add up to `exposure`."""
        return None

    def exposure_at(self, breaks: BreakTerms, points: Floats, name: str) -> Floats | None:  # noqa: ARG002
        """Exposure (G,) at shapes (G, S) of the break model; None if it does not depend on them."""
        return None
