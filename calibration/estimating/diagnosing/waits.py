"""Are waits exponential? The test that time-rescaled waits are."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from calibration.estimating.diagnosing.base import Diagnostic, DiagnosticResult
from calibration.estimating.diagnosing.diagnosed_runs import DiagnosedRuns
from calibration.estimating.diagnosing.rebinding import Rebinding
from calibration.estimating.diagnosing.renewal import waiting_times

FEWEST = 5  # waits; below, the test sees nothing


@dataclass(frozen=True)
class Waits(Diagnostic):
    """Anderson-Darling test of the waits between events of a channel, and of any event, rescaled by their hazard.

    By the time-rescaling theorem integrated hazards between events are unit exponential (Brown et al. 2002,
    doi:10.1162/08997660252741149). Statistic: A squared (Anderson & Darling 1954); the p-value is at least valid for
    any number of waits.

    >>> from calibration import diagnose
    >>> from calibration.estimating.diagnosing import Waits
    >>> from kinetics import JumpPath, Network
    >>> source = Network.from_text("make: 0 -> A, 1")
    >>> path = JumpPath(source, {"A": 0}, range(1, 41), [0] * 40, end=40.0)  # all waits are alike
    >>> diagnose([path], tests=[Waits()]).worst("waits").p_value < 1e-3
    True
    """

    name = "waits"
    question = "Are waits, rescaled by the hazard, exponential?"
    measured = "size 5.7 % at a level of 5 %; power .99 against waits of Weibull shape 0.8 at 300 events"

    def results(self, diagnosed: DiagnosedRuns) -> list[DiagnosticResult]:
        """One result a channel, and one of any event."""
        places = [*range(len(diagnosed.network.channels)), None]
        return [self._result(diagnosed, place) for place in places]

    def _result(self, diagnosed: DiagnosedRuns, channel: int | None) -> DiagnosticResult:
        waits = waiting_times(diagnosed, channel)
        n = waits.positions.size
        if reason := waits.untestable(FEWEST):
            return DiagnosticResult(self.name, waits.name, n, reason=reason)
        statistic, p_value = waits.shape_test(diagnosed.random(self.name, waits.name))
        spread = float(np.std(waits.residuals) / np.mean(waits.residuals))
        remedy = "long and short waits alternate: try the weibull model"
        if Rebinding().applies(diagnosed.network):
            remedy += ", or net break rates where pieces rebind"
        if spread < 1:
            remedy = "waits are too regular, as after a dead time: try the weibull model"
        return DiagnosticResult(
            self.name, waits.name, n, statistic, p_value,
            seen=f"waits spread {spread:.2f} times as much as exponential ones",
            remedy=remedy, draw=waits.plot,
        )  # fmt: skip
