"""`wellmixed predict`: the counts of all species over time, by a Markov chain."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING

import click
import numpy as np
from click.core import ParameterSource

from kinetics.commands.methods import MethodName, within_budget
from kinetics.commands.models import conditions, described, instead_of_many_states, is_network_file, remarks, shown_of
from kinetics.commands.until import EndingRuns, first_times_data, first_times_text
from kinetics.predicting import AskedAccuracy, Job, predict_job
from kinetics.predicting.pictures import draw_prediction, size_of
from kinetics.predicting.prediction import RUNS
from kinetics.sampling.methods import BY_NAME as SAMPLING
from kinetics.sampling.watch import MAX_EVENTS
from kinetics.support import plots
from kinetics.support.cli.declared import count_option, default_option, files_option
from kinetics.support.cli.failures import INCOMPLETE, INTERRUPTED
from kinetics.support.cli.options import (
    DURATION,
    HEADING,
    RULES,
    ModelOptions,
    NumbersCommand,
    budget_option,
    csv_option,
    echo_json,
    heading,
    json_option,
    model_options,
    page_option,
    picture_of,
    plot_option,
    seed_option,
    table_of,
    time_grid,
    write_plots,
    write_tables,
)
from kinetics.support.cli.progress import progress_line
from kinetics.support.tables import figure, in_unit, text_table

if TYPE_CHECKING:
    from kinetics.network import Model
    from kinetics.predicting import AskedAccuracy, Elasticities, Prediction
    from kinetics.predicting.duration import ChosenDuration
    from kinetics.rates.applied import AppliedRates

INSTEAD = (
    "Keep only the likely states by --method fsp, start from smaller counts, or leave out --method to sample",
    "Ask for earlier times, start from smaller counts, or leave out --method to sample",
)  # of the others, and of fsp


@click.command(cls=NumbersCommand)
@model_options
@click.option(
    "--duration",
    metavar="T",
    type=float,
    help="Predict from time 0 to this time, tu or the model's own.  [default: 2000 for a rule book; chosen from the "
    "rates for a network file]",
)
@click.option("--times", type=float, multiple=True, metavar="T ...", help="Predict at these times instead.")
@click.option(
    "--show", "shown", multiple=True, metavar="NAME", help="Show only this species or observable; may be repeated."
)
@click.option("--method", type=MethodName(), help="Sampling or solving method, or mean-field.  [default: auto]")
@count_option(
    "--runs",
    help="Minimum number of runs of a sampling method; if the rates have evidence, 100 for each draw of the rates.  "
    "[default: 1000]",
)
@click.option(
    "--accuracy",
    metavar="SIZE",
    help="Choose method and number of runs so that every value shown is within SIZE: 1%, or 0.5 copies.",
)
@default_option(
    "--accuracy-of",
    type=click.Choice(("mean", "sd", "distribution")),
    default="mean",
    help="Quantity whose error --accuracy limits.",
)
@budget_option
@count_option(
    "--max-events",
    default=MAX_EVENTS,
    help="Maximum number of events in a run; results end where a run would exceed it.",
)
@count_option(
    "--trajectories",
    default=0,
    least=0,
    help="Number of single runs to sample as well, with every event, for --plot (thin steps), --trajectories-csv and "
    "--json.",
)
@files_option(
    "--trajectories-csv",
    "trajectories_files",
    callback=table_of("pandas"),
    help="Write every event of these single runs to this CSV file; may be repeated.",
)
@click.option(
    "--until",
    metavar="CONDITION",
    help="Report too when this condition on counts first holds, as in 'AB >= 8 & A < 15', from as many runs, which end "
    "there.",
)
@count_option("--threads", help="Largest number of threads used.  [default: one per core]")
@heading(RULES)
@count_option(
    "--posterior-draws",
    "draws",
    least=2,
    default=200,
    help="Minimum number of posterior draws of the rates, for the runs and the interval.",
)
@click.option(
    "--elasticity",
    "with_elasticity",
    is_flag=True,
    help="Report the elasticity of each mean at the last time by each parameter of the rates.",
)
@files_option(
    "--elasticity-plot",
    "elasticity_files",
    callback=picture_of,
    help="Write a bar chart of these elasticities to this PNG, PDF or SVG file; may be repeated.",
)
@heading(HEADING)
@csv_option
@plot_option
@page_option("picture with values where one points, and a table of the last ones")
@seed_option
@json_option
def predict(
    asked: ModelOptions,
    duration: float | None,
    times: tuple[float, ...],
    shown: tuple[str, ...],
    method: str | None,
    runs: int | None,
    accuracy: str | None,
    accuracy_of: str,
    budget: float,
    max_events: int,
    trajectories: int,
    trajectories_files: tuple[str, ...],
    until: str | None,
    threads: int | None,
    draws: int,
    with_elasticity: bool,
    elasticity_files: tuple[str, ...],
    csv_files: tuple[str, ...],
    plot_files: tuple[str, ...],
    html_files: tuple[str, ...],
    seed: int,
    as_json: bool,
) -> None:
    """Predict the counts of all species over time, for a rule book or a network file, by a Markov chain.

    NETWORK is a rule book, which needs --rates and --cubes, or a network file that contains both (BioNetGen .net, SBML
    and others). The report gives mean and standard deviation of every species. If the rates come with their events and
    exposure, runs are spread over draws of the rates from their posterior, and the mean has a 95 % interval; a method
    that solves takes the posterior mean of each rate constant. The method `auto` samples runs by the method expected
    to be cheapest; `transient` solves the master equation; `mean-field` integrates the rate equations, an approximation
    without a bound, and reports its distance from the exact mean if that is cheap to solve. Runs are not stored, so
    there may be millions; Ctrl-C reports those made so far.

    With --accuracy the method and the number of runs are chosen: the solution with its proven error, or runs until they
    are enough, in 20 minutes of CPU time unless --budget says otherwise. 1% is relative to each species' largest mean
    over the times, or to one copy if that is more. The report says what was chosen, what each method was forecast to
    cost, the error reached, and what a tenth of the error would cost.

    A run that would not end, because counts grow without bound or events come too fast, is truncated; results are given
    for the times before, with a note. Exit code 4: there are fewer times than requested.
    """
    is_default = click.get_current_context().get_parameter_source("budget") is ParameterSource.DEFAULT
    asked_for = _accuracy(accuracy, accuracy_of, None if is_default else 60 * budget)
    model, rates = given = described(asked)
    if (with_elasticity or elasticity_files) and rates is None:
        raise ValueError(f"elasticities are by the parameters of a rates file; {asked.source} has its own rates")
    picked = None if times or duration is not None or not is_network_file(asked.source) else _duration(model, rates)
    grid = time_grid(duration if picked is None else picked.value, times)
    sums = shown_of(model, shown)
    if asked_for is not None and method is not None:
        raise ValueError(f"--method {method} together with --accuracy, which chooses the method: give one or the other")
    chosen = asked_for if method is None else within_budget(method, 60 * budget)
    _check_runs(trajectories, trajectories_files, until, method)
    with progress_line(budget=budget) as progress, instead_of_many_states(INSTEAD[method == "fsp"]):
        job = Job(model, grid, sums, seed, threads, progress, max_events, trajectories)
        ending = None if until is None else EndingRuns.of(replace(job, model=_at_mean(model, rates)), method, until)
        made = predict_job(job, rates, chosen, runs, draws)
        first, is_complete = None, made.is_complete
        if ending is not None and is_complete:
            try:
                first = ending.first_times(RUNS if runs is None else runs, float(made.times[-1]))
            except KeyboardInterrupt:
                is_complete = False
        found = None
        if rates is not None and (with_elasticity or elasticity_files):
            from kinetics.predicting import count_elasticities

            progress("elasticities")
            drawn = None if made.drawn is None else made.drawn.at_last()
            found = count_elasticities(model, rates, None, made.times[-1:], drawn, sums)
    write_tables(csv_files, made.to_dataframe)
    for plot_file in plot_files:
        plots.save_figure(plot_file, lambda figure: draw_prediction(figure, made), size_of(made))
    for html_file in html_files:
        made.save_page(html_file)
    if made.trajectories is not None:
        write_tables(trajectories_files, made.trajectories.to_dataframe)
    if found is not None:
        write_plots(elasticity_files, partial(found.plot, names=made.network.species))
    if as_json:
        has_interval = made.low is not None
        echo_json(
            {
                "book": asked.source,
                "rates": asked.rates_name,
                **conditions(*given),
                "initial": dict(zip(model.network.species, model.initial, strict=True)),
                "method": method or "auto",
                "method_used": made.method,
                "runs": made.runs,
                "truncated": None if made.truncated is None else made.truncated.to_dict(),
                "complete": is_complete,
                "seed": seed,
                "time_unit": made.network.time_unit,
                "times": made.times,
                "duration": None if picked is None else picked._asdict(),
                "species": made.network.species,
                "mean": made.mean,
                "sd": made.sd,
                "interval": {"level": 0.95, "low": made.low, "high": made.high} if has_interval else None,
                "standard_error": made.standard_error,
                "error": made.error,
                "mean_field": made.approximation,
                "accuracy": None if made.reached is None else made.reached.to_dict(),
                "trajectories": None if made.trajectories is None else made.trajectories.to_dict(),
                "first_time": None if first is None else first_times_data(first),
                "elasticities": None if found is None else found.to_dict(),
                "notes": (*model.notes, *made.notes),
                "cpu_seconds": made.cpu_seconds,
            }
        )
    else:
        words = remarks(*given)
        words += () if picked is None else (_why(picked, made.network.time_unit),)
        words += () if first is None else first_times_text(first, rates is not None and rates.has_evidence)
        click.echo(_prediction_table(made, words))
        if found is not None:
            click.echo(_elasticity_table(found, made))
    if not is_complete:
        raise SystemExit(INTERRUPTED)
    if made.truncated is not None:
        raise SystemExit(INCOMPLETE)


def _at_mean(model: Model, rates: AppliedRates | None) -> Model:
    """The model at the posterior mean of each rate constant, as `predict` has it."""
    return model if rates is None else replace(model, network=rates.expected(model.network, model.tank))


def _duration(model: Model, rates: AppliedRates | None) -> ChosenDuration:
    """A duration for a network file, from its rates."""
    from kinetics.predicting.duration import chosen_duration

    return chosen_duration(_at_mean(model, rates), DURATION)


def _why(picked: ChosenDuration, unit: str) -> str:
    """A line on a duration that was chosen."""
    return f"duration {in_unit(f'{picked.value:g}', unit)} chosen, as none was given: {picked.why}"


def _check_runs(trajectories: int, files: tuple[str, ...], until: str | None, method: str | None) -> None:
    """ValueError for a table of no runs, and for what is asked of runs of a method that makes none."""
    if files and not trajectories:
        raise ValueError("--trajectories-csv, but no --trajectories; state their number, as in --trajectories 5")
    if method is None or method in SAMPLING:
        return
    from kinetics.markov.transient.methods import BY_NAME as SOLVING

    if trajectories and method in SOLVING:
        raise ValueError(
            f"--trajectories {trajectories} are sampled runs, but --method {method} solves the master equation and "
            f"makes none; leave out --method, or --trajectories"
        )
    if until is not None:
        raise ValueError(
            f"--until {until!r} ends sampled runs, but --method {method} makes none; leave out --method, or solve for "
            f"the time by `wellmixed passage --species NAME --copies N` or `wellmixed ask`"
        )


def _accuracy(size: str | None, of: str, budget: float | None) -> AskedAccuracy | None:
    """The accuracy asked for, in so many seconds of CPU time (None: as by default); None if there is none."""
    if size is None:
        if of != "mean":
            raise ValueError(f"--accuracy-of {of}, but no --accuracy; state it, as in --accuracy 1%")
        return None

    return AskedAccuracy.of_text(size, of) if budget is None else AskedAccuracy.of_text(size, of, budget)


def _prediction_table(made: Prediction, conditions: tuple[str, ...]) -> str:
    """Mean, sd and interval at some of the times, and what to know about them."""
    table = made.summary()
    return "\n".join([text_table(table.titles, table.rows), table.headline, *conditions, *table.notes])


def _elasticity_table(found: Elasticities, made: Prediction) -> str:
    """Elasticity and share of variance of the last means, a row a parameter."""
    rows = []
    for p, name in enumerate(found.parameters):
        cells = [name if found.is_rate[p] else f"{name} (d ln / d {name})"]
        for s in range(len(made.network.species)):
            value, share = found.value[p, 0, s], 100 * found.share[p, 0, s]
            text = figure(value, ".3g")
            if not found.is_exact and not math.isnan(value):
                text += f" ± {found.standard_error[p, 0, s]:.2g}"
            cells.append(text if math.isnan(share) else f"{text} ({share:.0f} %)")
        rows.append(cells)
    last = in_unit(f"{made.times[-1]:g}", made.network.time_unit)
    head, notes = f"elasticity of the mean at {last}", [found.note]
    if not np.isnan(found.share).all():
        head += " (share of the variance that the rates leave)"
    if np.isnan(found.value).any():
        notes.append("-: not known, because the mean is 0 or the parameter is taken as known")
    return "\n".join(["", head, text_table(("parameter", *made.network.species), rows), *notes])
