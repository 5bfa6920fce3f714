"""The HTML reports of calibration and validation: their tables and figures in order, with the text between them."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Sequence
from functools import partial
from typing import TYPE_CHECKING, Any

from calibration import plots
from calibration.estimating.break_comparison import shape_in_words
from calibration.estimating.joins_and_breaks import WHOLES
from calibration.pipeline.bars import WORDS, Bar, in_one_sentence
from calibration.reporting.report import Chart, Fold, HtmlReport, Part, ReportTable, Text
from calibration.reporting.words import in_words
from calibration.validating.power import LEVEL
from calibration.validating.predictive import shown_p
from kinetics.rates import Rates, about_priors
from kinetics.support.tables import counted, figure, inverse, of_unit, rate_figure

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
They were stated before the runs, and each is judged by itself. A rule on seen / expected cannot be judged where the
predicted 95 % interval is wider than the rule, unless the p of what came is below the plan's own for a row.
"""
ABOUT_SINGLE_RUNS = """
For each run, where its joins and breaks (over those expected) and its final counts lie in their predicted distribution
(PIT, the probability integral transform): uniform from 0 to 1 if the model holds. Their distance from uniformity is
judged against simulated groups of as many runs.
"""

Draw = Callable[[Any], Any]


def calibration_report(study: CalibrationStudy) -> HtmlReport:
    """The report of the calibration runs: verdict, counts and rates on the first screen, the rest folded."""
    parts = [*_calibration_first(study), *_calibration_folds(study)]
    return HtmlReport(f"Rates of {study.name}", parts, study.rates.evidence)


def validation_report(study: ValidationStudy, rules: Sequence[Bar] = ()) -> HtmlReport:
    """The report of predictions against held-out runs; `rules` : the bars of a plan, with results."""
    parts = [*_verdict(study, rules), *_rates_held(study), *_rule_folds(rules), *_validation_folds(study, rules)]
    return HtmlReport("Held-out runs", parts, study.rates.evidence)


def full_report(calibrated: CalibrationStudy, validated: ValidationStudy, tank: Draw | None = None) -> HtmlReport:
    """The whole loop; `tank` draws a picture of the mechanics onto axes."""
    parts = [*_verdict(validated), *_calibration_first(calibrated)]
    if tank is not None:
        drawn = Chart("The tank at the end of a held-out run, structures coloured by size.", tank, name="tank")
        parts.append(Fold("The tank", [drawn]))
    parts += [*_calibration_folds(calibrated), *_validation_folds(validated)]
    return HtmlReport(f"{calibrated.name}: from mechanics to prediction", parts, calibrated.rates.evidence)


def _calibration_first(study: CalibrationStudy) -> list[Part]:
    """What the runs say of their model, how many events they had, and the rates."""
    table3 = Rates.load("table3")
    is_papers_line = set(table3.channels) == set(study.calibration.network.channels)
    references = {"paper, Table III": table3} if is_papers_line else None
    about = of_unit("Rate constants", inverse(study.calibration.network.time_unit))
    breaks = study.about_breaks or (study.shown_breaks and f"break model: {study.shown_breaks.chosen.model.name}")
    counts = [counted(n, name.removesuffix("s")) for name, n in study.counts.items()]
    told = [", ".join(counts), breaks, study.diagnosis.looks.sentence.rstrip(".")]
    return [
        Text(f"Calibration: {study.diagnosis.short_verdict}"),
        Text("".join(f"{line[0].upper()}{line[1:]}. " for line in told if line)),
        ReportTable(
            f"{about}, per multiplicity and combination.",
            study.calibration.table(),
            "rates",
            rate_rows(study.calibration),
        ),
        Chart(
            "Rates per combination of reactants.",
            partial(study.calibration.plot, references=references),
            name="forest",
            lines=len(study.calibration.estimates) + 2,
        ),
    ]


def _calibration_folds(study: CalibrationStudy) -> list[Part]:
    """How the rates were measured, what breaks a bond, what a crowd does, and the diagnostics."""
    looks = study.diagnosis.looks
    about = f"{study.source}. {study.made} {ABOUT_RATES.strip()} {about_not_seen(study.calibration)}"
    tables = [ReportTable("Coarse looks.", looks.table(), "looks")] if looks.channels else []
    return [
        Fold("How the rates were measured", [Text(about), *tables]),
        *([] if study.shown_breaks is None else [_breaks_fold(study.shown_breaks)]),
        *([] if study.crowding_models is None else [_crowding_fold(study.crowding_models)]),
        diagnosis_fold(study.diagnosis),
    ]


def rate_rows(calibration: Calibration) -> list[dict[str, str]]:
    """Rates for people, one row a channel: `< x`, the upper limit, where nothing was seen."""
    unit = calibration.network.time_unit
    return [
        {
            "channel": row["channel"],
            "ways": f"{row['ways']:g}",
            of_unit("rate", inverse(unit)): rate_figure(row["rate"], row["high"]),
            "95 % interval": row["note"] or f"{row['low']:.3g} to {row['high']:.3g}",
            "events": str(row["events"]),
            of_unit("exposure", unit): f"{row['exposure']:.4g}",
        }
        for row in calibration.table()
    ]


def about_not_seen(calibration: Calibration) -> str:
    """A sentence on channels without events; "" if all were seen."""
    names = ", ".join(calibration.not_seen)
    unseen = names and f"Not seen: {names}. For a rate without events the runs give only an upper bound."
    return " ".join(filter(None, (unseen, about_priors(calibration.not_measured))))


def diagnosis_fold(diagnosis: Diagnosis, name: str = "diagnostics", runs: str = "runs") -> Fold:
    """The diagnostics of a set of runs: verdicts, all p-values, and the figures of the tests that failed.

    name, runs : of the tables and charts, and what the runs are called; two sets of runs in one report need two
    """
    parts: list[Part] = [
        Text(f"{ABOUT_DIAGNOSTICS} {diagnosis.verdict}"),
        ReportTable(
            "Verdicts, one row for each test, with its measured size and power.",
            diagnosis.verdicts(),
            f"{name}-verdicts",
        ),
        ReportTable("P-values, one row for each channel.", diagnosis.p_values(), f"{name}-p"),
    ]
    for test in diagnosis.tests:
        worst = next((result for result in diagnosis.failed if result.test == test.name), None)
        if worst is not None:
            caption = f"{test.question} The least likely is {worst.subject}: {worst.seen}; p = {worst.p_value:.2g}."
            parts.append(Chart(caption, worst.plot, name=f"{name}-{test.name}"))
    everything = ReportTable("One row for each test and channel.", diagnosis.table(), name)
    return Fold(f"Do the {runs} behave like a well-mixed Markov chain?", [*parts, Fold("All results", [everything])])


def _breaks_fold(compared: BreakComparison) -> Fold:
    """Break models side by side; the shape as text, its intervals at 95 %."""
    rows = [row | {"shape": shape_in_words(row["shape"])} for row in compared.table()]
    shown = [row | {"freedom": row["freedom"] or None} for row in rows]
    return Fold(
        "What breaks a bond",
        [
            Text(f"{ABOUT_BREAKS} The model {compared.chosen.model.name} is chosen: {compared.reason}."),
            ReportTable("Break models, fitted to the same runs.", rows, "breaks", shown),
            *([] if compared.doubles is None else [Text(f"Double breaks: {compared.doubles.sentence}.")]),
        ],
    )


def _crowding_fold(compared: CrowdingComparison) -> Fold:
    """Models of crowding side by side, and the tanks under each."""
    rows = [fit.as_dict() for fit in compared.fits]
    rows = [{key: value for key, value in row.items() if key not in {"tanks", "coincidence"}} for row in rows]
    return Fold(
        "What a crowd does to rates",
        [
            Text(f"{ABOUT_CROWDING} Chosen: {compared.reason}."),
            ReportTable("Models of crowding, fitted to logged hits and to joins.", rows, "crowding"),
            ReportTable("Events in each kind of tank over those expected.", compared.table(), "crowding-tanks"),
        ],
    )


def _rule_folds(rules: Sequence[Bar]) -> list[Part]:
    """The rules stated before the runs; none without a plan."""
    if not rules:
        return []
    rows = [bar.to_dict() | {"is_kept": WORDS[bar.is_kept]} for bar in rules]
    table = ReportTable("The rules and the results.", rows, "rules")
    return [Fold("The rules of the plan", [Text(ABOUT_RULES), table])]


def _verdict(study: ValidationStudy, rules: Sequence[Bar] = ()) -> list[Part]:
    """The rules of the plan, the verdict, and how many events the runs had."""
    parts: list[Part] = [Text(in_one_sentence(rules))] if rules else []
    parts.append(Text(f"{'All together' if rules else 'Verdict'}: {study.verdict.sentence}."))
    wholes = [row for row in _all_sizes(study) if row.group in WHOLES]
    counts = [f"{row.seen} {row.group} ({row.expected:.4g} expected)" for row in wholes]
    runs = sum(comparison.runs for comparison in study.comparisons)
    return [*parts, Text(f"{', '.join([f'{runs} held-out runs', *counts])}.")]


def _all_sizes(study: ValidationStudy) -> Sequence[EventRow]:
    """Events over all sizes, or of the only one."""
    return study.pooled or study.comparisons[0].events


def _rates_held(study: ValidationStudy) -> list[Part]:
    """The rates that were tested, beside the events that they promise and those seen."""
    events, known = {row.group: row for row in _all_sizes(study)}, study.rates.channels
    unit, rows = of_unit("rate", inverse(study.rates.convention.time_unit)), []
    for channel in (name for name in known if name in events):
        rate, row = known[channel], events[channel]
        low, high = (math.nan if limit is None else limit for limit in (rate.low, rate.high))
        interval = f"{figure(low, '.3g')} to {figure(high, '.3g')}" if rate.prior is None else "a prior"
        rows.append(
            {
                "channel": channel,
                unit: rate_figure(rate.rate, high) if rate.prior is None else "-",
                "95 % interval": interval,
                "events seen": row.seen,
                "expected": row.expected,
                "p": shown_p(row.p, row.least).removeprefix("p = "),
            }
        )
    panel = notable([_all_sizes(study)])
    return [
        ReportTable("The rates, and the held-out events of each channel.", rows),
        Chart("Events seen over expected.", partial(_draw_events, panel), lines=len(panel[0]) + 2),
    ]


def _validation_folds(study: ValidationStudy, rules: Sequence[Bar] = ()) -> list[Part]:
    """Events, single runs, counts over time and diagnostics."""
    panels = notable([comparison.events for comparison in study.comparisons] + ([study.pooled] if study.pooled else []))
    events: list[Part] = [
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
    ]
    return [
        Fold("Held-out runs: events seen and expected", events),
        Fold("Held-out runs: each by itself", _single_run_parts(study, rules)),
        Fold("Predicted against simulated: counts of the held-out runs", _count_parts(study)),
        diagnosis_fold(study.diagnosis, "held-out-diagnostics", "held-out runs"),
    ]


def _single_run_parts(study: ValidationStudy, rules: Sequence[Bar]) -> list[Part]:
    """The p-values of PITs; their figure where one of them fails at 1 %, or the plan's rule on them does."""
    p_values = {each.label: each.single_runs.p_value for each in study.comparisons}
    told = "; ".join(f"{label}: p = {p:.2g}" for label, p in p_values.items())
    parts: list[Part] = [Text(f"{ABOUT_SINGLE_RUNS.strip()} {told}; together: p = {study.p_single_runs:.2g}.")]
    is_missed = any("PIT" in bar.rule and bar.is_kept is False for bar in rules)
    if min(*p_values.values(), study.p_single_runs) > LEVEL and not is_missed:
        return parts
    draw, panels = partial(_draw_single_runs, study.comparisons), len(study.comparisons)
    return [*parts, Chart("PIT of single runs, one panel for each size.", draw, panels=panels, name="pit")]


def _count_parts(study: ValidationStudy) -> list[Part]:
    """Mean copies and first targets of each size."""
    species = study.comparisons[0].network.species
    about = "One column for each size. Times in tu, cost in CPU seconds."
    parts: list[Part] = [Text(ABOUT_VALIDATION), ReportTable(about, _one_column_each(study.summary()), "summary")]
    for comparison in study.comparisons:
        draw = partial(comparison.plot, species=species)
        name = "-".join(re.findall(r"[\w.]+", comparison.label))  # it names files
        caption = f"{comparison.label}: mean copies over time."
        parts.append(Chart(caption, draw, panels=len(species), rows=comparison.table(), name=name))
        if comparison.first is not None:
            first = comparison.first
            place = comparison.network.index(first.species)
            drawn = partial(first.plot, place=place)
            parts.append(Chart(f"{comparison.label}: first {first.species}.", drawn, name=f"{name}-first"))
    return parts


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
