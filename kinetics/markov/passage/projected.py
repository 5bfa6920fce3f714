"""First passage in a part of a chain: limits of its law, from the earliest and the latest that it may be."""

from __future__ import annotations

from dataclasses import dataclass

from numpy.typing import ArrayLike

from kinetics.markov.passage.first_passage import Passage
from kinetics.markov.passage.until import UNDERFLOW
from kinetics.support.arrays import Floats
from kinetics.support.tables import in_unit


@dataclass(frozen=True, eq=False)
class ProjectedPassage:
    """The distribution of a first-passage time, tu, of a chain that is followed within some states only.

    A run that leaves them reaches the target then at the earliest, and never at the latest: the cdf of the time lies
    between those of the two (Munsky & Khammash 2006, doi:10.1063/1.2145882).

    earliest : the time until the target is reached or the chain is lost
    latest : the time until the target is reached; it never is where the chain is lost
    """

    earliest: Passage
    latest: Passage

    @property
    def target(self) -> str:
        """The target, in words."""
        return self.latest.target

    @property
    def is_bound(self) -> bool:
        """Whether the limits are proven; not by rate laws."""
        return self.earliest.is_bound and self.latest.is_bound

    @property
    def mean_low(self) -> float:
        """Lower limit of the mean time; it has no upper one."""
        return self.earliest.mean * (1.0 - self.earliest.error)

    @property
    def probability_bounds(self) -> tuple[float, float]:
        """Lower and upper limits of the probability of ever reaching the target."""
        low, high = self.latest, self.earliest
        most = high.probability * (1.0 + high.error)
        if most < UNDERFLOW and high.may_reach:  # too small for numbers, or known to few digits
            most += UNDERFLOW
        return low.probability * (1.0 - low.error) if low.probability > UNDERFLOW else 0.0, min(most, 1.0)

    def cdf_bounds(self, times: ArrayLike) -> tuple[Floats, Floats]:
        """Lower and upper limits of the probability (...) that the target has been reached by `times` (...), tu."""
        return self.latest.cdf_bounds(times)[0], self.earliest.cdf_bounds(times)[1]

    def survival_bounds(self, times: ArrayLike) -> tuple[Floats, Floats]:
        """Lower and upper limits of the probability (...) that it has not been reached."""
        return self.earliest.survival_bounds(times)[0], self.latest.survival_bounds(times)[1]

    def quantile_bounds(self, q: ArrayLike) -> tuple[Floats, Floats]:
        """Limits of the times (...) by which it has been reached with probability q (...); inf where it may not be."""
        return self.earliest.quantile_bounds(q)[0], self.latest.quantile_bounds(q)[1]

    def __str__(self) -> str:
        unit = self.latest.time_unit
        low, high = self.probability_bounds
        return (
            f"time until {self.target}: mean at least {in_unit(f'{self.mean_low:.6g}', unit)}; "
            f"reached with probability {low:.12g} to {high:.12g}"
        )
