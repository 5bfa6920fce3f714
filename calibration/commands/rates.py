"""The command `wellmixed study rates`: rates at each point of a study, from its runs."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from calibration.commands.shared import seed_option
from calibration.pipeline.by_point import PointRuns, most_seen, rates_by_point
from kinetics.support.cli.completion import shipped
from kinetics.support.cli.declared import count_option
from kinetics.support.cli.options import echo_json, json_option
from kinetics.support.output import write_whole
from kinetics.support.plots import save
from kinetics.support.tables import columns, csv_text, rounded
from mechsim.runs.store import RunStore
from mechsim.studies.study import Study

if TYPE_CHECKING:
    from calibration.pipeline.by_point import RatesByPoint

SHOWN = 3  # channels drawn, those with the most events


@click.command()
@click.argument("study", shell_complete=shipped("study"))
@count_option("--runs", help="Largest number of runs used at each point.  [default: the study's]")
@click.option(
    "--points",
    "choices",
    multiple=True,
    metavar="FACTOR=LEVEL,...",
    help="Use only the points with these levels; may be repeated, once for each factor.",
)
@click.option(
    "--runs-folder",
    default="runs",
    show_default=True,
    metavar="FOLDER",
    type=click.Path(exists=True, file_okay=False),
    help="Folder in which the runs of the study are kept.",
)
@click.option(
    "--out", metavar="FOLDER", type=click.Path(file_okay=False), help="Folder for the tables (CSV) and figures (SVG)."
)
@seed_option(1)
@json_option
def rates(
    study: str,
    runs: int | None,
    choices: tuple[str, ...],
    runs_folder: str,
    out: str | None,
    seed: int,
    as_json: bool,
) -> None:
    """Estimate the rates at each point of STUDY from runs of `wellmixed study first-times` with the same --seed.

    Points of one scene should have the same rates, whatever their number of cubes. The first times of each point are
    therefore compared with the first-passage distribution of the Markov chain under the rates of the other points.
    """
    described, store = Study.load(study), RunStore.found(runs_folder)
    points = []
    for point in described.chosen(choices):
        specs = point.specs(described.cap, runs or described.runs, seed)
        paths = tuple(record.path for record in store.existing(specs) if record.completed)
        if not paths:
            raise ValueError(
                f"{runs_folder} holds no run of {study} at {point.title} with seed {seed}; make them by: "
                f"wellmixed study first-times {study} --seed {seed} --runs-folder {runs_folder}"
            )
        points.append(PointRuns(point.title, point.scene.fingerprint, paths))
    found = rates_by_point(points, str(specs[0].until), described.cap, seed)
    written = _save(found, described.name, Path(out)) if out is not None else []
    tables = {"rates": found.rates_table(), "first_times": found.first_table()}
    if as_json:
        echo_json({"study": described.name, "species": found.species, "seed": seed} | tables | {"written": written})
    else:
        for rows in tables.values():
            if rows:
                click.echo(columns(rows) + "\n")
        for path in written:
            click.echo(path)


def _save(found: RatesByPoint, name: str, folder: Path) -> list[str]:
    """Both tables, and the figures, each whole or not at all."""
    folder.mkdir(parents=True, exist_ok=True)
    written = []
    for kind, rows in (("rates", found.rates_table()), ("predicted", found.first_table())):
        if rows:
            written.append(folder / f"{name}_{kind}.csv")
            write_whole(written[-1], csv_text(rounded(rows)))
    height = 1.2 + 0.3 * len(found.points)
    for i, channel in enumerate(most_seen(found)[:SHOWN]):
        written.append(folder / f"{name}_rate{i + 1}.svg")
        save(str(written[-1]), lambda ax, channel=channel: found.plot(ax, channel), size=(6.4, height))
    if predicted := found.first_table():
        written.append(folder / f"{name}_predicted.svg")
        save(str(written[-1]), found.plot_first, size=(6.4, 1.2 + 0.3 * len(predicted)))
    return [str(path) for path in written]
