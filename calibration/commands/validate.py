"""The command `wellmixed validate`: predictions tested on held-out mechanics runs."""

from __future__ import annotations

from typing import Any

import click

from calibration.commands.shared import (
    leave,
    refuse_what_a_plan_fixes,
    report_option,
    seed_option,
    sizes_option,
    time_option,
)
from calibration.commands.tables import comparison_table, growth_tables
from calibration.pipeline.bars import Bar, bars, in_one_sentence
from calibration.pipeline.controls import load_controls
from calibration.pipeline.held_out_study import (
    GrowthStudy,
    ValidationStudy,
    check_held_out,
    run_growth_validation,
    run_validation,
)
from calibration.pipeline.study_runs import StudyRuns
from calibration.reporting.overview import validation_report
from kinetics.rates import ClassRates, Rates, are_by_class
from kinetics.support.cli.completion import shipped
from kinetics.support.cli.declared import count_option
from kinetics.support.cli.options import NumbersCommand, echo_json, json_option, picture_of, table_of, write_tables
from kinetics.support.cli.study_folder import PLAN, RUNS, is_filled, or_study_folder, rates_of
from mechsim.commands.options import engine_option, run_options


@click.command(cls=NumbersCommand)
@click.argument(
    "scene",
    metavar="SCENE|PLAN|FOLDER",
    shell_complete=shipped("scene"),
    **or_study_folder(PLAN, {"runs_folder": RUNS, "rates_name": rates_of, "report": "validation.html"}),
)
@click.option(
    "--rates",
    "rates_name",
    required=True,
    metavar="NAME|FILE",
    shell_complete=shipped("rates"),
    help="Rate constants: a shipped table such as table3, or a .toml file, by channel or by class.",
)
@sizes_option("--cubes", "Numbers of cubes to validate at.", default=(60, 80, 120))
@count_option("--runs", least=2, default=10, help="Number of held-out runs at each number of cubes.")
@time_option("--duration", 2000.0, "Simulated time of a run, tu.")
@click.option(
    "--control",
    "control_names",
    metavar="NAME|FILE",
    multiple=True,
    help="Rates that must break the rules of a PLAN, fitted to the same calibration runs: with another break model, or "
    "without crowding; may be repeated.",
)
@click.option(
    "--csv",
    "csv_files",
    metavar="FILE",
    multiple=True,
    callback=table_of("pandas"),
    help="Write the events seen and expected to this CSV file; for rates by class the curves; may be repeated.",
)
@count_option(
    "--groups",
    least=40,
    help="For rates by class: number of simulated groups used if a p-value is small. The report names the checks "
    "that so few groups cannot fail.  [default: 1999]",
)
@click.option(
    "--plot",
    "plot_files",
    metavar="FILE",
    multiple=True,
    callback=picture_of,
    help="For rates by class: draw each curve beside its prediction to this PNG, PDF or SVG file; may be repeated.",
)
@report_option
@engine_option
@run_options
@seed_option(2)
@json_option
def validate(
    scene: str,
    rates_name: str,
    control_names: tuple[str, ...],
    csv_files: tuple[str, ...],
    groups: int | None,
    plot_files: tuple[str, ...],
    report: str | None,
    as_json: bool,
    **how: Any,
) -> None:
    """Compare predictions with mechanics runs of a scene that the rates never saw.

    A PLAN, a file written by `wellmixed study plan`, states scene, sizes, runs, seed and the rules of the verdict; the
    first sentence says which rules are kept, broken, or cannot be judged because the predicted interval is wider than
    the rule. A FOLDER, made by `wellmixed new`, holds the plan and the rates; report and runs are written there.

    Rates by class are tested on growth: network-free runs under draws of the rates predict curves of structures by
    size, of targets and of the largest structure, joins and breaks. The report gives the power of so many runs to
    detect wrong rates of joins or breaks, and names the checks that could not fail. The rest of this text is about
    rates by channel.

    One test judges the joins and the breaks of all kinds of run together, by an exact p-value that carries the
    uncertainty of the rates. Shown beside it, each with a p-value of its own: the events of every channel, the scatter
    between runs, mean counts, CRPS, single runs and first times. Coverage is the share of times and species at which
    the runs' mean lies in its predicted 95 % band. CRPS, the continuous ranked probability score, is the mean distance
    of a run from the predicted distribution, in copies; it is shown beside the model's score against its own runs.
    Exit code 4: some runs were stopped by the guard or given up; 5: a rule of the plan is broken.
    """

    asked = {"sizes": how["cubes"]} | {name: how[name] for name in ("runs", "duration", "seed", "engine")}
    runs = StudyRuns.asked_for(scene, "held_out", **asked)
    if runs.plan is not None:
        refuse_what_a_plan_fixes(scene, "cubes", "runs", "duration", "seed", "engine")
    elif control_names:
        raise ValueError("--control: only a plan has rules that a control must fail; give a plan, or leave it out")
    by_class = are_by_class(rates_name)
    if by_class and ((report and not is_filled("report")) or control_names):
        raise ValueError("--report and --control are for rates by channel; leave them out, or use --json")
    if not by_class and (plot_files or groups):
        raise ValueError("--plot and --groups are for rates by class; leave them out, or take --report")
    rates = ClassRates.load(rates_name) if by_class else Rates.load(rates_name)
    check_held_out(runs, rates)
    others = load_controls(control_names, rates)
    folder, common = how["runs_folder"], {name: how[name] for name in ("workers", "progress")}
    if how["part"] is not None:
        how["part"].make(runs.specs, folder, as_json=as_json, **common)
        return
    study: ValidationStudy | GrowthStudy
    told: dict[str, Any] = {}
    rules: list[Bar] = []
    if isinstance(rates, ClassRates):
        study = run_growth_validation(runs, rates, folder, most_groups=groups, **common)
    else:
        study = run_validation(runs, rates, folder, **common)
        if runs.plan is not None:
            controls = {
                in_words: run_validation(runs, control, folder, **common) for in_words, control in others.items()
            }
            rules = bars(runs.plan.verdict, study, controls)
        told = {"plan": runs.plan and runs.plan.name, "seed": runs.seed, "rules": [bar.to_dict() for bar in rules]}
        told |= {name: None if runs.plan else how[name] for name in ("duration", "runs")}
    write_tables(csv_files, study.to_dataframe)
    if isinstance(study, GrowthStudy):
        for plot_file in plot_files:
            study.save_plot(plot_file)
    if as_json:
        echo_json({"rates": rates_name} | told | study.to_dict())
    else:
        for line in [in_one_sentence(rules), *(f"  {bar.sentence}" for bar in rules), ""] if rules else []:
            click.echo(line)
        click.echo(comparison_table(study) if isinstance(study, ValidationStudy) else growth_tables(study))
    if report and isinstance(study, ValidationStudy):  # last, so that a report that cannot be written loses no result
        validation_report(study, rules).write(report, data=True)
    leave(study.outcome.problems, any(bar.is_kept is False for bar in rules))
