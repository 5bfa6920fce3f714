"""From paths to rates, and back to trust: estimates with intervals, diagnostics, cross-validation, reports.

The names are imported when they are first used.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from kinetics.support.lazy_names import lazy_names

if TYPE_CHECKING:
    from calibration.estimating.diagnostics import (
        Diagnosis,
        Homogeneity,
        WaitingTimes,
        diagnose,
        homogeneity,
        waiting_times,
    )
    from calibration.estimating.estimate import Calibration, RateEstimate, estimate, exact_limits, paper_estimate
    from calibration.estimating.exposure import Exposure, by_age, by_initial, count, pooled
    from calibration.reporting.report import Chart, Heading, Report, Table, Text
    from calibration.validating.crossvalidation import CrossValidation, crossvalidate
    from calibration.validating.first_times import FirstTimes, compare_first_times

_HOMES = {
    "calibration.validating.crossvalidation": ("CrossValidation", "crossvalidate"),
    "calibration.estimating.diagnostics": (
        *("Diagnosis", "Homogeneity", "WaitingTimes"),
        *("diagnose", "homogeneity", "waiting_times"),
    ),
    "calibration.estimating.estimate": ("Calibration", "RateEstimate", "estimate", "exact_limits", "paper_estimate"),
    "calibration.estimating.exposure": ("Exposure", "by_age", "by_initial", "count", "pooled"),
    "calibration.validating.first_times": ("FirstTimes", "compare_first_times"),
    "calibration.reporting.report": ("Chart", "Heading", "Report", "Table", "Text"),
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

__getattr__, __dir__ = lazy_names(__name__, __all__, _HOMES)
