"""Events of one channel, or of all, on the clock of their integrated hazard, with the runs set end to end."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from calibration.estimating.diagnosing.conditional import spacing_test
from calibration.estimating.diagnosing.diagnosed_runs import DiagnosedRuns
from kinetics.support.arrays import Floats

if TYPE_CHECKING:
    from matplotlib.axes import Axes


@dataclass(frozen=True, eq=False)
class WaitingTimes:
    """Waiting times as positions of events on the clock of their integrated hazard, with the runs set end to end.

    name : the channel, or `any event`
    positions : (n,) integrated hazard at each event, rising
    total : integrated hazard of all runs

    Setting runs end to end joins a censored wait to the first wait of the next run: for exponential waits that is one
    whole wait, so no data are lost.
    """

    name: str
    positions: Floats
    total: float

    @property
    def residuals(self) -> Floats:
        """Waits (n,) in units of their estimated mean, which are unit exponential if the hazard is right."""
        return np.diff(self.positions, prepend=0.0) * self.positions.size / self.total

    def drift_test(self) -> tuple[float, float]:
        """Kolmogorov-Smirnov distance of the positions from uniform, and its p-value (exact); one event or more."""
        from scipy.stats import kstest

        result = kstest(self.positions / self.total, "uniform")
        return float(result.statistic), float(result.pvalue)

    def shape_test(self, rng: np.random.Generator) -> tuple[float, float]:
        """Anderson-Darling statistic of the waits against an exponential of unknown mean, and its p-value.

        The n + 1 gaps between n uniform points are exponentials divided by their sum, so the test with an unknown mean
        is that of the gaps, the last one included; its p-value is by weighted draws of such gaps, valid for any n. A
        gap of 0 (two events in one mechanics step) counts as a very small one.
        """
        return spacing_test(np.diff(self.positions, prepend=0.0, append=self.total), rng)

    def plot(self, ax: Axes) -> Axes:
        """Plot the survival of the residuals beside the unit exponential with its 95 % envelope; returns `ax`."""
        from calibration import plots

        return plots.waiting_times(ax, self.name, self.residuals)

    def plot_drift(self, ax: Axes) -> Axes:
        """Plot the share of events against the share of integrated hazard; returns `ax`."""
        from calibration import plots

        return plots.drift(ax, self.name, self.positions / self.total)


def waiting_times(diagnosed: DiagnosedRuns, channel: int | None = None) -> WaitingTimes:
    """The waiting times of one channel, or of any event.

    The clock of any event is the sum of all hazards, each with as many events expected as were seen.
    """
    scale = np.divide(
        diagnosed.events, diagnosed.exposure, out=np.zeros(diagnosed.exposure.size), where=diagnosed.exposure > 0
    )
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
