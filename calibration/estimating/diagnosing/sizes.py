"""Does a rate depend on the size N of the system?"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from calibration.estimating.diagnosing.diagnosed_runs import DiagnosedRuns
from calibration.estimating.diagnosing.groups import TrendDiagnostic
from kinetics.support.arrays import Floats


@dataclass(frozen=True)
class Sizes(TrendDiagnostic):
    """Trend of a rate with the number of cubes in the tank: the conserved quantity of the network, or all copies.

    >>> from calibration import diagnose
    >>> from calibration.estimating.diagnosing import Sizes
    >>> from kinetics import JumpPath, Network
    >>> swaps = Network.from_text("swap: A -> B, 1")
    >>> paths = [JumpPath(swaps, {"A": n}, [0.01 * n] * n, [0] * n, end=0.01 * n) for n in (10, 20, 40)]  # slower
    >>> diagnose(paths, tests=[Sizes()]).worst("size").p_value < 1e-3
    True
    """

    name = "size"
    question = "Is a rate the same in small and large systems?"
    single = "all runs that could fire it hold {value}"
    measured = "size 4.1 % at a level of 5 %; power .96 for a rate in proportion to sizes 60, 80 and 120 at 150 events"

    def values(self, diagnosed: DiagnosedRuns) -> list[Floats]:
        """The size of the system at the start of each run, which it keeps."""
        return [np.full(c.path.times.size + 1, diagnosed.amount(c.path.initial[None])[0]) for c in diagnosed.clocked]

    def unit(self, diagnosed: DiagnosedRuns) -> str:
        """The unit of the conserved quantity."""
        return diagnosed.matter

    def remedy(self, diagnosed: DiagnosedRuns, channel: int) -> str:
        """Breaks by collision, or calibration at each density."""
        if diagnosed.breaks[channel]:
            return "breaks depend on the density: try `calibrate --break-model collision`"
        return "the rate depends on the density: try the crowded model, or calibrate at each size"
