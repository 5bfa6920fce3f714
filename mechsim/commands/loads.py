"""The command `wellmixed runs loads`: rates of breaks at any threshold, from the hits that runs have logged."""

from __future__ import annotations

import click

from kinetics.support.cli.declared import files_option
from kinetics.support.cli.options import echo_json, json_option, picture_of, write_plots
from mechsim.inspection.poses import records_at


@click.command()
@click.argument("runs", nargs=-1, required=True, type=click.Path(exists=True))
@click.option(
    "--at",
    "thresholds",
    multiple=True,
    metavar="LOAD",
    type=click.FloatRange(min=0, min_open=True),
    help="Threshold at which to extrapolate rates of breaks; may be repeated.  [default: that of the runs]",
)
@files_option(
    "--plot", "plot_files", callback=picture_of, help="Draw the tails of loads by struck species; may be repeated."
)
@json_option
def loads(runs: tuple[str, ...], thresholds: tuple[float, ...], plot_files: tuple[str, ...], as_json: bool) -> None:
    """Measure rates of hits and of breaks from the logs of RUNS, folders of runs or KEY.run files.

    A run has a log if its scene's effect breaking has log_above. The table gives the rate of hits above several loads,
    the exponent with which hits grow with the partner's size, and the rate of breaks at the threshold, extrapolated
    from the tail of loads, with 95 % intervals and a check that several levels agree. Exposures are counted in each
    run's own tank, as mass action has it; `wellmixed runs crowding` tests that. Runs without a log, or stopped by the
    guard, are left out. The command draws no random numbers.
    """
    from mechsim.inspection.tail_extrapolation.report import extrapolate, plot_tails

    records = records_at(runs)
    logged = [record for record in records if record.completed and "load_value" in record.arrays]
    if not logged:
        raise ValueError(
            f"{', '.join(runs)}: none of {len(records)} runs has a log of hits; expected runs of a scene whose effect "
            "breaking has log_above"
        )
    found = extrapolate(logged, thresholds)
    write_plots(plot_files, lambda ax: plot_tails(ax, found))
    if as_json:
        echo_json(found.as_dict() | {"left_out": len(records) - len(logged)})
    else:
        click.echo(str(found))
        if len(logged) < len(records):
            click.echo(f"\n{len(records) - len(logged)} runs without a log, or stopped, are left out")
