"""Events of one channel, or of all, on the clock of their integrated hazard, with the runs set end to end."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from calibration import plots
from calibration.estimating.diagnosing.conditional import spacing_test
from calibration.estimating.diagnosing.diagnosed_runs import DiagnosedRuns
from kinetics.support.arrays import Floats, divided
from kinetics.support.packages import stats
from kinetics.support.shown import on_axes

if TYPE_CHECKING:
    from matplotlib.axes import Axes


@dataclass(frozen=True, eq=False)
class WaitingTimes:
    """Waiting times as positions of events on the clock of their integrated hazard, with the runs set end to end.

    name : the channel, or `any event`
    positions : (n,) integrated hazard at each event, rising
    total : integrated hazard of all runs

    Setting runs end to end joins a censored wait to the first wait of the next run: for exponential waits that is one
    whole wait.

    What ends the watching may be the events themselves: where one uses up its last reactant, nothing is left of the
    clock after it. So events are not uniform on the whole clock given their number, and what follows the last one is
    no wait. The tests judge only the waits up to an event, the first ones of a Poisson process: for each n, the chance
    of n events with a p-value of at most alpha is at most alpha, whatever ends the watching.
    """

    name: str
    positions: Floats
    total: float

    @property
    def residuals(self) -> Floats:
        """Waits (n,) in units of their mean, which are unit exponential if the hazard is right."""
        return np.diff(self.positions, prepend=0.0) * self.positions.size / float(self.positions[-1])

    def untestable(self, fewest: int) -> str:
        """Why there is nothing to test; empty if there are enough events, and hazard before them."""
        n = self.positions.size
        if n < fewest:
            return f"{n} event{'s' * (n > 1)}, fewer than {fewest}" if n else "no events"
        return "" if self.positions[-1] > 0 else "its events fell into stretches without duration"

    def drift_test(self) -> tuple[float, float]:
        """Kolmogorov-Smirnov distance of the events from uniform, and its p-value; one event or more.

        The larger of two one-sided distances, of which each p-value is exact or too large, counts twice. Events come
        too late: given the last, those before it are uniform up to it. Too early: on the clock up to one event more,
        all n are; the clock ends before that event, which makes them look later than they are.
        """
        early = stats.kstest(self.positions / self.total, "uniform", alternative="greater")
        if self.positions.size == 1:
            return float(early.statistic), min(2 * float(early.pvalue), 1.0)
        late = stats.kstest(self.positions[:-1] / self.positions[-1], "uniform", alternative="less")
        least = min(early, late, key=lambda side: side.pvalue)
        return float(least.statistic), min(2 * float(least.pvalue), 1.0)

    def shape_test(self, rng: np.random.Generator) -> tuple[float, float]:
        """Anderson-Darling statistic of the waits against an exponential of unknown mean, and its p-value.

        Exponentials divided by their sum are the gaps between uniform points: the p-value is by weighted draws of such
        gaps, valid for any n from two on. A wait of 0 (two events in one mechanics step) counts as a very small one.
        """
        return spacing_test(np.diff(self.positions, prepend=0.0), rng)

    @on_axes
    def plot(self, ax: Axes) -> Axes:
        """Plot the survival of the residuals beside the unit exponential with its 95 % envelope; returns `ax`."""
        return plots.waiting_times(ax, self.name, self.residuals)

    def plot_drift(self, ax: Axes) -> Axes:
        """Plot the share of events against the share of integrated hazard; returns `ax`."""
        return plots.drift(ax, self.name, self.positions / self.total)


def waiting_times(diagnosed: DiagnosedRuns, channel: int | None = None) -> WaitingTimes:
    """The waiting times of one channel, or of any event.

    The clock of any event is the sum of all hazards, each with as many events expected as were seen.
    """
    scale = divided(diagnosed.events, diagnosed.exposure)
    positions, total = [], 0.0
    for clocked in diagnosed.clocked:
        passed = clocked.passed @ scale if channel is None else clocked.passed[:, channel]
        clock = total + np.cumsum(passed)
        fired = clocked.fired
        if channel is not None:
            fired = np.flatnonzero(clocked.path.channels == channel)
        positions.append(clock[fired])
        total = float(clock[-1])
    name = "any event" if channel is None else diagnosed.network.channels[channel]
    return WaitingTimes(name, np.concatenate(positions), total)
