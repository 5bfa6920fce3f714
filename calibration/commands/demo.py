"""The command `wellmixed demo`: calibration, prediction and validation on a small budget."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from calibration.commands.shared import comparison_table, leave, rates_table, seed_option
from calibration.pipeline.calibration_study import run_calibration
from calibration.pipeline.held_out_study import run_validation
from calibration.pipeline.study_runs import pictured_run
from calibration.reporting.overview import full_report, not_seen
from kinetics.support.cli.failures import keep_runs
from kinetics.support.cli.options import echo_json, json_option
from mechsim.commands.options import executor_options, progress_option
from mechsim.scene import Scene

if TYPE_CHECKING:
    from mechsim.runs.executors import Executor


@click.command()
@click.option(
    "--folder",
    default="demo-output",
    show_default=True,
    metavar="FOLDER",
    type=click.Path(file_okay=False),
    help="Folder to which the results are written.",
)
@click.option(
    "--scale",
    metavar="FACTOR",
    type=float,
    default=1.0,
    show_default=True,
    help="Factor by which all simulated times are multiplied; 2 takes twice as long.",
)
@executor_options
@progress_option
@seed_option(1)
@json_option
def demo(folder: str, scale: float, workers: Executor, progress: bool | None, seed: int, as_json: bool) -> None:
    """Calibrate, predict and validate line4 on a small budget of mechanics runs, and write report.html."""
    from mechsim.inspection.pictures.tank import draw_tank

    if not 0.02 <= scale <= 100:
        raise ValueError(f"--scale {scale}; expected a number from 0.02 to 100")
    place = Path(folder)
    place.mkdir(parents=True, exist_ok=True)
    scene, runs_folder = Scene.load("line4"), place / "runs"
    keep_runs(runs_folder)
    common: dict[str, Any] = {"workers": workers, "progress": progress}
    calibrated = run_calibration(scene, runs_folder, runs=10, duration=300 * scale, seed=seed, **common)
    rates_file = place / "rates.toml"
    calibrated.rates.save(rates_file)
    if not as_json:
        click.echo(rates_table(calibrated))
    validated = run_validation(
        scene, calibrated.rates, runs_folder, runs=4, duration=200 * scale, seed=seed + 1, **common
    )
    record = pictured_run(scene, runs_folder, duration=200 * scale, seed=seed + 1)
    report = full_report(calibrated, validated, lambda ax: draw_tank(record, ax))
    written = report.write(place / "report.html", data=True)[-1]
    if as_json:
        echo_json(
            {
                "rates": str(rates_file),
                "report": str(written),
                "channels": calibrated.calibration.table(),
                "not_seen": not_seen(calibrated.calibration),
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
    leave(calibrated.problems + validated.problems)
