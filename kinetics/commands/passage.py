"""`wellmixed passage`: the first-passage time to a number of copies of a species."""

from __future__ import annotations

import time

import click
import numpy as np

from kinetics.commands.start import start
from kinetics.support.cli.options import echo_json, json_option, plot_option, seed_option, starting_options, tank_option

QUANTILES = (0.025, 0.25, 0.5, 0.75, 0.975)


@click.command()
@starting_options
@tank_option
@click.option("--species", metavar="SPECIES", required=True, help="The species to wait for.")
@click.option(
    "--copies",
    metavar="N",
    type=click.IntRange(min=1),
    default=1,
    show_default=True,
    help="Number of its copies to wait for.",
)
@click.option(
    "--draws",
    metavar="N",
    type=click.IntRange(min=2),
    default=100,
    show_default=True,
    help="Number of draws of the rates from which the interval is made.",
)
@plot_option
@seed_option
@json_option
def passage(
    book: str,
    rates_name: str | None,
    cubes: int | None,
    initial: str | None,
    edges: tuple[float, float, float] | None,
    species: str,
    copies: int,
    draws: int,
    plot_file: str | None,
    seed: int,
    as_json: bool,
) -> None:
    """Solve for the first-passage time to a number of copies of a species: mean, sd, quantiles, distribution function.

    NETWORK is a rule book, which needs --rates and --cubes, or a network file that contains both. The time is solved
    for, not sampled; if the rates come with their events and exposure, the mean has a 95 % interval from these.
    """
    from kinetics.predicting.prediction import evidence_notes, predict_passage

    began = time.process_time()
    begin = start(book, rates_name, cubes, initial, edges)
    found, interval = predict_passage(begin.network, begin.rates, begin.state, species, copies, seed, draws, begin.tank)
    quantiles = found.quantile(QUANTILES)
    if plot_file:
        from kinetics.support import plots

        plots.save(plot_file, found.plot)
    if as_json:
        curve = np.linspace(0.0, float(found.quantile(0.99 * found.probability)), 101)
        echo_json(
            {
                "book": book,
                "rates": rates_name,
                "convention": begin.convention,
                **begin.conditions,
                "initial": dict(zip(begin.network.species, begin.state, strict=True)),
                "species": species,
                "copies": copies,
                "mean": found.mean,
                "sd": found.sd,
                "probability": found.probability,
                "certain": found.is_certain,
                "quantiles": dict(zip(QUANTILES, quantiles.tolist(), strict=True)),
                "curve": {"times": curve, "cdf": found.cdf(curve)},
                "interval": {"level": 0.95, "low": interval[0], "high": interval[1]} if interval else None,
                "error": found.error,
                "seed": seed,
                "notes": evidence_notes(begin.rates),
                "cpu_seconds": time.process_time() - began,
            }
        )
        return
    click.echo(str(found))
    if interval:
        click.echo(f"95 % interval of the mean, from the rates: {interval[0]:.4g} to {interval[1]:.4g} tu")
    click.echo("quantiles (tu): " + ", ".join(f"{q:g}: {t:.4g}" for q, t in zip(QUANTILES, quantiles, strict=True)))
    for note in (*begin.in_words, *evidence_notes(begin.rates)):
        click.echo(note)
