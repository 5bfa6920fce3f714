"""Commands that measure and check: `wellmixed calibrate`, `validate` and `demo`."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from kinetics.network import text_table
from kinetics.options import NumbersCommand, echo_json, in_a_folder, json_option
from mechsim.commands.options import PARTIAL, executor_options, progress_option, run_options

if TYPE_CHECKING:
    from calibration.study import CalibrationStudy, ValidationStudy
    from mechsim.commands.options import Part
    from mechsim.executors import Executor


def _seed(default: int) -> Any:
    return click.option(
        "--seed", type=click.IntRange(min=0), default=default, show_default=True, help="One seed, one result."
    )


report_option = click.option(
    "--report",
    type=click.Path(dir_okay=False),
    callback=in_a_folder,
    help="Write an HTML report to this file, its tables (CSV) and figures (SVG) beside it.",
)


@click.command()
@click.argument("scene")
@click.option(
    "--out",
    required=True,
    type=click.Path(dir_okay=False),
    callback=in_a_folder,
    help="The rates file to write (TOML).",
)
@click.option("--cubes", type=click.IntRange(min=1), default=60, show_default=True)
@click.option("--join-time", type=float, default=1000.0, show_default=True, help="tu for each mixture with bonding.")
@click.option("--break-time", type=float, default=4000.0, show_default=True, help="tu for each tank without bonding.")
@report_option
@run_options
@_seed(1)
@json_option
def calibrate(
    scene: str,
    out: str,
    cubes: int,
    join_time: float,
    break_time: float,
    report: str | None,
    runs_folder: str,
    workers: Executor,
    part: Part | None,
    progress: bool | None,
    seed: int,
    as_json: bool,
) -> None:
    """Measure the reaction rates of SCENE in mechanics runs and write them with 95 % intervals.

    Runs start from several mixtures and are put back after every event; breaks, being rare, are watched in tanks
    without bonding. Exit code 4: some runs were stopped by the guard or given up; the rates come from the others.
    """
    from calibration.study import calibration_specs, run_calibration
    from mechsim.scene import Scene

    target = Path(out)
    if target.suffix != ".toml":
        raise ValueError(f"--out {out}: expected a name that ends in .toml")
    described = Scene.load(scene)
    if part is not None:
        specs = calibration_specs(described, cubes, join_time, break_time, seed)
        part.make(specs, runs_folder, workers, progress, as_json)
        return
    study = run_calibration(
        described,
        runs_folder,
        cubes=cubes,
        join_time=join_time,
        break_time=break_time,
        seed=seed,
        workers=workers,
        progress=progress,
    )
    study.rates.save(target)
    if report:
        from calibration.overview import calibration_report

        calibration_report(study).write(report, data=True)
    if as_json:
        echo_json(
            {
                "out": out,
                "channels": study.calibration.table(),
                "evidence": study.rates.evidence,
                "diagnostics": study.diagnosis.table(),
                "problems": study.problems,
                "seed": seed,
            }
        )
    else:
        click.echo(_rates_table(study))
        click.echo(f"rates written to {out}")
    _leave(study.problems)


@click.command(cls=NumbersCommand)
@click.argument("scene")
@click.option("--rates", "rates_name", required=True, metavar="NAME|FILE", help="Rates: a .toml file, or table3.")
@click.option(
    "--cubes", type=click.IntRange(min=1), multiple=True, default=(60, 80, 120), show_default=True, metavar="N ..."
)
@click.option("--runs", type=click.IntRange(min=2), default=10, show_default=True, help="Held-out runs at each size.")
@click.option("--duration", type=float, default=2000.0, show_default=True, help="Of a run, tu.")
@report_option
@run_options
@_seed(2)
@json_option
def validate(
    scene: str,
    rates_name: str,
    cubes: tuple[int, ...],
    runs: int,
    duration: float,
    report: str | None,
    runs_folder: str,
    workers: Executor,
    part: Part | None,
    progress: bool | None,
    seed: int,
    as_json: bool,
) -> None:
    """Compare prediction and mechanics of SCENE in runs that the rates never saw.

    Coverage is the share of times and species at which the runs' mean lies in its predicted 95 % band; CRPS is the
    mean distance of a run from the predicted law, in copies, beside what the model scores against runs of its own.
    Exit code 4: some runs were stopped by the guard or given up.
    """
    from calibration.study import check_held_out, run_validation, validation_specs
    from kinetics.rates import Rates
    from mechsim.scene import Scene

    described, rates = Scene.load(scene), Rates.load(rates_name)
    check_held_out(described, rates, seed)
    if part is not None:
        part.make(validation_specs(described, cubes, runs, duration, seed), runs_folder, workers, progress, as_json)
        return
    study = run_validation(
        described,
        rates,
        runs_folder,
        sizes=cubes,
        runs=runs,
        duration=duration,
        seed=seed,
        workers=workers,
        progress=progress,
    )
    if report:
        from calibration.overview import validation_report

        validation_report(study).write(report, data=True)
    if as_json:
        echo_json(
            {
                "rates": rates_name,
                "duration": duration,
                "runs": runs,
                "seed": seed,
                "comparisons": [comparison.to_dict() for comparison in study.comparisons],
                "digest": study.outcome.digest,
                "problems": study.problems,
            }
        )
    else:
        click.echo(_comparison_table(study))
    _leave(study.problems)


@click.command()
@click.option("--folder", default="demo-output", show_default=True, type=click.Path(file_okay=False))
@click.option("--scale", type=float, default=1.0, show_default=True, help="Of all durations: 2 takes twice the time.")
@executor_options
@progress_option
@_seed(1)
@json_option
def demo(folder: str, scale: float, workers: Executor, progress: bool | None, seed: int, as_json: bool) -> None:
    """The whole loop on real mechanics and a small budget: rates, predictions, held-out runs, report.html."""
    from calibration.overview import full_report
    from calibration.study import run_calibration, run_validation, watched_run
    from mechsim.pictures.tank import draw_tank
    from mechsim.scene import Scene

    if not 0.1 <= scale <= 100:
        raise ValueError(f"--scale {scale}; expected a number from 0.1 to 100")
    place = Path(folder)
    place.mkdir(parents=True, exist_ok=True)
    scene, runs_folder = Scene.load("line4"), place / "runs"
    common: dict[str, Any] = {"workers": workers, "progress": progress}
    calibrated = run_calibration(scene, runs_folder, join_time=300 * scale, break_time=800 * scale, seed=seed, **common)
    rates_file = place / "rates.toml"
    calibrated.rates.save(rates_file)
    if not as_json:
        click.echo(_rates_table(calibrated))
    validated = run_validation(
        scene, calibrated.rates, runs_folder, runs=4, duration=200 * scale, seed=seed + 1, **common
    )
    record = watched_run(scene, runs_folder, duration=200 * scale, seed=seed + 1)
    report = full_report(calibrated, validated, lambda ax: draw_tank(record, ax))
    written = report.write(place / "report.html", data=True)[-1]
    if as_json:
        echo_json(
            {
                "rates": str(rates_file),
                "report": str(written),
                "channels": calibrated.calibration.table(),
                "summary": validated.summary(),
                "seed": seed,
            }
        )
    else:
        click.echo(_comparison_table(validated))
        click.echo(f"rates: {rates_file}   report: {written}")
    _leave(calibrated.problems + validated.problems)


def _rates_table(study: CalibrationStudy) -> str:
    """Rates with intervals, for people."""
    rows = [
        (
            row["channel"],
            f"{row['ways']:g}",
            f"{row['rate']:.3g}",
            f"{row['low']:.3g} to {row['high']:.3g}",
            str(row["events"]),
            f"{row['exposure']:.4g}",
        )
        for row in study.calibration.table()
    ]
    lines = [text_table(("channel", "ways", "rate (1/tu)", "95 % interval", "events", "exposure (tu)"), rows)]
    lines += [f"doubtful: {name}" for name in study.diagnosis.doubtful]
    lines.append(f"{len(study.sound)} mechanics runs, {study.cpu_seconds:.0f} s CPU")
    return "\n".join(lines)


def _comparison_table(study: ValidationStudy) -> str:
    """One line a size, for people."""
    rows = []
    for row in study.summary():
        first = ("-", "-", "-")
        if "first_mean" in row:
            seen = f"{row['runs'] - row['first_censored']} of {row['runs']}"
            observed = f"{row['first_observed']:.4g} [{row['first_low']:.4g}, {row['first_high']:.4g}]"
            error = f" ± {row['first_predicted_error']:.1g}" if row["first_predicted_error"] else ""
            first = (seen, observed, f"{row['first_predicted']:.4g}{error}")
        rows.append(
            (
                row["label"],
                str(row["runs"]),
                f"{row['coverage']:.0%}",
                f"{row['crps']:.3g} ({row['crps_floor']:.3g})",
                f"{row['p_crps']:.2g}",
                *first,
                f"{row['cpu_mechanics_s']:.0f}",
                f"{row['cpu_ssa_s']:.2g} ({row['ssa_runs']} runs)",
                "-" if math.isnan(row["cpu_exact_s"]) else f"{row['cpu_exact_s']:.2g}",
            )
        )
    titles = (
        *("size", "runs", "coverage", "CRPS (floor)", "p", "first seen", "mean wait (tu)", "predicted"),
        *("CPU mechanics (s)", "SSA", "exact"),
    )
    note = (
        "Coverage of a predicted 95 % band; waits for the first finished structure count to the end of a run at most."
    )
    if any(not comparison.is_exact for comparison in study.comparisons):
        note += "\nToo many states for the exact solution: predicted by SSA runs, ± one standard error of theirs."
    return text_table(titles, rows) + "\n" + note


def _leave(problems: list[str]) -> None:
    """Say what went wrong in single runs, with exit code 4."""
    for problem in problems:
        click.echo(f"left out: {problem}", err=True)
    if problems:
        click.get_current_context().exit(PARTIAL)
