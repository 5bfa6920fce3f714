"""`wellmixed trust accuracy kinetics`: the error of every prediction method against its CPU time."""

from __future__ import annotations

import click
import numpy as np

from kinetics.commands.models import applied, conditions, described
from kinetics.support.cli.declared import POSITIVE, default_option
from kinetics.support.cli.failures import INTERRUPTED
from kinetics.support.cli.options import (
    DURATION,
    HeadedCommand,
    ModelOptions,
    csv_option,
    echo_json,
    json_option,
    model_options,
    plot_option,
    seed_option,
    write_tables,
)
from kinetics.support.cli.progress import progress_line
from kinetics.support.plots import save
from kinetics.trust.accuracy.diagram import measure
from kinetics.trust.accuracy.plot import draw

TIMES = 101  # at which distributions are compared


@click.command(cls=HeadedCommand)
@model_options
@default_option(
    "--duration", metavar="T", type=float, default=DURATION, help="Time span over which the methods are compared, tu."
)
@default_option(
    "--budget",
    metavar="MINUTES",
    type=POSITIVE,
    default=20.0,
    help="CPU time allowed, minutes; the most expensive settings are skipped if they would exceed it.",
)
@csv_option
@plot_option
@seed_option
@json_option
def kinetics(
    asked: ModelOptions,
    duration: float,
    budget: float,
    csv_files: tuple[str, ...],
    plot_files: tuple[str, ...],
    seed: int,
    as_json: bool,
) -> None:
    """Measure every prediction method's error against its CPU time.

    NETWORK, --rates and --cubes are as for `predict`. The error is the largest Wasserstein distance, in copies, between
    the distribution of a species' count and the exact one, over 101 times and all species. The comparison covers
    sampling with 10^2 to 10^6 runs, the master equation at tolerances from 1e-2 to 1e-12, SciPy's solvers, and the rate
    equation, each in a single thread. Ctrl-C ends the comparison and reports what was finished.
    """
    if not 0 < duration < np.inf:
        raise ValueError(f"--duration {duration:g}; expected a positive number of tu")
    given = described(asked)
    model = applied(*given)
    counts = ", ".join(
        f"{name}={n}" for name, n in zip(model.network.species, model.initial.tolist(), strict=True) if n
    )
    with progress_line() as progress:
        made = measure(
            f"{asked.source}, {counts}", model, None, np.linspace(0.0, duration, TIMES), seed=seed,
            budget=60 * budget, report=lambda text: click.echo(text, err=as_json), progress=progress,
        )  # fmt: skip
    write_tables(csv_files, made.to_dataframe, float_format="%.6g")
    for plot_file in plot_files:
        save(plot_file, lambda ax: draw(made, ax), size=(8.0, 5.0))
    if as_json:
        echo_json({"rates": asked.rates_name, **conditions(*given), **made.as_dict()})
    else:
        click.echo(str(made))
    if not made.is_complete:
        raise SystemExit(INTERRUPTED)
