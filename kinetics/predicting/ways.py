"""What a way to an accuracy is: it forecasts its cost, and is attempted when that is the least."""

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
    from kinetics.runs import EnsembleStatistics


@dataclass
class Goal:
    """The accuracy that is asked of a job, and what its ways share.

    budget : s of processor time
    tops : (V,) upper bounds of what is shown, inf where none is known
    is_listed : whether all states are known, of which `tops` are then the largest counts
    """

    job: Job
    asked: AskedAccuracy
    budget: float
    tops: Floats
    is_listed: bool = False


class Attained(NamedTuple):
    """An answer with the bound on its error, in the unit of the accuracy.

    confidence : with which the bound holds for all figures together; 1 for a solution
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
    """A way to an accuracy. One more takes a class like this, and its name in `adaptive.WAYS`.

    name : of the method, as results show it
    cost : as far as it is known
    is_settled : whether it should be attempted at once, as the other ways would take as long to forecast their cost
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
        """What an attempt may cost, s, by which the ways take their turns; inf where it is not to be attempted."""
        return self.seconds

    @property
    def tenfold(self) -> CostForecast | None:
        """The cost of a tenth of the error; None where it is not known, or cannot be reached."""
        return None

    @property
    def advice(self) -> str:
        """What else to ask for, where the cost is beyond the budget; "" where it is not known."""
        return ""

    @abstractmethod
    def forecast(self, rivals: float) -> None:
        """Set `cost`, spending no more than a share of `rivals`, the least forecast of the other ways.

        It is called twice, the second time when all others have made a forecast.
        """

    @abstractmethod
    def attempt(self) -> Attained | None:
        """The answer; None where it turns out that this way does not reach the accuracy, of which `cost` says why."""

    def interrupted(self) -> Attained | None:
        """The answer as far as it has come, after Ctrl-C; None where there is none."""
        return None
