"""Does a rate depend on how many bodies share the tank?"""

from __future__ import annotations

from dataclasses import dataclass

from calibration.estimating.diagnosing.diagnosed_runs import DiagnosedRuns
from calibration.estimating.diagnosing.groups import TrendDiagnostic
from kinetics.support.arrays import Floats


@dataclass(frozen=True)
class Crowds(TrendDiagnostic):
    """Trend of a rate with the number of bodies in the tank at the time, which falls as a tank assembles.

    >>> from calibration import diagnose
    >>> from calibration.estimating.diagnosing import Crowds
    >>> from kinetics import JumpPath, Network
    >>> source = Network.from_text("make: 0 -> A, 1")
    >>> path = JumpPath(source, {"A": 0}, range(1, 21), [0] * 20, end=60.0)  # nothing among 20 bodies
    >>> diagnose([path], tests=[Crowds()]).worst("crowd").p_value < 1e-3
    True
    """

    name = "crowd"
    question = "Is a rate the same among many bodies as among few?"
    single = "there were {value} whenever it could fire"
    measured = (
        "size 4.6 % at a level of 5 %; "
        "power .98 for a rate half as large again among 40 bodies as among 20, at 400 events"
    )

    def values(self, diagnosed: DiagnosedRuns) -> list[Floats]:
        """Bodies of all species in every state."""
        return [c.path.states.sum(axis=1).astype(float) for c in diagnosed.clocked]

    def unit(self, diagnosed: DiagnosedRuns) -> str:  # noqa: ARG002
        """Bodies, of whatever species."""
        return "bodies"

    def remedy(self, diagnosed: DiagnosedRuns, channel: int) -> str:
        """Breaks by collision, or a crowded model."""
        if diagnosed.breaks[channel]:
            return "breaks depend on the number of others: try `calibrate --break-model collision`"
        return "the rate depends on the number of others: try the crowded model"
