"""The command `wellmixed trust accuracy mechanics`: error of the mechanics against CPU time."""

from __future__ import annotations

from typing import TYPE_CHECKING

import click

from kinetics.support.cli.completion import shipped
from kinetics.support.cli.declared import POSITIVE, count_option, default_option
from kinetics.support.cli.failures import INCOMPLETE
from kinetics.support.cli.options import csv_option, echo_json, in_a_folder, json_option, plot_option, seed_option
from kinetics.support.output import write_whole
from kinetics.support.packages import pd
from kinetics.support.plots import save
from mechsim.commands.options import engine_option, executor_options, progress_option, runs_option
from mechsim.runs.store import RunStore
from mechsim.scene import Scene

if TYPE_CHECKING:
    from mechsim.runs.executors import Executor


@click.command()
@click.argument("scene", shell_complete=shipped("scene"))
@count_option("--cubes", least=2, default=120, help="Number of single cubes in the tank.")
@default_option("--duration", metavar="T", type=float, default=50.0, help="Simulated time of a run, tu.")
@count_option("--rounds", default=4, help="Number of runs at each time step; other settings get half as many.")
@default_option(
    "--budget",
    metavar="MINUTES",
    type=POSITIVE,
    default=20.0,
    help="CPU time allowed, minutes; the same command continues from there.",
)
@click.option(
    "--presets",
    "presets_file",
    metavar="FILE",
    callback=in_a_folder,
    help="Write the presets that follow from the diagram to this TOML file.",
)
@engine_option
@runs_option
@csv_option
@plot_option
@executor_options
@progress_option
@seed_option
@json_option
def mechanics(
    scene: str,
    cubes: int,
    duration: float,
    rounds: int,
    budget: float,
    presets_file: str | None,
    engine: str | None,
    runs_folder: str,
    csv_files: tuple[str, ...],
    plot_files: tuple[str, ...],
    workers: Executor,
    progress: bool | None,
    seed: int,
    as_json: bool,
) -> None:
    """Measure the error of SCENE's mean speed, encounter rate and bond loads against CPU time, setting by setting.

    The result is a work-precision diagram. No bonds form or break. Encounters of single cubes' faces are counted, and,
    if bonds can break, also the hits on structures above half the threshold, which stand for the rarer breaks. Errors
    are relative to the scene at a quarter of its step and four times its solver iterations. The same command again
    reuses stored runs and continues where the budget ended. Exit code 4: some trials were given up.
    """
    from mechsim.accuracy.measuring import measure
    from mechsim.accuracy.plot import draw
    from mechsim.accuracy.preset import choose

    measured = measure(
        Scene.load(scene).by(engine),
        RunStore(runs_folder),
        cubes=cubes,
        duration=duration,
        rounds=rounds,
        budget=60 * budget,
        seed=seed,
        workers=workers,
        progress=progress,
        tell=lambda text: click.echo(text, err=as_json),
    )
    for csv_file in csv_files:
        write_whole(csv_file, pd.DataFrame(measured.rows()).to_csv(index=False, float_format="%.6g"))
    for plot_file in plot_files:
        save(plot_file, lambda ax: draw(measured, ax.figure), size=(5 * max(2, len(measured.means)), 8))
    if as_json:
        echo_json(measured.as_dict())
    else:
        click.echo(measured)
    if presets_file is not None:
        choose(measured).write(presets_file)
    if measured.given_up:
        click.get_current_context().exit(INCOMPLETE)
