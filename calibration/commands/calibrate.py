"""The command `wellmixed calibrate`: rates of all channels, from mechanics runs or from what others observed."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from calibration.commands.by_class import calibrate_by_class, is_seeded
from calibration.commands.from_events import events_options, study_of_events
from calibration.commands.shared import (
    breaks_table,
    leave,
    rates_table,
    refuse_what_a_plan_fixes,
    report_option,
    seed_option,
)
from calibration.pipeline.calibration_study import check_measurable, run_calibration, run_planned_calibration
from calibration.pipeline.plan import StudyPlan, is_plan
from calibration.pipeline.study_runs import assembly_specs
from calibration.reporting.overview import calibration_report, not_seen
from kinetics.rates.breaks import break_model
from kinetics.support.cli.completion import shipped
from kinetics.support.cli.options import HEADING, NumbersCommand, echo_json, heading, in_a_folder, json_option
from kinetics.support.cli.study_folder import PLAN, RATES, RUNS, is_filled, or_study_folder
from mechsim.commands.options import run_options
from mechsim.scene import Scene

if TYPE_CHECKING:
    from calibration.observed.study import ObservedStudy
    from calibration.pipeline.calibration_study import CalibrationStudy
    from mechsim.commands.options import ShardWork
    from mechsim.runs.executors import Executor


@click.command(cls=NumbersCommand)
@click.argument(
    "scene",
    metavar="SCENE|PLAN|FOLDER",
    shell_complete=shipped("scene"),
    **or_study_folder(PLAN, {"runs_folder": RUNS, "out": RATES, "report": "calibration.html"}),
)
@click.option(
    "--out",
    required=True,
    metavar="FILE",
    type=click.Path(dir_okay=False),
    callback=in_a_folder,
    help="The rates file to write (TOML).",
)
@click.option(
    "--cubes",
    type=click.IntRange(min=1),
    multiple=True,
    default=(60,),
    show_default=True,
    metavar="N ...",
    help="Numbers of cubes of the runs. With --events, one number: it is checked, and if the table gives no initial "
    "counts, all cubes start single.",
)
@click.option(
    "--runs",
    metavar="N",
    type=click.IntRange(min=1),
    default=20,
    show_default=True,
    help="Number of calibration runs at each number of cubes.",
)
@click.option(
    "--duration", metavar="T", type=float, default=1000.0, show_default=True, help="Simulated time of a run, tu."
)
@click.option(
    "--break-model",
    "breaks",
    metavar="auto|NAME",
    help="How bonds break: a break model such as first-order or collision, or auto for the one that the runs "
    "choose. With --events, no break model is fitted unless one is named here.  [default: the plan's, or auto]",
)
@click.option(
    "--by",
    type=click.Choice(["channel", "class"]),
    help="Rates by channel, for the network of this book, or by rate class, for any book.  [default: class for a "
    "book that grows from a seed, else channel]",
)
@heading("For rates by class")
@click.option(
    "--pool",
    multiple=True,
    metavar="SCENE|PLAN",
    help="Another scene or plan whose runs are pooled with these; may be repeated.",
)
@click.option(
    "--group-by",
    type=click.Choice(["auto", "event", "touched", "faces", "sizes"]),
    default="auto",
    show_default=True,
    help="What classes must have in common to share one constant: the event (join or break), also the number of "
    "cubes touched, also the faces, or also the sizes. With auto the runs choose, for joins and for breaks.",
)
@heading("For events that others observed")
@events_options
@heading("How runs are made")
@run_options
@heading(HEADING)
@report_option
@seed_option(1)
@json_option
def calibrate(
    scene: str,
    out: str,
    cubes: tuple[int, ...],
    runs: int,
    duration: float,
    breaks: str | None,
    by: str | None,
    pool: tuple[str, ...],
    group_by: str,
    events: str | None,
    run_table: str | None,
    tank: tuple[float, float, float] | None,
    report: str | None,
    runs_folder: str,
    workers: Executor,
    part: ShardWork | None,
    progress: bool | None,
    seed: int,
    as_json: bool,
) -> None:
    """Estimate the reaction rates of a scene from mechanics runs, with 95 % intervals.

    A rate is events over exposure, pooled over all runs; waits that the end of a run cuts short (censoring) count in
    full. Runs are assemblies from single cubes, not restarted, so that rates are measured along the path on which they
    are used. A channel without events is named: for it the runs give only an upper bound. A channel whose reactants no
    run held gets a prior from the others of its kind, and the rates file marks it. Exit code 4: some runs were stopped
    by the guard or given up; the rates come from the others.

    Rates by class (--by class) belong to the number of cubes that a place touches, to pairs of faces and to sizes, as
    far as the runs distinguish them, and serve `rules grow`, `rules rank`, `predict` and `validate` for any book. For
    books that grow from a seed these are the only rates: see docs/class_rates.md.

    A PLAN, a file written by `wellmixed study plan`, states scene, tanks, runs and seed. A FOLDER, made by `wellmixed
    new`, holds the plan; rates, report and runs are written there.

    With --events no run is made: the rates come from runs that others observed, and a rule book or a network file
    (.net, SBML) replaces SCENE. A row of their table holds run, time and channel, or run, time and the copies of each
    species after a change. The word start in the column channel marks the start of a run, with the copies of each
    species; end marks its end, and restart that it was put back to its start. See docs/observed_events.md.
    """
    target = Path(out)
    if target.suffix != ".toml":
        raise ValueError(f"--out {out}: expected a name that ends in .toml")
    if events is not None and (pool or by == "class"):
        raise ValueError("--events gives rates by channel, for one book; leave out --by class and --pool")
    if pool and by == "channel":
        raise ValueError("--pool pools books, whose channels differ; leave it out, or ask for --by class")
    if events is None and (pool or by == "class" or (by is None and is_seeded(scene))):
        if report and not is_filled("report"):
            raise ValueError("--report shows rates by channel; for rates by class use --json")
        if is_plan(scene):
            refuse_what_a_plan_fixes(scene, "cubes", "runs", "duration", "seed")
        calibrate_by_class(
            (scene, *pool), target, cubes, runs, duration, breaks, group_by, runs_folder, workers, part, progress, seed,
            as_json,
        )  # fmt: skip
        return
    if group_by != "auto":
        raise ValueError(f"--group-by {group_by} is for rates by class; leave it out, or ask for --by class")
    study: CalibrationStudy | ObservedStudy | None = study_of_events(scene, events, run_table, tank, cubes, breaks)
    if study is None:
        if breaks not in (None, "auto"):
            break_model(breaks)
        plan = StudyPlan.load(scene) if is_plan(scene) else None
        if plan is not None:
            refuse_what_a_plan_fixes(scene, "cubes", "runs", "duration", "seed")
            seed = plan.calibration.seed
        if part is not None:
            if plan is not None:
                specs = plan.specs(plan.calibration)
            else:
                described = Scene.load(scene)
                check_measurable(described, cubes)
                specs = assembly_specs(described, cubes, runs, duration, seed)
            part.make(specs, runs_folder, workers, progress, as_json)
            return
        common: dict[str, Any] = {"workers": workers, "progress": progress}
        if plan is not None:
            study = run_planned_calibration(plan, runs_folder, breaks=breaks, **common)
        else:
            sizes: dict[str, Any] = {"sizes": cubes, "runs": runs, "duration": duration}
            study = run_calibration(
                Scene.load(scene), runs_folder, seed=seed, breaks=breaks or "auto", **sizes, **common
            )
    study.rates.save(target)
    if report:
        calibration_report(study).write(report, data=True)
    if as_json:
        looks = study.diagnosis.looks
        echo_json(
            {
                "out": out,
                "channels": study.calibration.table(),
                "coarse_looks": {"sentence": looks.sentence, "channels": looks.table()} if looks.channels else None,
                "not_seen": not_seen(study.calibration),
                "not_measured": study.rates.not_measured,
                "breaks": None if study.break_models is None else study.break_models.to_dict(),
                "evidence": study.rates.evidence,
                "diagnostics": study.diagnosis.to_dict(),
                "problems": study.problems,
                "seed": None if events else seed,
            }
        )
    else:
        click.echo(rates_table(study))
        if study.break_models is not None:
            click.echo(breaks_table(study.break_models))
        click.echo(f"rates written to {out}")
    leave(study.problems)
