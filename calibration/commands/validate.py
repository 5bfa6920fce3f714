"""The command `wellmixed validate`: predictions tested on held-out mechanics runs."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import click

from calibration.commands.by_class import validate_by_class
from calibration.commands.shared import (
    comparison_table,
    leave,
    refuse_what_a_plan_fixes,
    report_option,
    seed_option,
)
from calibration.pipeline.bars import bars
from calibration.pipeline.held_out_study import check_held_out, run_planned_validation, run_validation
from calibration.pipeline.plan import StudyPlan, is_plan
from calibration.pipeline.study_runs import assembly_specs
from calibration.reporting.overview import validation_report
from kinetics.rates import Rates, are_by_class
from kinetics.support.cli.completion import shipped
from kinetics.support.cli.options import NumbersCommand, echo_json, json_option, picture_of, table_of
from kinetics.support.cli.study_folder import PLAN, RUNS, is_filled, or_study_folder, rates_of
from kinetics.support.output import write_whole
from kinetics.support.packages import pd
from mechsim.commands.options import run_options
from mechsim.scene import Scene

if TYPE_CHECKING:
    from calibration.pipeline.bars import Bar
    from mechsim.commands.options import ShardWork
    from mechsim.runs.executors import Executor


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
@click.option(
    "--cubes",
    type=click.IntRange(min=1),
    multiple=True,
    default=(60, 80, 120),
    show_default=True,
    metavar="N ...",
    help="Numbers of cubes to validate at.",
)
@click.option(
    "--runs",
    metavar="N",
    type=click.IntRange(min=2),
    default=10,
    show_default=True,
    help="Number of held-out runs at each number of cubes.",
)
@click.option(
    "--duration", metavar="T", type=float, default=2000.0, show_default=True, help="Simulated time of a run, tu."
)
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
@click.option(
    "--groups",
    metavar="N",
    type=click.IntRange(min=40),
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
    cubes: tuple[int, ...],
    runs: int,
    duration: float,
    control_name: str | None,
    csv_files: tuple[str, ...],
    groups: int | None,
    plot_files: tuple[str, ...],
    report: str | None,
    runs_folder: str,
    workers: Executor,
    part: ShardWork | None,
    progress: bool | None,
    seed: int,
    as_json: bool,
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
    plan = StudyPlan.load(scene) if is_plan(scene) else None
    if plan is not None:
        refuse_what_a_plan_fixes(scene, "cubes", "runs", "duration", "seed")
        seed = plan.held_out.seed
    elif control_name:
        raise ValueError("--control: only a plan has rules that a control must fail; give a plan, or leave it out")
    described = Scene.load(plan.scene if plan else scene)
    if are_by_class(rates_name):
        if (report and not is_filled("report")) or control_name:
            raise ValueError("--report and --control are for rates by channel; leave them out, or use --json")
        specs = plan.specs(plan.held_out) if plan else assembly_specs(described, cubes, runs, duration, seed)
        if part is not None:
            part.make(specs, runs_folder, workers, progress, as_json)
        else:
            validate_by_class(specs, rates_name, csv_files, plot_files, groups, runs_folder, workers, progress, as_json)
        return
    if plot_files or groups:
        raise ValueError("--plot and --groups are for rates by class; leave them out, or take --report")
    rates = Rates.load(rates_name)
    check_held_out(described, rates, seed)
    if part is not None:
        specs = plan.specs(plan.held_out) if plan else assembly_specs(described, cubes, runs, duration, seed)
        part.make(specs, runs_folder, workers, progress, as_json)
        return
    common: dict[str, Any] = {"workers": workers, "progress": progress}
    if plan is not None:
        study = run_planned_validation(plan, rates, runs_folder, **common)
    else:
        sizes: dict[str, Any] = {"sizes": cubes, "runs": runs, "duration": duration}
        study = run_validation(described, rates, runs_folder, seed=seed, **sizes, **common)
    cleared: list[Bar] = []
    if plan is not None:
        control = (
            run_planned_validation(plan, Rates.load(control_name), runs_folder, **common) if control_name else None
        )
        cleared = bars(plan.verdict, study, control)
    for csv_file in csv_files:
        write_whole(csv_file, pd.DataFrame([row.to_dict() for row in study.events]).to_csv(index=False))
    if report:
        validation_report(study, cleared).write(report, data=True)
    if as_json:
        echo_json(
            {
                "rates": rates_name,
                "plan": plan and plan.name,
                "duration": None if plan else duration,
                "runs": None if plan else runs,
                "seed": seed,
                "is_consistent": study.is_consistent,
                "verdict": study.verdict.sentence,
                "rules": [bar.to_dict() for bar in cleared],
                "events": [row.to_dict() for row in study.events],
                "comparisons": [comparison.to_dict() for comparison in study.comparisons],
                "diagnostics": study.diagnosis.to_dict(),
                "digest": study.outcome.digest,
                "problems": study.problems,
            }
        )
    else:
        click.echo(comparison_table(study))
        for bar in cleared:
            click.echo(f"rule: {bar.sentence}")
    leave(study.problems)
