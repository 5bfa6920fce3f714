"""The report of parameters that were fitted to data of others."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import Any

from calibration.estimating.predictive_bands import PredictiveBand, predictive_bands
from calibration.estimating.residual_power import PowerOfResiduals, power_of_residuals
from calibration.estimating.residuals import Residuals, quantile_residuals
from calibration.observed.fitted_study import FittedStudy, said_of
from calibration.reporting.report import Chart, Fold, HtmlReport, Part, ReportTable, Text

ABOUT_INTERVALS = """
An estimate is the value of largest likelihood. An interval ends where the largest log-likelihood with that parameter
held has fallen by 1.92 (profile likelihood, 95 %).
"""
ABOUT_RESIDUALS = """
A residual is the place of what was seen in the distribution that the model predicts from all looks before, between 0
and 1. If the model holds, residuals are uniform and independent. The p-values are those of their distribution
(Kolmogorov and Smirnov), mean, spread, and of the correlation of neighbours in a run. Parameters were fitted to the
same data, so the tests reject a little less often than their level.
"""
ABOUT_BANDS = """
Bands hold the middle 95 % of whole runs that are simulated from the start, at parameters drawn from the posterior. Of
many runs that start alike and were looked at together the mean is drawn.
"""


def fitted_report(study: FittedStudy, seed: int = 0) -> HtmlReport:
    """Verdict, estimates and the data beside the model on the first screen; the rest folded.

    seed : of the residuals' ties and of the simulated runs
    """
    found = study.found
    residuals = quantile_residuals(found.likelihood, found.point, seed=seed)
    bands = predictive_bands(found, study.draws, seed)
    per = found.model.network.time_unit
    told = (f"{text[0].upper()}{text[1:]}." for text in (said_of(found.likelihood), *study.notes))
    parts: list[Part] = [
        Text(" ".join([residuals.verdict, *told])),
        ReportTable(
            f"Estimates and 95 % intervals{per and f'; rates are per {per}'}.", _estimates(study), "parameters"
        ),
        _picture(study, bands, residuals),
        Fold(
            "How the parameters were estimated",
            [Text(ABOUT_INTERVALS), Text(f"Log-likelihood {found.log_likelihood}.")],
        ),
        _residual_fold(residuals, power_of_residuals(found.likelihood, found.point, seed=seed)),
        Fold("Whole runs against the model", [Text(ABOUT_BANDS)]),
    ]
    if study.compared:
        rows = [{"model": each.name, **{k: v for k, v in vars(each).items() if k != "name"}} for each in study.compared]
        parts.insert(3, ReportTable("Models of the same data.", rows, "models"))
    return HtmlReport(f"Parameters of {Path(study.source).name}", parts, study.evidence | {"seed": seed})


def _picture(study: FittedStudy, bands: Sequence[PredictiveBand], residuals: Residuals) -> Chart:
    """What was seen in its bands; if there are none, the residuals."""
    if not bands:
        return Chart("Residuals of each column in order of size, against uniform ones.", residuals.plot, name="seen")
    inside, n = (sum(counts) for counts in zip(*(band.inside for band in bands), strict=True))
    what = "the mean of as many runs" if any(band.of_means for band in bands) else "runs"
    draws = "the estimates" if study.draws is None else f"{len(study.draws.draws)} draws ({study.draws.how})"
    caption = f"What was seen (dots), and the middle 95 % of {what} simulated at {draws}: {inside} of {n} dots inside."
    return Chart(caption, partial(_draw_all, bands), panels=len(bands), name="seen")


def _estimates(study: FittedStudy) -> list[dict[str, Any]]:
    """One row a parameter."""
    fit = study.found.fit
    rows = [
        {
            "parameter": name,
            "estimate": f"{fit.value[p]:.4g}",
            "95 % from": f"{fit.low[p]:.4g}",
            "95 % to": f"{fit.high[p]:.4g}",
        }
        for p, name in enumerate(fit.names)
    ]
    held = [
        {"parameter": name, "estimate": f"{value:.4g} (fixed)", "95 % from": "", "95 % to": ""}
        for name, value in study.found.fixed.items()
    ]
    return [*rows, *held]


def _residual_fold(residuals: Residuals, power: Sequence[PowerOfResiduals]) -> Fold:
    """The tests of the residuals, their size and power, and their picture."""
    rows = [test._asdict() for test in residuals.tests()]
    parts: list[Part] = [Text(ABOUT_RESIDUALS)]
    if power:
        told = "; ".join(map(str, power))
        parts.append(
            Text(f"Of {power[0].repeats} simulated sets of data with the same runs and looks, at 5 %: {told}.")
        )
    if rows:
        parts.append(ReportTable("P-values, one row for each column.", rows, "residual-tests"))
        parts.append(Chart("Residuals in order of size.", residuals.plot, rows=residuals.rows(), name="residuals"))
    return Fold("Is the model right? Residuals", parts)


def _draw_all(bands: Any, axes: Any) -> None:
    """One panel a band."""
    for band, ax in zip(bands, [axes] if len(bands) == 1 else axes, strict=True):
        band.plot(ax)
