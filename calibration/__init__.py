"""From paths to rates, and back to trust: estimates with intervals, diagnostics, cross-validation, reports.

The other names are imported when they are first used.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from calibration.estimate import estimate  # now: left for later, the module would take the function's name
from kinetics.late import late_names

if TYPE_CHECKING:
    from calibration.crossvalidation import CrossValidation, crossvalidate
    from calibration.diagnostics import Diagnosis, Homogeneity, WaitingTimes, diagnose, homogeneity, waiting_times
    from calibration.estimate import Calibration, RateEstimate, exact_limits, paper_estimate
    from calibration.exposure import Exposure, by_age, by_initial, count, pooled
    from calibration.firsttimes import FirstTimes, compare_first_times
    from calibration.report import Chart, Heading, Report, Table, Text

_HOMES = {
    "calibration.crossvalidation": ("CrossValidation", "crossvalidate"),
    "calibration.diagnostics": (
        *("Diagnosis", "Homogeneity", "WaitingTimes"),
        *("diagnose", "homogeneity", "waiting_times"),
    ),
    "calibration.estimate": ("Calibration", "RateEstimate", "exact_limits", "paper_estimate"),
    "calibration.exposure": ("Exposure", "by_age", "by_initial", "count", "pooled"),
    "calibration.firsttimes": ("FirstTimes", "compare_first_times"),
    "calibration.report": ("Chart", "Heading", "Report", "Table", "Text"),
}

__all__ = [
    "Calibration",
    "Chart",
    "CrossValidation",
    "Diagnosis",
    "Exposure",
    "FirstTimes",
    "Heading",
    "Homogeneity",
    "RateEstimate",
    "Report",
    "Table",
    "Text",
    "WaitingTimes",
    "by_age",
    "by_initial",
    "compare_first_times",
    "count",
    "crossvalidate",
    "diagnose",
    "estimate",
    "exact_limits",
    "homogeneity",
    "paper_estimate",
    "pooled",
    "waiting_times",
]

__getattr__ = late_names(__name__, _HOMES)
