"""The command `wellmixed study first-times`: first-passage times to the target against the settings of a scene."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING

import click

from kinetics.support.cli.completion import shipped
from kinetics.support.cli.declared import count_option
from kinetics.support.cli.failures import INCOMPLETE
from kinetics.support.cli.options import echo_json, json_option, seed_option
from mechsim.commands.options import run_options
from mechsim.runs.ensemble import run_all
from mechsim.runs.preflight import check_starts
from mechsim.runs.store import RunStore
from mechsim.studies.cost import predict, trial
from mechsim.studies.study import Study
from mechsim.studies.summary import summarise

if TYPE_CHECKING:
    from mechsim.commands.options import ShardWork
    from mechsim.runs.executors import Executor


@click.command()
@click.argument("study", shell_complete=shipped("study"))
@count_option("--runs", help="Number of runs at each point.  [default: the study's]")
@click.option(
    "--points",
    "choices",
    multiple=True,
    metavar="FACTOR=LEVEL,...",
    help="Use only the points with these levels; may be repeated, once for each factor.",
)
@click.option("--cost-only", is_flag=True, help="Predict the cost from a short trial of each point, and make no runs.")
@click.option("--collect", is_flag=True, help="Make no runs; summarise those in the runs folder.")
@click.option(
    "--out",
    metavar="FOLDER",
    type=click.Path(file_okay=False),
    help="Folder for the tables (CSV) and the box plots (SVG).",
)
@run_options
@seed_option
@json_option
def first_times(
    study: str,
    runs: int | None,
    choices: tuple[str, ...],
    cost_only: bool,
    collect: bool,
    out: str | None,
    runs_folder: str,
    workers: Executor,
    part: ShardWork | None,
    progress: bool | None,
    seed: int,
    as_json: bool,
) -> None:
    """Measure first-passage times to the target against the factors of STUDY, a shipped study or a TOML file.

    The shipped studies are velocity, number, size and interactions (the paper's section V), scale and similarity. A
    short trial of each point comes first and predicts the cost. A run ends at its first target or at the study's time
    limit and is kept in the runs folder; the same command again, or another study with the same points, makes only
    the runs that are missing. After Ctrl-C, --collect summarises the runs made so far. Exit code 4: some runs were
    stopped by the guard or given up.
    """
    if cost_only and collect:
        raise ValueError(
            "give either --cost-only or --collect: the first predicts the cost, the second summarises stored runs"
        )
    described = Study.load(study)
    points = described.chosen(choices)
    number = runs or described.runs
    # In rounds: wherever the work is interrupted, all points have nearly as many runs.
    by_point = [point.specs(described.cap, number, seed) for point in points]
    specs = [of_point[run] for run in range(number) for of_point in by_point]
    if part is not None:
        part.make(specs, runs_folder, workers, progress, as_json)
        return
    store = RunStore.found(runs_folder) if collect else RunStore(runs_folder)
    check_starts(specs[: len(points)])
    trials = {point: trial(point, seed) for point in points}
    report = {"study": described.name, "title": described.title, "seed": seed}
    if not collect:
        prediction = predict(described, points, trials, number, seed, store)
        click.echo(prediction, err=as_json)
        report["predicted_cpu_seconds"], report["at_most_cpu_seconds"] = prediction.cpu, prediction.most
    if cost_only:
        if as_json:
            echo_json(report | {"runs_to_make": prediction.missing})
        return
    if collect:
        records, given_up = store.existing(specs), 0
    else:
        outcome = run_all(specs, store, workers=workers, progress=progress)
        records, given_up = list(outcome.records), len(outcome.quarantined)
    result = summarise(described, points, trials, records, seed)
    written = []
    if out is not None:
        Path(out).mkdir(parents=True, exist_ok=True)
        written = [str(path) for path in result.save(Path(out))]
    stopped = sum(found.stopped for found in result.points)
    if as_json:
        shares = [asdict(share) for share in result.shares]
        tables = {name: rows for name, rows in result.tables().items() if name != "factors"}
        echo_json(report | tables | {"factors": shares, "why": result.why, "given_up": given_up, "written": written})
    else:
        click.echo(f"\n{result}")
        for path in written:
            click.echo(path)
        if stopped or given_up:
            click.echo(f"{stopped} runs stopped by the guard, {given_up} given up: none of them is counted above")
    if stopped or given_up:
        click.get_current_context().exit(INCOMPLETE)
