"""The command `wellmixed export`: stored runs as tables."""

from __future__ import annotations

import click

from kinetics.support.cli.options import echo_json, json_option


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
@json_option
def export(folder: str, out: str, formats: tuple[str, ...], as_json: bool) -> None:
    """Write the runs kept in FOLDER as two tables: one of runs, one of events.

    The command draws no random numbers.
    """
    from mechsim.runs.store import RunStore

    written = RunStore.found(folder).export(out, formats)
    if as_json:
        echo_json({"folder": folder, "written": [str(path) for path in written]})
    else:
        for path in written:
            click.echo(str(path))
