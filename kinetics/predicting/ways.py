"""The base of all ways to an accuracy: each forecasts its cost, and the cheapest is attempted."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from math import inf
from typing import TYPE_CHECKING, ClassVar, NamedTuple

from kinetics.predicting.accuracy import AskedAccuracy, CostForecast
from kinetics.predicting.job import Job
from kinetics.support.arrays import Floats

if TYPE_CHECKING:
    from kinetics.markov.transient import Distribution
    from kinetics.sampling.statistics import EnsembleStatistics


@dataclass
class Goal:
    """The accuracy that is asked of a job, and what its ways share.

    budget : s of processor time
    tops : (V,) upper bounds of what is shown, inf if none is known
    is_listed : whether all states are known, of which `tops` are then the largest counts
    """

    job: Job
    asked: AskedAccuracy
    budget: float
    tops: Floats
    is_listed: bool = False


class Attained(NamedTuple):
    """An answer with the bound on its error, in the unit of the accuracy.

    confidence : of the bound, for all figures together; 1 for a solution
    is_complete : not interrupted, and within the budget
    rare : how rare events were allowed for
    """

    result: EnsembleStatistics | Distribution
    error: float
    is_proven: bool = True
    confidence: float = 1.0
    is_complete: bool = True
    rare: str = ""


class AccuracyWay(ABC):
    """A way to reach an accuracy. To add one, write a class like this and name it in `adaptive.WAYS`.

    name : of the method, as results show it
    cost : forecast, as far as it is known
    is_settled : true if it should be attempted at once, as forecasts by the other ways would cost as much
    """

    name: ClassVar[str]
    remark: ClassVar[str] = ""

    def __init__(self, goal: Goal) -> None:
        self.goal = goal
        self.cost = CostForecast(self.name, None, self.remark)
        self.is_settled = False

    @property
    def seconds(self) -> float:
        """The forecast cost; inf as long as there is none."""
        return inf if self.cost.seconds is None else self.cost.seconds

    @property
    def at_most(self) -> float:
        """The most that an attempt may cost, s; ways are tried in this order. inf if it is not to be attempted."""
        return self.seconds

    @property
    def tenfold(self) -> CostForecast | None:
        """The cost of a tenth of the error; None if it is not known, or cannot be reached."""
        return None

    @property
    def advice(self) -> str:
        """Advice on what to ask for instead if the cost exceeds the budget; "" if there is none."""
        return ""

    @abstractmethod
    def forecast(self, rivals: float) -> None:
        """Set `cost`, spending no more than a share of `rivals`, the least forecast of the other ways.

        It is called twice, the second time when all others have made a forecast.
        """

    @abstractmethod
    def attempt(self) -> Attained | None:
        """The answer; None if this way turns out not to reach the accuracy, and then `cost` gives the reason."""

    def interrupted(self) -> Attained | None:
        """The partial answer after Ctrl-C; None if there is none."""
        return None
