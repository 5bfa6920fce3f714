"""The HTML reports of calibration and validation: their tables and figures in order, with the text between them."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import TYPE_CHECKING, Any

from calibration.reporting.report import Chart, Heading, HtmlReport, Part, ReportTable, Text
from kinetics.rates import Rates

if TYPE_CHECKING:
    from calibration.estimating.diagnosing.diagnosis import Diagnosis
    from calibration.pipeline.study import CalibrationStudy, ValidationStudy

ABOUT_RATES = """
Propensity = rate x ways x combinations of reactants. A rate is pooled events over pooled exposure; its limits are the
exact 95 % limits of a Poisson count (Garwood 1936), also where nothing was seen. Runs were put back to their start
after every event; breaks, being rare, were watched in tanks without bonding.
"""
ABOUT_DIAGNOSTICS = """
Each test asks whether one thing that a well-mixed Markov chain assumes is true of the runs, channel by channel; a dash
means that the runs cannot result. Every test conditions on the number of events of a channel, so that only the shape of
its hazard is judged. Doubtful is what fails at 1 % for all tests together (Holm 1979).
"""
ABOUT_VALIDATION = """
Held-out mechanics runs from single cubes, which the rates never saw. The predicted band is that of the mean of as many
runs, intrinsic noise and rate uncertainty together; the other band is a Student interval of the runs' mean. CRPS is the
mean distance of a run from the predicted distribution, in copies, beside what the model scores against runs of its own.
"""

Draw = Callable[[Any], Any]


def calibration_report(study: CalibrationStudy) -> HtmlReport:
    """What the calibration runs showed."""
    return HtmlReport(f"Rates of {study.scene.name}", _calibration_parts(study), study.rates.evidence)


def validation_report(study: ValidationStudy) -> HtmlReport:
    """How predictions stand against held-out runs."""
    return HtmlReport("Held-out runs", _validation_parts(study), study.rates.evidence)


def full_report(calibrated: CalibrationStudy, validated: ValidationStudy, tank: Draw | None = None) -> HtmlReport:
    """The whole loop; `tank` draws a picture of the mechanics onto axes."""
    parts: list[Part] = []
    if tank is not None:
        parts.append(Chart("The tank at the end of a held-out run, structures coloured by size.", tank, name="tank"))
    parts += [*_calibration_parts(calibrated), *_validation_parts(validated)]
    return HtmlReport(f"{calibrated.scene.name}: from mechanics to prediction", parts, calibrated.rates.evidence)


def _calibration_parts(study: CalibrationStudy) -> list[Part]:
    rows = [row | {"paper's estimator": study.paper_rates[row["channel"]]} for row in study.calibration.table()]
    table3 = Rates.load("table3")
    is_papers_line = set(table3.channels) == set(study.calibration.network.channels)
    references = {"paper, Table III": table3} if is_papers_line else None
    return [
        Heading("Rates"),
        Text(
            f"{len(study.sound)} mechanics runs with {study.settings['cubes']} cubes, "
            f"{study.cpu_seconds:.0f} s of CPU time. {ABOUT_RATES}"
        ),
        ReportTable("Rate constants (1/tu), per way and combination.", rows, "rates"),
        Chart(
            "Rates per combination of reactants.", partial(study.calibration.plot, references=references), name="forest"
        ),
        *diagnosis_parts(study.diagnosis),
    ]


def diagnosis_parts(diagnosis: Diagnosis, name: str = "diagnostics") -> list[Part]:
    """The diagnostics of a set of runs: verdicts in words, all p-values, and of each test its most doubtful figure.

    name : of the tables and charts; two sets of runs in one report need two
    """
    parts: list[Part] = [
        Heading("Do the runs behave like a well-mixed Markov chain?"),
        Text(f"{ABOUT_DIAGNOSTICS} {diagnosis.verdict}"),
        ReportTable("Verdicts, a row a test, with the size and power that each was measured to have.",
                    diagnosis.verdicts(), f"{name}-verdicts"),
        ReportTable("P-values, a row a channel.", diagnosis.p_values(), f"{name}-p"),
        Chart("All p-values beside those of as many tests of a true model.", diagnosis.plot,
              rows=diagnosis.table(), name=name),
    ]  # fmt: skip
    for test in diagnosis.tests:
        worst = diagnosis.worst(test.name)
        if worst is not None:
            caption = f"{test.question} Least likely, {worst.title}: {worst.seen}; p = {worst.p_value:.2g}."
            parts.append(Chart(caption, worst.plot, name=f"{name}-{test.name}"))
    return parts


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


def _one_column_each(rows: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """Rows as columns, named by their labels: many figures of few experiments are read downwards."""
    return [{"": key} | {str(row["label"]): row[key] for row in rows} for key in rows[0] if key != "label"]
