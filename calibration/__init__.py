"""Calibration: rates with intervals from jump paths, models of rates, diagnostics, validation and reports.

The names are imported when they are first used.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from kinetics.support.lazy_names import lazy_names

if TYPE_CHECKING:
    from calibration.estimating.break_comparison import BreakComparison
    from calibration.estimating.break_fit import fit_breaks
    from calibration.estimating.diagnosing import DIAGNOSTICS
    from calibration.estimating.diagnosing.base import Diagnostic, DiagnosticResult
    from calibration.estimating.diagnosing.diagnosis import Diagnosis, diagnose
    from calibration.estimating.estimate import Calibration, RateEstimate, estimate
    from calibration.estimating.exposure import Exposure, count, pooled
    from calibration.estimating.models import RATE_MODELS, Crowded, MassActionRates, Weibull
    from calibration.estimating.net_path import net_path
    from calibration.estimating.rate_fit import LikelihoodRatio, RateFit, compare_fits, fit_rates
    from calibration.estimating.rate_model import RateModel
    from calibration.reporting.report import Chart, Heading, HtmlReport, ReportTable, Text
    from calibration.validating.comparison import CrossValidation
    from calibration.validating.crossvalidation import crossvalidate
    from calibration.validating.first_times import FirstTimeComparison, compare_first_times
    from kinetics.rates.breaks import ShapeParameter
    from kinetics.support.intervals import exact_limits

__project__ = "wellmixed"  # by which the command knows that this is ours

_HOMES = {
    "calibration.estimating.break_comparison": ("BreakComparison",),
    "calibration.estimating.break_fit": ("fit_breaks",),
    "calibration.estimating.diagnosing": ("DIAGNOSTICS",),
    "calibration.estimating.diagnosing.base": ("Diagnostic", "DiagnosticResult"),
    "calibration.estimating.diagnosing.diagnosis": ("Diagnosis", "diagnose"),
    "calibration.estimating.estimate": ("Calibration", "RateEstimate", "estimate"),
    "calibration.estimating.exposure": ("Exposure", "count", "pooled"),
    "calibration.estimating.models": ("RATE_MODELS", "Crowded", "MassActionRates", "Weibull"),
    "calibration.estimating.net_path": ("net_path",),
    "calibration.estimating.rate_fit": ("LikelihoodRatio", "RateFit", "compare_fits", "fit_rates"),
    "calibration.estimating.rate_model": ("RateModel",),
    "kinetics.rates.breaks": ("ShapeParameter",),
    "calibration.reporting.report": ("Chart", "Heading", "HtmlReport", "ReportTable", "Text"),
    "calibration.validating.comparison": ("CrossValidation",),
    "calibration.validating.crossvalidation": ("crossvalidate",),
    "calibration.validating.first_times": ("FirstTimeComparison", "compare_first_times"),
    "kinetics.support.intervals": ("exact_limits",),
}

__all__ = [
    "DIAGNOSTICS",
    "RATE_MODELS",
    "BreakComparison",
    "Calibration",
    "Chart",
    "CrossValidation",
    "Crowded",
    "Diagnosis",
    "Diagnostic",
    "DiagnosticResult",
    "Exposure",
    "FirstTimeComparison",
    "Heading",
    "HtmlReport",
    "LikelihoodRatio",
    "MassActionRates",
    "RateEstimate",
    "RateFit",
    "RateModel",
    "ReportTable",
    "ShapeParameter",
    "Text",
    "Weibull",
    "compare_first_times",
    "compare_fits",
    "count",
    "crossvalidate",
    "diagnose",
    "estimate",
    "exact_limits",
    "fit_breaks",
    "fit_rates",
    "net_path",
    "pooled",
]

__getattr__, __dir__ = lazy_names(__name__, __all__, _HOMES)
