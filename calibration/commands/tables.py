"""Tables that `calibrate`, `validate` and `demo` print for people."""

from __future__ import annotations

import math

from calibration.estimating.break_comparison import BreakComparison, shape_in_words
from calibration.estimating.class_spread import flagged
from calibration.estimating.diagnosing.diagnosis import Diagnosis
from calibration.estimating.study import CalibrationStudy, ClassStudy
from calibration.pipeline.held_out_study import GrowthStudy, ValidationStudy
from calibration.reporting.overview import about_not_seen, rate_rows
from calibration.validating.predictive import shown_p
from kinetics.rates import about_priors
from kinetics.support.tables import figure, rate_figure, text_table


def breaks_table(compared: BreakComparison) -> str:
    """Break models side by side, and why one was chosen, for people."""

    rows = [
        (
            f"{row['model']}{' *' if row['is_chosen'] else ''}",
            str(row["free_parameters"]),
            f"{row['aic_above_least']:.1f}",
            "-" if row["p_against_nested"] is None else f"{row['p_against_nested']:.2g}",
            "-" if math.isnan(row["log_score"]) else f"{row['log_score']:.1f}",
            f"{row['deviance']:.1f} ({row['freedom']})" if row["freedom"] > 0 else "-",
            "-" if math.isnan(row["p_deviance"]) else f"{row['p_deviance']:.2g}",
            shape_in_words(row["shape"]),
        )
        for row in compared.table()
    ]
    titles = (
        *("break model", "parameters", "AIC above the smallest", "p against nested", "log score"),
        *("deviance (df)", "p", "shape [95 %]"),
    )
    lines = [text_table(titles, rows), f"* {compared.reason}."]
    if compared.doubles is not None:
        lines.append(f"double breaks: {compared.doubles.sentence}.")
    return "\n".join(lines)


def rates_table(study: CalibrationStudy) -> str:
    """Rates with intervals, and which channels were not seen, for people."""

    rows = rate_rows(study.calibration)
    titles = ("N" if title == "ways" else title for title in rows[0])
    lines = [text_table(tuple(titles), [tuple(row.values()) for row in rows])]
    lines += filter(None, [study.diagnosis.looks.sentence, study.about_breaks, about_not_seen(study.calibration)])
    lines += ["", *diagnosis_lines(study.diagnosis), ""]
    lines.append(study.source)
    return "\n".join(lines)


def diagnosis_lines(diagnosis: Diagnosis) -> list[str]:
    """P-values of all tests channel by channel, - where not testable, then the verdict and what to try, for people."""
    rows = diagnosis.p_values()
    cells = [["-" if isinstance(v, float) and math.isnan(v) else v for v in row.values()] for row in rows]
    shown = [[cell if isinstance(cell, str) else f"{cell:.2g}" for cell in line] for line in cells]
    lines = [text_table(tuple(rows[0]), shown), diagnosis.verdict]
    if diagnosis.looks.channels:
        return lines
    return lines + [f"doubtful: {f.title}: {f.seen}; {f.remedy}" for f in diagnosis.failed]


def comparison_table(study: ValidationStudy) -> str:
    """One line a size, for people."""

    rows = []
    for row in study.summary():
        first = ("-", "-", "-", "-")
        if "first_mean" in row:
            seen = f"{row['runs'] - row['first_censored']} of {row['runs']}"
            observed = f"{row['first_observed']:.4g} [{row['first_low']:.4g}, {row['first_high']:.4g}]"
            error = f" ± {row['first_predicted_error']:.1g}" if row["first_predicted_error"] else ""
            first = (seen, observed, f"{row['first_predicted']:.4g}{error}", f"{row['p_first']:.2g}")
        rows.append(
            (
                row["label"],
                str(row["runs"]),
                "yes" if row["is_consistent"] else "no",
                f"{row['coverage']:.0%} ({row['coverage_low']:.0%}-{row['coverage_high']:.0%})",
                f"{row['run_coverage']:.0%} ({row['run_coverage_low']:.0%}-{row['run_coverage_high']:.0%})",
                f"{row['misfit']:.2g}",
                f"{row['p_misfit']:.2g}",
                f"{row['crps']:.3g} ({row['crps_floor']:.3g})",
                f"{row['p_crps']:.2g}",
                f"{row['p_single_runs']:.2g}",
                *first,
                f"{row['cpu_mechanics_s']:.0f}",
                f"{row['cpu_ssa_s']:.2g} ({row['ssa_runs']} runs)",
                "-" if math.isnan(row["cpu_exact_s"]) else f"{row['cpu_exact_s']:.2g}",
            )
        )
    titles = (
        *("size", "runs", "consistent", "coverage", "of runs", "misfit", "p", "CRPS (floor)", "p", "p of PIT"),
        *("first seen", "mean wait (tu)", "predicted", "p"),
        *("CPU mechanics (s)", "SSA", "exact"),
    )
    note = (
        "Coverage of a predicted 95 % band by the mean and by single runs, with the middle 95 % that the model "
        "itself gives;\n"
        "misfit of the mean, about 1; waits for the first finished structure count to the end of a run at most."
    )
    if any(not comparison.is_exact for comparison in study.comparisons):
        note += "\nToo many states for the exact solution: predicted by SSA runs, ± one standard error."
    diagnosed = diagnosis_lines(study.diagnosis)
    if prior := about_priors(study.rates.not_measured):
        note += f"\n{prior}"
    return "\n".join(
        [text_table(titles, rows), note, "", _event_table(study), "", *diagnosed, "", study.verdict.sentence]
    )


def _event_table(study: ValidationStudy) -> str:
    """Events seen and expected, one line a size and group of channels."""
    rows = [
        (
            row.size,
            row.group,
            str(row.seen),
            f"{row.expected:.1f} ({row.low:.1f}-{row.high:.1f})",
            shown_p(row.p, row.least),
            *(
                ("-", "a single run")
                if math.isnan(row.scatter)
                else (
                    f"{row.scatter:.2f} ({row.scatter_low:.2f}-{row.scatter_high:.2f})",
                    shown_p(row.p_scatter, row.least_scatter),
                )
            ),
        )
        for row in study.events
    ]
    titles = ("size", "events", "seen", "expected (95 %)", "", "scatter between runs (95 %)", "")
    return text_table(titles, rows)


def class_rates_table(study: ClassStudy) -> str:
    """Class rates with intervals, how they were shared, and where one constant does not serve, for people."""

    rows = [
        (
            row["class"],
            rate_figure(row["rate"], row["high"]),
            f"{figure(row['low'], '.3g')} to {figure(row['high'], '.3g')}",
            f"{row['events']:.3g}",
            f"{row['exposure']:.4g}",
        )
        for row in study.calibration.table()
    ]
    lines = [text_table(("class", "rate (1/tu)", "95 % interval", "events", "exposure (tu)"), rows)]
    lines += [f"{kind}: {reason}" for kind, reason in study.calibration.reasons.items()]
    shape = ", ".join(f"{name} = {value:.3g}" for name, value in study.rates.breaks.shape.items())
    lines.append(f"break model: {study.rates.breaks.model}{f' ({shape})' if shape else ''}")
    missed = study.calibration.not_measured
    if missed:
        lines.append(f"{len(missed)} classes were not present to be measured; a more general entry replaces them")
    off = flagged(study.spreads)
    said = "; ".join(spread.sentence for spread in off) if off else "none detected by these runs at 1 %"
    lines.append(f"rates that differ within a constant ({len(study.spreads)} tests): {said}")
    return "\n".join([*lines, study.source])


def growth_tables(study: GrowthStudy) -> str:
    """Each comparison, and what it says, for people."""
    return "\n\n".join(f"{comparison.table()}\n{comparison.sentence}" for comparison in study.comparisons)
