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
from calibration.pipeline.bars import Bar, bars
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
from mechsim.commands.options import run_options


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
    "control_name",
    metavar="NAME|FILE",
    help="Rates of the break model that the rules of a PLAN expect to fail, fitted to the same calibration runs.",
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
@run_options
@seed_option(2)
@json_option
def validate(
    scene: str,
    rates_name: str,
    control_name: str | None,
    csv_files: tuple[str, ...],
    groups: int | None,
    plot_files: tuple[str, ...],
    report: str | None,
    as_json: bool,
    **how: Any,
) -> None:
    """Compare predictions with mechanics runs of a scene that the rates never saw.

    A PLAN, a file written by `wellmixed study plan`, states scene, sizes, runs, seed and the rules of the verdict; the
    report says which rules hold. A FOLDER, made by `wellmixed new`, holds the plan and the rates; report and runs are
    written there.

    Rates by class are tested on growth: network-free runs under draws of the rates predict curves of structures by
    size, of targets and of the largest structure, joins and breaks. The report gives the power of so many runs to
    detect wrong rates of joins or breaks, and names the checks that could not fail. The rest of this text is about
    rates by channel.

    The verdict rests on the events of every channel, seen and expected, on the scatter of joins and breaks between
    runs, on mean counts, CRPS, single runs and first times, each by a p-value that carries the uncertainty of the
    rates; those of events, scatter, mean counts and single runs are exact. Coverage is the share of times and species
    at which the runs' mean lies in its predicted 95 % band. CRPS, the continuous ranked probability score, is the mean
    distance of a run from the predicted distribution, in copies; it is shown beside the model's score against its own
    runs. Exit code 4: some runs were stopped by the guard or given up.
    """

    asked = {"sizes": how["cubes"]} | {name: how[name] for name in ("runs", "duration", "seed")}
    runs = StudyRuns.asked_for(scene, "held_out", **asked)
    if runs.plan is not None:
        refuse_what_a_plan_fixes(scene, "cubes", "runs", "duration", "seed")
    elif control_name:
        raise ValueError("--control: only a plan has rules that a control must fail; give a plan, or leave it out")
    by_class = are_by_class(rates_name)
    if by_class and ((report and not is_filled("report")) or control_name):
        raise ValueError("--report and --control are for rates by channel; leave them out, or use --json")
    if not by_class and (plot_files or groups):
        raise ValueError("--plot and --groups are for rates by class; leave them out, or take --report")
    rates = ClassRates.load(rates_name) if by_class else Rates.load(rates_name)
    check_held_out(runs, rates)
    folder, common = how["runs_folder"], {name: how[name] for name in ("workers", "progress")}
    if how["part"] is not None:
        how["part"].make(runs.specs, folder, as_json=as_json, **common)
        return
    study: ValidationStudy | GrowthStudy
    told: dict[str, Any] = {}
    cleared: list[Bar] = []
    if isinstance(rates, ClassRates):
        study = run_growth_validation(runs, rates, folder, most_groups=groups, **common)
    else:
        study = run_validation(runs, rates, folder, **common)
        if runs.plan is not None:
            control = run_validation(runs, Rates.load(control_name), folder, **common) if control_name else None
            cleared = bars(runs.plan.verdict, study, control)
        told = {"plan": runs.plan and runs.plan.name, "seed": runs.seed, "rules": [bar.to_dict() for bar in cleared]}
        told |= {name: None if runs.plan else how[name] for name in ("duration", "runs")}
    write_tables(csv_files, study.to_dataframe)
    if isinstance(study, GrowthStudy):
        for plot_file in plot_files:
            study.save_plot(plot_file)
    if report and isinstance(study, ValidationStudy):
        validation_report(study, cleared).write(report, data=True)
    if as_json:
        echo_json({"rates": rates_name} | told | study.to_dict())
    else:
        click.echo(comparison_table(study) if isinstance(study, ValidationStudy) else growth_tables(study))
        for bar in cleared:
            click.echo(f"rule: {bar.sentence}")
    leave(study.outcome.problems)
