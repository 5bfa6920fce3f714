"""Calibration: rates with intervals from jump paths, models of rates, diagnostics, validation and reports.

The names are imported when they are first used.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from kinetics.support.lazy_names import lazy_names

if TYPE_CHECKING:
    from calibration.estimating.break_comparison import BreakComparison as BreakComparison
    from calibration.estimating.break_fit import fit_breaks as fit_breaks
    from calibration.estimating.diagnosing import DIAGNOSTICS as DIAGNOSTICS
    from calibration.estimating.diagnosing.base import Diagnostic as Diagnostic
    from calibration.estimating.diagnosing.base import DiagnosticResult as DiagnosticResult
    from calibration.estimating.diagnosing.diagnosis import Diagnosis as Diagnosis
    from calibration.estimating.diagnosing.diagnosis import diagnose as diagnose
    from calibration.estimating.estimate import Calibration as Calibration
    from calibration.estimating.estimate import RateEstimate as RateEstimate
    from calibration.estimating.estimate import estimate as estimate
    from calibration.estimating.exposure import Exposure as Exposure
    from calibration.estimating.exposure import count as count
    from calibration.estimating.exposure import pooled as pooled
    from calibration.estimating.model_fit import ModelFit as ModelFit
    from calibration.estimating.model_fit import compare_models as compare_models
    from calibration.estimating.model_fit import fit_model as fit_model
    from calibration.estimating.models import RATE_MODELS as RATE_MODELS
    from calibration.estimating.models import Crowded as Crowded
    from calibration.estimating.models import MassActionRates as MassActionRates
    from calibration.estimating.models import Weibull as Weibull
    from calibration.estimating.net_path import net_path as net_path
    from calibration.estimating.posterior_sampling import sample_posterior as sample_posterior
    from calibration.estimating.priors import LogNormalPrior as LogNormalPrior
    from calibration.estimating.rate_fit import LikelihoodRatio as LikelihoodRatio
    from calibration.estimating.rate_fit import RateFit as RateFit
    from calibration.estimating.rate_fit import compare_fits as compare_fits
    from calibration.estimating.rate_fit import fit_rates as fit_rates
    from calibration.estimating.rate_model import RateModel as RateModel
    from calibration.estimating.residuals import Residuals as Residuals
    from calibration.estimating.residuals import quantile_residuals as quantile_residuals
    from calibration.observed.kinds.counts import Counts as Counts
    from calibration.observed.kinds.events import Events as Events
    from calibration.observed.kinds.snapshots import Snapshots as Snapshots
    from calibration.reporting.report import Chart as Chart
    from calibration.reporting.report import Fold as Fold
    from calibration.reporting.report import Heading as Heading
    from calibration.reporting.report import HtmlReport as HtmlReport
    from calibration.reporting.report import ReportTable as ReportTable
    from calibration.reporting.report import Text as Text
    from calibration.validating.comparison import CrossValidation as CrossValidation
    from calibration.validating.crossvalidation import crossvalidate as crossvalidate
    from calibration.validating.first_times import FirstTimeComparison as FirstTimeComparison
    from calibration.validating.first_times import compare_first_times as compare_first_times
    from kinetics.rates.breaks import ShapeParameter as ShapeParameter
    from kinetics.support.intervals import exact_limits as exact_limits

__project__ = "wellmixed"  # by which the command knows that this is ours

__getattr__, __dir__ = lazy_names(__name__)
