"""The command `wellmixed runs export`: stored runs as tables."""

from __future__ import annotations

import click

from kinetics.support.cli.options import echo_json, json_option
from kinetics.support.packages import require
from mechsim.runs.store import RunStore


@click.command()
@click.argument("folder", type=click.Path(exists=True, file_okay=False))
@click.option("--out", required=True, metavar="FOLDER", type=click.Path(file_okay=False), help="Folder for the tables.")
@click.option(
    "--format",
    "formats",
    multiple=True,
    type=click.Choice(["parquet", "csv"]),
    default=("parquet", "csv"),
    help="File format of the tables; may be repeated.  [default: both]",
)
@click.option(
    "--rules", metavar="NAME", help="Only runs of this rule book; needed if the folder holds runs of several."
)
@click.option(
    "--every",
    metavar="TU",
    type=float,
    help="Write a table of counts too: what a camera sees that looks at 0, TU, 2 TU, ... until each run ends.",
)
@json_option
def export(
    folder: str, out: str, formats: tuple[str, ...], rules: str | None, every: float | None, as_json: bool
) -> None:
    """Write the runs kept in FOLDER as tables: events, runs, and the settings of the runs.

    The first two hold the completed runs as `wellmixed calibrate MODEL --events` reads them, see
    docs/observed_events.md. The third has a row for every run: its inputs, outcome and cost. With --every, a fourth,
    `counts`, has the completed runs as `wellmixed calibrate MODEL --counts` reads them, see docs/your_data.md. The
    command draws no random numbers.
    """
    for package in ("pandas", "pyarrow") if "parquet" in formats else ("pandas",):
        require(package)
    written = RunStore.found(folder).export(out, formats, rules, every)
    if as_json:
        echo_json({"folder": folder, "written": [str(path) for path in written]})
    else:
        for path in written:
            click.echo(str(path))
