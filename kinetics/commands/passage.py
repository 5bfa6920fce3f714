"""The command `wellmixed passage`: the time until the first copy of a species."""

from __future__ import annotations

import time

import click
import numpy as np

from kinetics.commands.start import start
from kinetics.support.cli.options import echo_json, json_option, plot_option, seed_option, starting_options

QUANTILES = (0.025, 0.25, 0.5, 0.75, 0.975)


@click.command()
@starting_options
@click.option("--species", required=True, help="What is waited for.")
@click.option("--copies", type=click.IntRange(min=1), default=1, show_default=True, help="How many of it.")
@click.option("--draws", type=click.IntRange(min=2), default=100, show_default=True, help="Of the rates.")
@plot_option
@seed_option
@json_option
def passage(
    book: str,
    rates_name: str | None,
    cubes: int | None,
    initial: str | None,
    species: str,
    copies: int,
    draws: int,
    plot_file: str | None,
    seed: int,
    as_json: bool,
) -> None:
    """Time until the first copy (or copies) of a species, exactly: mean, sd, quantiles and curve."""
    from kinetics.predicting.prediction import evidence_notes, predict_passage

    began = time.process_time()
    begin = start(book, rates_name, cubes, initial)
    law, interval = predict_passage(begin.network, begin.rates, begin.state, species, copies, seed, draws)
    quantiles = law.quantile(QUANTILES)
    if plot_file:
        from kinetics.support import plots

        plots.save(plot_file, law.plot)
    if as_json:
        curve = np.linspace(0.0, float(law.quantile(0.99 * law.probability)), 101)
        echo_json(
            {
                "book": book,
                "rates": rates_name,
                "convention": begin.convention,
                "initial": dict(zip(begin.network.species, begin.state, strict=True)),
                "species": species,
                "copies": copies,
                "mean": law.mean,
                "sd": law.sd,
                "probability": law.probability,
                "certain": law.is_certain,
                "quantiles": dict(zip(QUANTILES, quantiles.tolist(), strict=True)),
                "curve": {"times": curve, "cdf": law.cdf(curve)},
                "interval": {"level": 0.95, "low": interval[0], "high": interval[1]} if interval else None,
                "error": law.error,
                "seed": seed,
                "notes": evidence_notes(begin.rates),
                "cpu_seconds": time.process_time() - began,
            }
        )
        return
    click.echo(str(law))
    if interval:
        click.echo(f"95 % interval of the mean, from the rates: {interval[0]:.4g} to {interval[1]:.4g} tu")
    click.echo("quantiles (tu): " + ", ".join(f"{q:g}: {t:.4g}" for q, t in zip(QUANTILES, quantiles, strict=True)))
    for note in evidence_notes(begin.rates):
        click.echo(note)
