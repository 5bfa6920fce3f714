"""Does a rate drift from the first run to the last?"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from calibration.estimating.diagnosing.base import ChannelDiagnostic, Judged
from calibration.estimating.diagnosing.diagnosed_runs import DiagnosedRuns
from calibration.estimating.diagnosing.renewal import waiting_times


@dataclass(frozen=True)
class Drift(ChannelDiagnostic):
    """Kolmogorov-Smirnov test of events that are uniform on the channel's integrated hazard, runs set end to end.

    Given the time of one event, those before it are uniform in a Poisson process (Cox & Lewis 1966). Statistic: the
    largest distance between the two distribution functions; the p-value is at least valid for each number of events,
    whatever ends the runs.

    >>> from calibration import diagnose
    >>> from calibration.estimating.diagnosing import Drift
    >>> from kinetics import JumpPath, Network
    >>> source = Network.from_text("make: 0 -> A, 1")
    >>> path = JumpPath(source, {"A": 0}, range(1, 41), [0] * 40, end=80.0)  # nothing in the second half
    >>> diagnose([path], tests=[Drift()]).worst("drift").p_value < 1e-3
    True
    """

    name = "drift"
    question = "Is a rate the same from the first run to the last, and from the beginning of a run to its end?"
    measured = (
        "size 4.8 % at a level of 5 %; "
        "power .85 against a rate that rises by half from the first run to the last at 650 events"
    )

    def judge(self, diagnosed: DiagnosedRuns, channel: int) -> Judged | str:
        """The test of one channel."""
        waits = waiting_times(diagnosed, channel)
        if reason := waits.untestable(1):
            return reason
        statistic, p_value = waits.drift_test()
        early = float(np.mean(waits.positions < waits.total / 2))
        return Judged(
            statistic,
            p_value,
            f"{early:.0%} of the events in the first half of the exposure",
            "the rate drifts: look for a change in time, and try the weibull model",
            waits.plot_drift,
        )
