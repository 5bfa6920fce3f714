"""`wellmixed scan`: questions at every point of a grid of parameters, rate constants and counts."""

from __future__ import annotations

import click

from kinetics.commands.models import applied, conditions, described, is_network_file, remarks
from kinetics.predicting.scanning import read_values
from kinetics.predicting.scanning import scan as make
from kinetics.predicting.scanning.answering import tell_questions
from kinetics.predicting.scanning.pictures import draw_scan, size_of
from kinetics.support import plots
from kinetics.support.cli.declared import count_option, default_option, files_option
from kinetics.support.cli.failures import CHECKED, INTERRUPTED, keep
from kinetics.support.cli.options import (
    HeadedCommand,
    ModelOptions,
    budget_option,
    csv_option,
    echo_json,
    json_option,
    model_options,
    page_option,
    plot_option,
    seed_option,
    table_of,
    truncate_option,
    write_tables,
)
from kinetics.support.cli.progress import progress_line
from kinetics.support.output import write_whole


@click.command(cls=HeadedCommand)
@model_options
@click.option(
    "--over",
    "ranges",
    metavar="NAME=VALUES",
    multiple=True,
    required=True,
    help="Values a,b,c or low:high:n (also nlin, nlog) of a parameter, a channel's rate constant, a species' count at "
    "time 0, or cubes; may be repeated.",
)
@click.option(
    "--ask",
    "questions",
    metavar="QUESTION",
    multiple=True,
    required=True,
    help="Ask this at every point, as in 'E[AB] @ 100' (mean; also var, sd, and q0.9 for a quantile) or "
    "'P=? [ F<=100 AB >= 5 ]'; may be repeated.",
)
@truncate_option
@count_option(
    "--max-states", least=0, default=100_000, help="Sample points that can reach more states than this; 0 samples all."
)
@count_option("--runs", least=2, default=1000, help="Number of runs of each point that is sampled.")
@count_option("--workers", default=1, help="Number of points answered at the same time, as processes on this machine.")
@click.option(
    "--scheduler",
    metavar="ADDRESS",
    help="Answer points on the workers of the Dask cluster whose scheduler is at this address, as tcp://10.0.0.5:8786.",
)
@default_option(
    "--scans-folder",
    "folder",
    metavar="FOLDER",
    type=click.Path(file_okay=False),
    default="scans",
    help="Folder in which points are kept; a point that is already there is not answered again.",
)
@csv_option
@files_option(
    "--parquet",
    "parquet_files",
    callback=table_of("pandas", "pyarrow"),
    help="Write the table to this Parquet file; may be repeated.",
)
@plot_option
@page_option("picture over the first one or two names, sliders for the others, bounds where one points")
@budget_option
@seed_option
@json_option
def scan(
    asked: ModelOptions,
    ranges: tuple[str, ...],
    questions: tuple[str, ...],
    truncate: str | int | None,
    max_states: int,
    runs: int,
    workers: int,
    scheduler: str | None,
    folder: str,
    csv_files: tuple[str, ...],
    parquet_files: tuple[str, ...],
    plot_files: tuple[str, ...],
    html_files: tuple[str, ...],
    budget: float,
    seed: int,
    as_json: bool,
) -> None:
    """Answer questions at every combination of values, exactly if the states can be enumerated, otherwise by sampling.

    NETWORK is a rule book, which needs --rates and --cubes (or --over cubes=...), or a network file that contains both.
    Questions are those of `wellmixed ask`. Exact answers have bounds that are proven unless the column `kind` says
    otherwise; sampled ones have a 95 % interval. The cost is forecast from the first points. Points are stored as they
    are answered: after Ctrl-C, or with a larger grid, the same command answers only those that are missing. Exit code
    1: a question has no answer at some points, for which the table says why.
    """
    over = {}
    for text in ranges:
        name, values = read_values(text)
        if name in over:
            raise ValueError(f"--over {name} came twice; give all of its values at once")
        over[name] = values
    tell_questions(questions)
    both = [name for name in over if name in asked.chosen]
    if both:
        raise ValueError(f"--set {both[0]} and --over {both[0]}: a name is set, or scanned; leave one out")
    is_open = asked.cubes is None and asked.initial is None
    if is_open and "cubes" in over and not is_network_file(asked.source):
        asked = asked._replace(cubes=max(1, int(over["cubes"][0])))  # the scan checks all of them
    given = described(asked)
    model = applied(*given)
    keep(f"answered points are stored in {folder}; the same command continues from there")
    with progress_line(budget=budget) as progress:
        made = make(
            model,
            over,
            questions,
            max_states=max_states,
            truncate=truncate,
            runs=runs,
            seed=seed,
            workers=workers if scheduler is None else scheduler,
            folder=folder,
            progress=progress,
        )
    write_tables(csv_files, made.to_dataframe)
    for parquet_file in parquet_files:
        write_whole(parquet_file, made.to_dataframe().to_parquet(index=False))
    for plot_file in plot_files:
        plots.save_figure(plot_file, lambda figure: draw_scan(figure, made), size_of(made))
    for html_file in html_files:
        made.save_page(html_file)
    if as_json:
        echo_json(
            {
                "model": asked.source,
                "rates": asked.rates_name,
                **conditions(*given),
                "over": dict(made.over),
                "questions": made.questions,
                "max_states": max_states,
                "truncate": truncate,
                "runs": runs,
                "seed": seed,
                "points": len(made.answers),
                "complete": made.is_complete,
                "rows": made.rows,
                "notes": model.notes,
                "cpu_seconds": made.cpu_seconds,
            }
        )
    else:
        click.echo("\n".join([str(made), *remarks(*given)]))
    if not made.is_complete:
        done = sum(answers is not None for answers in made.answers)
        click.echo(
            f"Interrupted: {done} of {len(made.answers)} points are answered and stored in {folder}; the same "
            f"command continues from there.",
            err=True,
        )
        raise SystemExit(INTERRUPTED)
    if made.unanswered:
        raise SystemExit(CHECKED)
