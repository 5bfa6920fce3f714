"""The command `wellmixed study plan`: which runs a study needs, and what they will show."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from calibration.commands.shared import Decorator, out_option, seed_option, sizes_option, time_option
from calibration.pipeline.pilot import Pilot
from calibration.pipeline.planned import PlanRequest
from calibration.pipeline.planner import make_plan
from calibration.pipeline.run_costs import RunCosts
from kinetics.rates import Rates
from kinetics.support.cli.completion import shipped
from kinetics.support.cli.declared import POSITIVE, default_option
from kinetics.support.cli.options import NumbersCommand, echo_json, json_option, plot_option
from kinetics.support.cli.progress import progress_line
from kinetics.support.cli.study_folder import PLAN, RUNS, SCENE, or_study_folder
from kinetics.support.plots import save
from mechsim.commands.options import executor_options, progress_option, runs_option
from mechsim.scene import Scene
from mechsim.world.engines import ENGINES

if TYPE_CHECKING:
    from mechsim.runs.executors import Executor


class Percentage(click.ParamType[float]):
    """A share between 0 and 1: `10%` or 0.1."""

    name = "percentage"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> float:
        """The share as a number between 0 and 1."""
        text = str(value).strip()
        try:
            share = float(text.removesuffix("%")) / (100 if text.endswith("%") else 1)
        except ValueError:
            share = float("nan")
        if not 0 < share < 1:
            self.fail(f"{value} is no share between 0 and 1, such as 10%", param, ctx)
        return share


def share_option(name: str, default: str, text: str) -> Decorator:
    """An option that takes a share."""
    return default_option(name, metavar="PERCENT", type=Percentage(), default=default, help=text)


ASKED = (
    share_option("--width", "10%", "Half-width of the 95 % interval of every join's rate and of all breaks together."),
    share_option("--shift", "20%", "Error in the rates of joins, or of breaks, that the held-out runs must detect."),
    share_option("--power", "90%", "Probability with which they must detect it, at level 1 %."),
    click.option(
        "--cpu-hours",
        metavar="H",
        type=POSITIVE,
        help="CPU time for all runs of the plan, hours.  [default: as much as it takes]",
    ),
    default_option(
        "--along",
        type=click.FloatRange(min=0),
        multiple=True,
        default=(0.0, 50.0, 200.0, 800.0, 2000.0),
        metavar="T ...",
        help="Times on the predicted path from which tanks may be taken, tu.",
    ),
    click.option(
        "--engine",
        type=click.Choice([engine.name for engine in ENGINES]),
        help="Engine of the mechanics for all runs; the plan says what another would save.  [default: the scene's]",
    ),
    time_option("--duration", 500.0, "Length of a calibration run, tu."),
    time_option("--held-out-duration", 2000.0, "Length of a held-out run, tu."),
)


def asked_of_a_plan(command: Callable[..., None]) -> Any:
    """The options that say what a plan is to reach, for the commands that make one."""
    decorated: Any = command
    for option in reversed(ASKED):
        decorated = option(decorated)
    return decorated


@click.command(cls=NumbersCommand)
@click.argument(
    "scene",
    metavar="SCENE|FOLDER",
    shell_complete=shipped("scene"),
    **or_study_folder(SCENE, {"runs_folder": RUNS, "out": PLAN}),
)
@out_option("The plan to write (TOML); calibrate and validate then carry it out.")
@asked_of_a_plan
@click.option(
    "--rates",
    "rates_name",
    metavar="NAME|FILE",
    shell_complete=shipped("rates"),
    help="Pilot rates, for predicting the path.  [default: from short pilot runs of the mechanics]",
)
@sizes_option("--cubes", "Numbers of cubes of the calibration.", default=(60, 120))
@click.option("--each-break", is_flag=True, help="Reach the width for each break, not only for all of them together.")
@sizes_option("--held-out", "Numbers of cubes of the held-out runs.", default=(40, 80, 160))
@click.option(
    "--tank", metavar="X Y Z", type=float, nargs=3, help="Edge lengths of the tank of all runs.  [default: the scene's]"
)
@time_option("--pilot-time", 500.0, "Length of a pilot run, tu; there are four at each number of cubes.")
@click.option("--strict", is_flag=True, help="Exit with code 2 if the plan falls short of the request.")
@plot_option
@runs_option
@executor_options
@progress_option
@seed_option(1)
@json_option
def plan(
    scene: str,
    out: str,
    rates_name: str | None,
    pilot_time: float,
    strict: bool,
    plot_files: tuple[str, ...],
    runs_folder: str,
    workers: Executor,
    progress: bool | None,
    seed: int,
    as_json: bool,
    **wanted: Any,
) -> None:
    """Plan the runs of a study of SCENE: tanks, runs, and held-out runs with the power to detect wrong rates.

    Tanks are taken from the assembly path that pilot rates predict. A linear programme then finds the cheapest runs
    that measure every rate to the requested width. There are as many held-out runs as give the test of seen over
    expected events its power, with the calibration's own uncertainty included. Costs come from similar stored runs or
    from a short trial, and so depend on the machine. If the budget is too small, the plan that fits is written, with a
    note on where it falls short.
    """

    request = PlanRequest(name=Path(out).stem, scene=scene, seed=seed, **wanted)
    costs = RunCosts(runs_folder)
    if rates_name is not None:
        rates = Rates.load(rates_name)
    else:
        pilot = Pilot(Scene.load(scene), request.cubes, pilot_time, seed + 2)
        click.echo(f"pilot: {pilot.described(costs)}", err=True)
        rates = pilot.rates(runs_folder, workers=workers, progress=progress)
    with progress_line(progress):
        planned = make_plan(request, rates, costs)
    planned.plan.save(out)
    for plot_file in plot_files:
        save(plot_file, planned.plot, size=(7.5, 4.5))
    if as_json:
        echo_json(planned.to_dict() | {"out": out, "seed": seed})
    else:
        click.echo(planned.tables())
        click.echo(f"plan written to {out}")
    for shortfall in planned.shortfalls:
        click.echo(f"falls short: {shortfall}", err=True)
    if strict and planned.shortfalls:
        click.get_current_context().exit(2)
