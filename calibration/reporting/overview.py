"""The HTML reports of calibration and validation: their tables and figures in order, with the text between them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from typing import TYPE_CHECKING, Any

from calibration import plots
from calibration.estimating.break_comparison import shape_in_words
from calibration.pipeline.bars import WORDS, Bar, in_one_sentence
from calibration.reporting.report import Chart, Heading, HtmlReport, Part, ReportTable, Text
from calibration.reporting.words import in_words
from kinetics.rates import Rates, about_priors
from kinetics.support.tables import inverse, of_unit

if TYPE_CHECKING:
    from calibration.estimating.break_comparison import BreakComparison
    from calibration.estimating.crowding_comparison import CrowdingComparison
    from calibration.estimating.diagnosing.diagnosis import Diagnosis
    from calibration.estimating.estimate import Calibration
    from calibration.estimating.study import CalibrationStudy
    from calibration.pipeline.held_out_study import ValidationStudy
    from calibration.validating.comparison import CrossValidation
    from calibration.validating.events import EventRow

NOTABLE = 0.05  # events: a channel with fewer at every size is left out of the figure of events
ABOUT_RATES = """
Propensity = rate x multiplicity x combinations of reactants. A rate is pooled events over pooled exposure; its interval
is the exact 95 % interval of a Poisson count (Garwood 1936), even without events.
"""
ABOUT_DIAGNOSTICS = """
Each test checks one assumption of a well-mixed Markov chain against the runs, channel by channel; a dash means that the
runs cannot decide. Every test conditions on the number of events of a channel, so it judges only the shape of the
hazard. An assumption is doubtful if its test fails at 1 % for all tests together (Holm 1979).
"""
ABOUT_BREAKS = """
The AIC weighs likelihood against the number of parameters: smaller is better. The log score is that of breaks in runs
left out of the fit: larger is better. The deviance compares observed and expected breaks for each kind of run. If the
runs record the partner of each break, and the breaks call for a model with partners, the recorded partners choose among
the models that can explain them: only a model with walls can explain a break by a wall. The shape parameters then come
from the recorded partners, too.
"""
ABOUT_CROWDING = """
Hits on structures, most of them too weak to break a bond, and joins are counted per exposure in each kind of tank.
Under the right model all tanks have one rate: chi-square over the scatter between runs of one tank is then about its
degrees of freedom. AIC: smaller is better, within one source and load.
"""
ABOUT_VALIDATION = """
Held-out mechanics runs from single cubes, which the rates never saw. The predicted band is that of the mean of as many
runs, intrinsic noise and rate uncertainty together; the other band is a Student interval of the runs' mean. CRPS is the
mean distance of a run from the predicted distribution, in copies; the model's score against its own runs is given for
comparison. Coverage is the share of points inside a band; low and high are the middle 95 % of the coverage of simulated
runs.
"""
ABOUT_EVENTS = """
Expected events are rate times exposure: what the rates predict in the states that the runs visited. The p-values are
the ranks of seen over expected among simulated groups of as many runs, each under its own draw of the rates; so they
are exact and include the uncertainty of the rates. Scatter is the dispersion of events between runs, about 1 under the
model.
"""
ABOUT_RULES = """
They were stated before the runs, and each is judged by itself. A rule cannot be judged where the predicted 95 %
interval is wider than the rule.
"""
ABOUT_SINGLE_RUNS = """
For each run, where its joins and breaks (over those expected) and its final counts lie in their predicted distribution
(PIT, the probability integral transform): uniform from 0 to 1 if the model holds. Their distance from uniformity is
judged against simulated groups of as many runs.
"""

Draw = Callable[[Any], Any]


def calibration_report(study: CalibrationStudy) -> HtmlReport:
    """The report of the calibration runs."""
    return HtmlReport(f"Rates of {study.name}", _calibration_parts(study), study.rates.evidence)


def validation_report(study: ValidationStudy, rules: Sequence[Bar] = ()) -> HtmlReport:
    """The report of predictions against held-out runs; `rules` : the bars of a plan, with results."""
    return HtmlReport("Held-out runs", _rule_parts(rules) + _validation_parts(study), study.rates.evidence)


def full_report(calibrated: CalibrationStudy, validated: ValidationStudy, tank: Draw | None = None) -> HtmlReport:
    """The whole loop; `tank` draws a picture of the mechanics onto axes."""
    parts: list[Part] = []
    if tank is not None:
        parts.append(Chart("The tank at the end of a held-out run, structures coloured by size.", tank, name="tank"))
    parts += [*_calibration_parts(calibrated), *_validation_parts(validated)]
    return HtmlReport(f"{calibrated.name}: from mechanics to prediction", parts, calibrated.rates.evidence)


def _calibration_parts(study: CalibrationStudy) -> list[Part]:
    table3 = Rates.load("table3")
    is_papers_line = set(table3.channels) == set(study.calibration.network.channels)
    about = of_unit("Rate constants", inverse(study.calibration.network.time_unit))
    references = {"paper, Table III": table3} if is_papers_line else None
    breaks = [] if study.break_models is None else _break_parts(study.break_models)
    looks, looks_parts = study.diagnosis.looks, list[Part]()
    if looks.channels:
        looks_parts = [Text(looks.sentence), ReportTable("Coarse looks.", looks.table(), "looks")]
    return [
        Heading("Rates"),
        *looks_parts,
        Text(f"{study.source}. {study.made} {ABOUT_RATES.strip()} {about_not_seen(study.calibration)}"),
        ReportTable(f"{about}, per multiplicity and combination.", study.calibration.table(), "rates"),
        Chart(
            "Rates per combination of reactants.", partial(study.calibration.plot, references=references), name="forest"
        ),
        *breaks,
        *([] if study.crowding_models is None else _crowding_parts(study.crowding_models)),
        *diagnosis_parts(study.diagnosis),
    ]


def about_not_seen(calibration: Calibration) -> str:
    """A sentence on channels without events; "" if all were seen."""
    names = ", ".join(calibration.not_seen)
    unseen = names and f"Not seen: {names}. For a rate without events the runs give only an upper bound."
    return " ".join(filter(None, (unseen, about_priors(calibration.not_measured))))


def diagnosis_parts(diagnosis: Diagnosis, name: str = "diagnostics") -> list[Part]:
    """The diagnostics of a set of runs: verdicts, all p-values, and for each test its most doubtful figure.

    name : of the tables and charts; two sets of runs in one report need two
    """
    parts: list[Part] = [
        Heading("Do the runs behave like a well-mixed Markov chain?"),
        Text(f"{ABOUT_DIAGNOSTICS} {diagnosis.verdict}"),
        ReportTable(
            "Verdicts, one row for each test, with its measured size and power.",
            diagnosis.verdicts(),
            f"{name}-verdicts",
        ),
        ReportTable("P-values, one row for each channel.", diagnosis.p_values(), f"{name}-p"),
        Chart(
            "All p-values, compared with those of as many tests of a true model.",
            diagnosis.plot,
            rows=diagnosis.table(),
            name=name,
        ),
    ]
    for test in diagnosis.tests:
        worst = diagnosis.worst(test.name)
        if worst is not None:
            caption = f"{test.question} The least likely is {worst.subject}: {worst.seen}; p = {worst.p_value:.2g}."
            parts.append(Chart(caption, worst.plot, name=f"{name}-{test.name}"))
    return parts


def _break_parts(compared: BreakComparison) -> list[Part]:
    """Break models side by side; the shape as text, its intervals at 95 %."""
    rows = [row | {"shape": shape_in_words(row["shape"])} for row in compared.table()]
    return [
        Heading("What breaks a bond"),
        Text(f"{ABOUT_BREAKS} The model {compared.chosen.model.name} is chosen: {compared.reason}."),
        ReportTable("Break models, fitted to the same runs.", rows, "breaks"),
        *([] if compared.doubles is None else [Text(f"Double breaks: {compared.doubles.sentence}.")]),
    ]


def _crowding_parts(compared: CrowdingComparison) -> list[Part]:
    """Models of crowding side by side, and the tanks under each."""
    rows = [fit.as_dict() for fit in compared.fits]
    rows = [{key: value for key, value in row.items() if key not in {"tanks", "coincidence"}} for row in rows]
    return [
        Heading("What a crowd does to rates"),
        Text(f"{ABOUT_CROWDING} Chosen: {compared.reason}."),
        ReportTable("Models of crowding, fitted to logged hits and to joins.", rows, "crowding"),
        ReportTable("Events in each kind of tank over those expected.", compared.table(), "crowding-tanks"),
    ]


def _rule_parts(rules: Sequence[Bar]) -> list[Part]:
    """The parts of a report on rules stated before the runs; none without a plan."""
    if not rules:
        return []
    return [
        Heading("The rules of the plan"),
        Text(f"{in_one_sentence(rules)} {ABOUT_RULES}"),
        ReportTable(
            "The rules and the results.", [bar.to_dict() | {"is_kept": WORDS[bar.is_kept]} for bar in rules], "rules"
        ),
    ]


def _validation_parts(study: ValidationStudy) -> list[Part]:
    species = study.comparisons[0].network.species
    panels = notable([comparison.events for comparison in study.comparisons] + ([study.pooled] if study.pooled else []))
    parts: list[Part] = [
        Heading("Predicted against simulated"),
        Text(f"One test of all joins and breaks: {study.verdict.sentence}."),
        Heading("Events"),
        Text(ABOUT_EVENTS),
        ReportTable("Events of joins, of breaks and of each channel.", _event_table(study), "events"),
        Chart(
            f"Events seen over expected; the numbers on the right are both. Left out: channels of which none was seen "
            f"and fewer than {NOTABLE:g} were expected, at every size.",
            partial(_draw_events, panels),
            panels=len(panels),
            name="events-figure",
            lines=len(panels[0]) + 2,
        ),
        Heading("Single runs"),
        Text(ABOUT_SINGLE_RUNS),
        Chart(
            "PIT of single runs, one panel for each size.",
            partial(_draw_single_runs, study.comparisons),
            panels=len(study.comparisons),
            name="pit",
        ),
        Heading("Counts over time"),
        Text(ABOUT_VALIDATION),
        ReportTable(
            "One column for each size. Times in tu, cost in CPU seconds.", _one_column_each(study.summary()), "summary"
        ),
    ]
    for comparison in study.comparisons:
        draw = partial(comparison.plot, species=species)
        name = comparison.label.replace(" ", "-")
        caption = f"{comparison.label}: mean copies over time."
        parts.append(Chart(caption, draw, panels=len(species), rows=comparison.table(), name=name))
        if comparison.first is not None:
            first = comparison.first
            place = comparison.network.index(first.species)
            drawn = partial(first.plot, place=place)
            parts.append(Chart(f"{comparison.label}: first {first.species}.", drawn, name=f"{name}-first"))
    return parts + diagnosis_parts(study.diagnosis, "held-out-diagnostics")


def _event_table(study: ValidationStudy) -> list[dict[str, Any]]:
    """Rows of events, with the size as text."""
    return [{k: v for k, v in row.to_dict().items() if k not in ("cubes", "tank")} for row in study.events]


def notable(panels: Sequence[Sequence[EventRow]]) -> list[list[EventRow]]:
    """The rows of each panel without the channels that no panel has anything to show of."""
    shown = {row.group for rows in panels for row in rows if row.seen > 0 or row.expected >= NOTABLE}
    return [[row for row in rows if row.group in shown] for rows in panels]


def _draw_events(panels: Sequence[Sequence[EventRow]], axes: Any) -> None:
    """One panel a size, and one of all sizes."""
    for rows, ax in zip(panels, [axes] if len(panels) == 1 else axes, strict=True):
        expected = plots.Limited([r.expected for r in rows], [r.low for r in rows], [r.high for r in rows])
        plots.event_ratios(ax, [r.group for r in rows], [r.seen for r in rows], expected, rows[0].size)


def _draw_single_runs(comparisons: Sequence[CrossValidation], axes: Any) -> None:
    """One panel a size."""
    for comparison, ax in zip(comparisons, [axes] if len(comparisons) == 1 else axes, strict=True):
        comparison.single_runs.plot(ax)
        ax.set_title(f"{comparison.label}, {ax.get_title()}")


def _one_column_each(rows: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """Rows as columns, named by their labels: many figures of few experiments are read downwards."""
    return [{"": in_words(key)} | {str(row["label"]): row[key] for row in rows} for key in rows[0] if key != "label"]
