"""The HTML reports of calibration and validation: their tables and figures in order, with the text between them."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import partial
from typing import TYPE_CHECKING, Any

from calibration.reporting.report import Chart, Heading, HtmlReport, Part, ReportTable, Text
from kinetics.rates import Rates

if TYPE_CHECKING:
    from calibration.estimating.break_fit import BreakComparison
    from calibration.pipeline.study import CalibrationStudy, ValidationStudy
    from calibration.watched.study import WatchedStudy

ABOUT_RATES = """
Propensity = rate x ways x combinations of reactants. A rate is pooled events over pooled exposure; its limits are the
exact 95 % limits of a Poisson count (Garwood 1936), also where nothing was seen.
"""
ABOUT_DIAGNOSTICS = """
Dispersion is the variance of a channel's counts between runs over that of a Poisson count: 1 on average. The p-values
test for equal rates in all runs, at all ages of a run and from all initial states, for waits without drift, and for
exponential waits.
"""
ABOUT_BREAKS = """
The AIC counts parameters against likelihood: the smaller is the better. The log score is that of breaks in runs that
were left out of the fit; the larger is the better. The deviance compares the breaks of runs alike with those expected.
"""
ABOUT_VALIDATION = """
Held-out mechanics runs from single cubes, which the rates never saw. The predicted band is that of the mean of as many
runs, intrinsic noise and rate uncertainty together; the other band is a Student interval of the runs' mean. CRPS is the
mean distance of a run from the predicted distribution, in copies, beside what the model scores against runs of its own.
"""

Draw = Callable[[Any], Any]


def calibration_report(study: CalibrationStudy | WatchedStudy) -> HtmlReport:
    """What the calibration runs showed."""
    return HtmlReport(f"Rates of {study.name}", _calibration_parts(study), study.rates.evidence)


def validation_report(study: ValidationStudy) -> HtmlReport:
    """How predictions stand against held-out runs."""
    return HtmlReport("Held-out runs", _validation_parts(study), study.rates.evidence)


def full_report(calibrated: CalibrationStudy, validated: ValidationStudy, tank: Draw | None = None) -> HtmlReport:
    """The whole loop; `tank` draws a picture of the mechanics onto axes."""
    parts: list[Part] = []
    if tank is not None:
        parts.append(Chart("The tank at the end of a held-out run, structures coloured by size.", tank, name="tank"))
    parts += [*_calibration_parts(calibrated), *_validation_parts(validated)]
    return HtmlReport(f"{calibrated.name}: from mechanics to prediction", parts, calibrated.rates.evidence)


def _calibration_parts(study: CalibrationStudy | WatchedStudy) -> list[Part]:
    rows = [row | {"paper's estimator": study.paper_rates[row["channel"]]} for row in study.calibration.table()]
    table3 = Rates.load("table3")
    is_papers_line = set(table3.channels) == set(study.calibration.network.channels)
    references = {"paper, Table III": table3} if is_papers_line else None
    doubtful = ", ".join(study.diagnosis.doubtful)
    verdict = f"Doubtful at 1 %, corrected for their number: {doubtful}." if doubtful else "None fails at 1 %."
    breaks = [] if study.break_models is None else _break_parts(study.break_models)
    return [
        Heading("Rates"),
        Text(f"{study.source}. {study.made} {ABOUT_RATES}"),
        ReportTable("Rate constants (1/tu), per way and combination.", rows, "rates"),
        Chart(
            "Rates per combination of reactants.", partial(study.calibration.plot, references=references), name="forest"
        ),
        *breaks,
        Heading("Do the runs behave like a Markov chain?"),
        Text(f"{ABOUT_DIAGNOSTICS} {verdict}"),
        ReportTable("Diagnostics, a row a channel.", _testable(study.diagnosis.table()), "diagnostics"),
        Chart(
            "Waits of any event, rescaled by the hazard: unit exponential if the model holds.",
            study.diagnosis.waits[-1].plot,
            name="waits",
        ),
    ]


def _break_parts(compared: BreakComparison) -> list[Part]:
    """Break models side by side; the shape in words, its intervals at 95 %."""
    from calibration.estimating.break_fit import shape_in_words

    rows = [row | {"shape": shape_in_words(row["shape"])} for row in compared.table()]
    return [
        Heading("Who breaks a bond"),
        Text(f"{ABOUT_BREAKS} {compared.reason}."),
        ReportTable("Break models, fitted to the same runs.", rows, "breaks"),
    ]


def _validation_parts(study: ValidationStudy) -> list[Part]:
    species = study.comparisons[0].network.species[1:]
    parts: list[Part] = [
        Heading("Predicted against simulated"),
        Text(ABOUT_VALIDATION),
        ReportTable(
            "One column a size. Times in tu, cost in CPU seconds.", _one_column_each(study.summary()), "summary"
        ),
    ]
    for comparison in study.comparisons:
        draw = partial(comparison.plot, species=species)
        name = comparison.label.replace(" ", "-")
        caption = f"{comparison.label}: mean copies over time."
        parts.append(Chart(caption, draw, panels=len(species), rows=comparison.table(), name=name))
        if comparison.first is not None:
            first = comparison.first
            parts.append(Chart(f"{comparison.label}: first {first.species}.", first.plot, name=f"{name}-first"))
    return parts


def _testable(rows: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """Rows with words in the place of figures that do not exist."""
    return [
        {key: "not testable" if isinstance(value, float) and math.isnan(value) else value for key, value in row.items()}
        for row in rows
    ]


def _one_column_each(rows: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """Rows as columns, named by their labels: many figures of few experiments are read downwards."""
    return [{"": key} | {str(row["label"]): row[key] for row in rows} for key in rows[0] if key != "label"]
