"""First times of runs that end where a condition holds: their mean, probabilities, quantiles and survival curve."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from kinetics.network import Network
from kinetics.runs.truncation import Truncation
from kinetics.support import plots
from kinetics.support.answer import CONFIDENCE, Answer
from kinetics.support.arrays import Floats, Ints
from kinetics.support.datasets import dataframe
from kinetics.support.intervals import binomial_limits, student_interval
from kinetics.support.packages import pd, special
from kinetics.support.shown import ResultTable, Shown, Tabular, facts, on_axes
from kinetics.support.tables import counted, figure, in_unit

LEVEL = 0.95


class Survival(NamedTuple):
    """A survival curve: from each of `times` (n,) on, the probability (n,) that the condition has not held yet.

    low, high : (n,) pointwise interval
    """

    times: Floats
    probability: Floats
    low: Floats
    high: Floats


@dataclass(frozen=True, eq=False, repr=False)
class FirstTimes(Shown, Tabular):
    """When a condition first held in each of R independent runs; times in the network's unit.

    condition : as text
    times : (R,) first times; nan for a run in which the condition has not held as long as it was observed (censored)
    observed : (R,) until when each run was observed: its first time, the horizon, or where it was truncated
    counts : (R, S) at these times
    horizon : until when runs were observed at most; inf if they ended only if nothing could happen any more
    method : how the runs were made
    truncated : why runs were truncated, which are censored there; None if none was

    >>> from kinetics import Network, simulate
    >>> binding = Network.from_text("A + B <-> AB, 0.01, 0.1")
    >>> found = simulate(binding, "ssa", {"A": 20, "B": 10}, 50.0, runs=400, seed=1, until="AB >= 6")
    >>> found
    <FirstTimes: AB >= 6 first held at 6.728 on average, in 400 of 400 runs>
    >>> print(found.reached_by(5.0))
    0.37 [0.322552, 0.419387] (95 % confidence; ssa; 400 runs)
    """

    network: Network
    condition: str
    times: Floats
    observed: Floats
    counts: Ints
    horizon: float
    method: str = ""
    truncated: Truncation | None = None

    @property
    def runs(self) -> int:
        """Number of runs."""
        return self.times.size

    @property
    def is_reached(self) -> NDArray[np.bool_]:
        """(R,) whether the condition held while the run was observed."""
        return ~np.isnan(self.times)

    @property
    def censored(self) -> int:
        """Number of runs in which the condition did not hold while they were observed."""
        return int(np.isnan(self.times).sum())

    @property
    def _cut_short(self) -> Floats:
        """Until when the runs were observed that were truncated before the horizon."""
        return self.observed[~self.is_reached & (self.observed < self.horizon)]

    @property
    def mean(self) -> float:
        """Mean of the first time, or of the smaller of it and the horizon if runs are censored (restricted mean).

        It is the area under the survival curve; infinite if runs are censored and there is no horizon.
        """
        if not self._cut_short.size:
            return float(self.observed.mean())
        curve = self.survival()
        spans = np.diff(np.append(curve.times, self.horizon))
        is_part = (spans > 0) & (curve.probability > 0)
        return float((spans[is_part] * curve.probability[is_part]).sum())

    def answer(self, what: str | float, level: float = LEVEL) -> Answer:
        """The `mean`, the `probability` that the condition ever holds, or holds by the horizon, or a quantile.

        what : "mean", "probability", or the probability of a quantile, above 0 and below 1
        The interval of the mean is Student's; nan for a single run, for truncated runs and for an infinite mean. The
        interval of a quantile q holds the times at which that of the survival curve holds 1 - q (Brookmeyer & Crowley
        1982, doi:10.2307/2530286); its ends are inf beyond what was observed.
        """
        if what == "probability":
            return self.reached_by(self.horizon, level)
        if what == "mean":
            low = high = np.nan
            if not self._cut_short.size and np.isfinite(self.mean):
                low, high = student_interval(self.observed, level)
            return self._answer(self.mean, max(float(low), 0.0), min(float(high), self.horizon))
        if not (isinstance(what, float) and 0 < what < 1):
            raise ValueError(f"{what!r}; expected 'mean', 'probability', or a probability between 0 and 1")
        curve = self.survival(level)
        times = np.append(curve.times, np.inf)
        return self._answer(*(float(times[(part > 1 - what).sum()]) for part in curve[1:]))

    def reached_by(self, time: float, level: float = LEVEL) -> Answer:
        """Probability that the condition has held by a time, with bounds by Clopper & Pearson (1934).

        ValueError: runs were not observed for so long
        """
        until = min(self.horizon, self._cut_short.min(initial=np.inf))
        if not 0 <= time <= until:
            raise ValueError(f"time = {time:g}; runs were observed from 0 to {in_unit(f'{until:g}', self._unit)}")
        hits = int((self.times <= time).sum())
        return self._answer(hits / self.runs, *map(float, binomial_limits(hits, self.runs, level)))

    def _answer(self, value: float, low: float, high: float) -> Answer:
        return Answer(value, low, high, CONFIDENCE, self.method, why=counted(self.runs, "run"))

    def survival(self, level: float = LEVEL) -> Survival:
        """Survival curve by Kaplan & Meier (1958), doi:10.1080/01621459.1958.10501452, from time 0 on.

        Its interval is that of a binomial share, exact, if all runs are observed to the horizon; else by
        Greenwood's variance on the scale of log(-log), which is approximate.
        """
        moments, events = np.unique(self.times[self.is_reached], return_counts=True)
        at_risk = self.runs - np.searchsorted(np.sort(self.observed), moments, side="left")
        curve = np.append(1.0, np.cumprod(1.0 - events / at_risk))
        times = np.append(0.0, moments)
        if not self._cut_short.size:
            high, low = (1.0 - limit for limit in binomial_limits(np.append(0, np.cumsum(events)), self.runs, level))
            return Survival(times, curve, low, high)

        with np.errstate(divide="ignore", invalid="ignore"):
            variance = np.append(0.0, np.cumsum(events / (at_risk * (at_risk - events))))
            spread = np.exp(special.ndtri((1 + level) / 2) * np.sqrt(variance) / np.log(curve))
            low, high = curve ** (1 / spread), curve**spread
        is_known = (curve > 0) & (curve < 1)
        return Survival(times, curve, np.where(is_known, low, curve), np.where(is_known, high, curve))

    @property
    def median(self) -> float:
        """Median first time; inf if it lies beyond the observation."""
        return self.answer(0.5).value

    @property
    def _unit(self) -> str:
        return self.network.time_unit

    @property
    def _is_restricted(self) -> bool:
        return self.censored > 0 and np.isfinite(self.horizon)

    @property
    def headline(self) -> str:
        """The mean, and in how many of the runs the condition held."""
        reached = self.runs - self.censored
        if not reached:
            end = in_unit(f"{self.observed.max():g}", self._unit)
            return f"{self.condition} held in none of {self.runs} runs until {end}"
        mean = in_unit(figure(self.observed[self.is_reached].mean()), self._unit)
        return f"{self.condition} first held at {mean} on average, in {reached} of {self.runs} runs"

    def summary(self) -> ResultTable:
        """Mean, median and probability with their 95 % intervals."""
        mean, median = (_with_bounds(self.answer(what)) for what in ("mean", 0.5))
        name = f"mean of the time, or {self.horizon:g} where later" if self._is_restricted else "mean"
        values = {name: mean, "median": median}
        if not self._cut_short.size:
            when = f"by {self.horizon:g}" if np.isfinite(self.horizon) else "ever"
            values[f"probability {when}"] = _with_bounds(self.answer("probability"))
        values["runs censored"] = f"{self.censored} of {self.runs}"
        notes = ["95 % intervals" + (f"; times in {self._unit}" if self._unit else "")]
        if self.truncated is not None:
            notes.append(f"{self._cut_short.size} runs were truncated, and are censored there: {self.truncated.cause}")
        return facts(self.headline, values, notes)

    def to_dataframe(self) -> pd.DataFrame:
        """One row a run: its number, until when it was observed, whether the condition held then, and its counts."""
        table = {"run": np.arange(self.runs), "time": self.observed, "is_reached": self.is_reached}
        return dataframe(table | dict(zip(self.network.species, self.counts.T, strict=True)))

    @on_axes
    def plot(self, ax: Any) -> Any:
        """Plot the survival curve with its pointwise 95 % band; returns `ax`."""
        curve = self.survival()
        last = self.horizon if np.isfinite(self.horizon) and self.censored else curve.times[-1]
        ended = Survival(np.append(curve.times, last), *(np.append(part, part[-1]) for part in curve[1:]))
        return plots.survival(ax, *ended, self.condition, self._unit)


def _with_bounds(answer: Answer) -> str:
    return f"{figure(answer.value)} [{figure(answer.low)}, {figure(answer.high)}]"
