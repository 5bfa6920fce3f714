"""The command `wellmixed demo`: calibration, prediction and validation on a small budget."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from calibration.commands.shared import leave, seed_option
from calibration.commands.tables import comparison_table, rates_table
from calibration.pipeline.calibration_study import run_calibration
from calibration.pipeline.held_out_study import run_validation
from calibration.pipeline.study_runs import StudyRuns, pictured_run
from calibration.reporting.overview import full_report
from kinetics.support.cli.declared import default_option
from kinetics.support.cli.failures import keep_runs
from kinetics.support.cli.options import echo_json, json_option
from mechsim.commands.options import engine_option, executor_options, progress_option
from mechsim.inspection.pictures.tank import draw_tank
from mechsim.scene import Scene

if TYPE_CHECKING:
    from mechsim.runs.executors import Executor

CALIBRATED, HELD_OUT = 225.0, 150.0  # tu a run
# CPU time of the whole demonstration on one core of 2026, s: of its runs, by engine, and of all else
SECONDS, REST = {"pybullet": 107.0, "own": 31.0}, 11.0


@click.command()
@default_option(
    "--folder",
    default="demo-output",
    metavar="FOLDER",
    type=click.Path(file_okay=False),
    help="Folder to which the results are written.",
)
@default_option(
    "--scale",
    metavar="FACTOR",
    type=float,
    default=1.0,
    help="Factor by which all simulated times are multiplied; 2 takes twice as long.",
)
@engine_option
@executor_options
@progress_option
@seed_option(1)
@json_option
def demo(
    folder: str,
    scale: float,
    engine: str | None,
    workers: Executor,
    progress: bool | None,
    seed: int,
    as_json: bool,
) -> None:
    """Calibrate, predict and validate line4 on a small budget of mechanics runs, and write report.html.

    The first line of the output says about how long it takes. Runs are stored; the same command makes only those that
    are missing.
    """

    if not 0.02 <= scale <= 100:
        raise ValueError(f"--scale {scale}; expected a number from 0.02 to 100")
    place = Path(folder)
    place.mkdir(parents=True, exist_ok=True)
    scene, runs_folder = Scene.load("line4").by(engine), place / "runs"
    if not as_json:
        click.echo(how_long(scale, scene.numerics.engine))
    keep_runs(runs_folder)
    common: dict[str, Any] = {"workers": workers, "progress": progress}
    calibrated = run_calibration(StudyRuns.assembly(scene, [60], 10, CALIBRATED * scale, seed), runs_folder, **common)
    rates_file = place / "rates.toml"
    calibrated.rates.save(rates_file)
    if not as_json:
        click.echo(rates_table(calibrated))
    held_out = StudyRuns.assembly(scene, [60, 80, 120], 4, HELD_OUT * scale, seed + 1)
    validated = run_validation(held_out, calibrated.rates, runs_folder, **common)
    record = pictured_run(scene, runs_folder, duration=HELD_OUT * scale, seed=seed + 1)
    report = full_report(calibrated, validated, lambda ax: draw_tank(record, ax))
    written = report.write(place / "report.html", data=True)[-1]
    if as_json:
        echo_json(
            {
                "rates": str(rates_file),
                "report": str(written),
                "channels": calibrated.calibration.table(),
                "not_seen": calibrated.calibration.not_seen,
                "is_consistent": validated.is_consistent,
                "verdict": validated.verdict.sentence,
                "events": [row.to_dict() for row in validated.events],
                "summary": validated.summary(),
                "seed": seed,
            }
        )
    else:
        click.echo(comparison_table(validated))
        click.echo(f"rates: {rates_file}   report: {written}")
    leave([*calibrated.problems, *validated.outcome.problems])


def how_long(scale: float, engine: str) -> str:
    """A line on the time that the demonstration takes on one core and on two; measured, so only about right.

    scale : of all simulated times
    engine : that of the scene

    >>> from calibration.commands.demo import how_long
    >>> how_long(1.0, "pybullet")
    'This takes about 2 min with one worker, 1.1 min with --workers 2.'
    >>> how_long(0.05, "own")
    'This takes about 13 s with one worker, 12 s with --workers 2.'
    """
    runs = scale * SECONDS[engine]
    alone, shared = (_duration(REST + runs / workers) for workers in (1, 2))
    return f"This takes about {alone} with one worker, {shared} with --workers 2."


def _duration(seconds: float) -> str:
    """Two figures, in seconds or minutes."""
    return f"{seconds:.2g} s" if seconds < 60 else f"{seconds / 60:.2g} min"
