"""What predictions take from a result, whether it was sampled, solved or approximated."""

from __future__ import annotations

from typing import Any, Protocol

from kinetics.network import Network
from kinetics.runs import Truncation
from kinetics.support.arrays import Floats
from kinetics.support.plots import Bands


class CountsOverTime(Protocol):
    """Mean and spread of V species or sums of counts at T times; arrays are (T, V).

    To add a kind of result, give it these members: nothing that shows or writes a prediction asks which kind it has.
    """

    @property
    def network(self) -> Network:
        """Names what is counted, and the unit of time."""
        ...

    @property
    def times(self) -> Floats:
        """(T,) in the network's unit, rising."""
        ...

    @property
    def runs(self) -> int | None:
        """Number of sampled runs; None for a result that was not sampled."""
        ...

    @property
    def error(self) -> float:
        """Bound on, or estimate of, the numerical error of the probabilities; 0 for runs, nan if none is known."""
        ...

    @property
    def is_interrupted(self) -> bool:
        """Whether fewer runs were made than were asked for."""
        ...

    @property
    def truncated(self) -> Truncation | None:
        """Why there are fewer times than were asked for; None if there are not."""
        ...

    @property
    def meaning(self) -> str:
        """What its figures are, in a few words."""
        ...

    @property
    def approximation(self) -> dict[str, Any] | None:
        """For JSON: which approximation it is and how far off; None for an exact method."""
        ...

    @property
    def no_interval(self) -> str:
        """Why its means have no interval from the uncertainty of the rates; "" if they can have one."""
        ...

    @property
    def notes(self) -> tuple[str, ...]:
        """Remarks on its figures, for the reader."""
        ...

    def mean(self) -> Floats:
        """Mean counts, or what stands in their place."""
        ...

    def sd(self) -> Floats:
        """Standard deviation of a single run; nan if not known."""
        ...

    def standard_error(self) -> Floats:
        """Standard error of the mean; 0 for a result that was not sampled."""
        ...

    def precision(self, standard_error: Floats) -> str:
        """How well its means are known, in a few words; standard_error (T, V) of the means."""
        ...

    def columns(self, standard_error: Floats) -> dict[str, Floats]:
        """Its figures (T, V) by the names that tables give them."""
        ...

    def bands(self) -> Bands | None:
        """Means and the middle 95 % of runs; None if not known."""
        ...

    def approximate(self) -> Floats | None:
        """Values (T, V) of an approximation of the means; None for an exact method."""
        ...
