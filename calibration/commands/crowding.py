"""The command `wellmixed runs crowding`: hits and joins per exposure, tank by tank, under each model of crowding."""

from __future__ import annotations

from typing import Any

import click

from calibration.estimating.crowding_comparison import CrowdingComparison
from calibration.pipeline.logged_hits import bodies_in, logged_hits
from kinetics.support.cli.declared import files_option
from kinetics.support.cli.options import csv_option, echo_json, json_option, picture_of, write_plots, write_tables
from kinetics.support.packages import pd
from mechsim.inspection.poses import records_at


@click.command()
@click.argument("runs", nargs=-1, required=True, type=click.Path(exists=True))
@click.option(
    "--above",
    "levels",
    multiple=True,
    metavar="LOAD",
    type=click.FloatRange(min=0, min_open=True),
    help="Count hits above this load; may be repeated.  [default: all logged, and those that break a bond]",
)
@files_option(
    "--plot", "plot_files", callback=picture_of, help="Draw events per exposure by tank and model; may be repeated."
)
@csv_option
@json_option
def crowding(runs: tuple[str, ...], levels: tuple[float, ...], plot_files: Any, csv_files: Any, as_json: bool) -> None:
    """Test models of crowding on the logged hits and the joins of RUNS, folders of runs or KEY.run files.

    For each model, hits by bodies, hits by walls and joins are counted per exposure in each kind of tank and engine. A
    model is right if all tanks have one rate: the table gives chi-square, its degrees of freedom and its p-value given
    the scatter between runs of one tank. Hits on structures are counted; runs have a log of them if their scene's
    effect breaking has log_above. Runs without a log, or stopped by the guard, are left out. The command draws no
    random numbers. See docs/crowding.md.
    """
    records = records_at(runs)
    hits = logged_hits(records)
    if not hits:
        raise ValueError(
            f"{', '.join(runs)}: none of {len(records)} runs has a log of hits; expected runs of a scene whose effect "
            "breaking has log_above"
        )
    found = CrowdingComparison.of(hits, bodies_in(records[0]), levels)
    write_plots(plot_files, found.plot)
    write_tables(csv_files, lambda: pd.DataFrame(found.table()))
    left_out = len(records) - len(found.runs)
    if as_json:
        echo_json(found.to_dict() | {"left_out": left_out})
    else:
        click.echo(str(found))
        if left_out:
            click.echo(f"{left_out} runs without a log, or stopped, are left out")
