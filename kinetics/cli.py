"""Commands that predict: `wellmixed predict`, `passage` and `derive`."""

from __future__ import annotations

import time
from typing import TYPE_CHECKING, Any

import click
import numpy as np

from kinetics.methods import SAMPLING_METHODS, SOLVING_METHODS, SamplingMethod, SolvingMethod
from kinetics.network import text_table
from kinetics.options import (
    NumbersCommand,
    csv_option,
    echo_json,
    in_a_folder,
    json_option,
    plot_option,
    seed_option,
    time_grid,
)
from kinetics.progress import INTERRUPTED, progress_line
from kinetics.starting import is_network_file, network_of_book, start

if TYPE_CHECKING:
    from kinetics.prediction import Prediction

METHODS: dict[str, type[SamplingMethod] | type[SolvingMethod]] = {
    **{method.name: method for method in SAMPLING_METHODS},
    **{method.name: method for method in SOLVING_METHODS},
}
QUANTILES = (0.025, 0.25, 0.5, 0.75, 0.975)
MAX_ROWS = 11  # of a table for people; --json and --csv give every time


def starting_options(command: Any) -> Any:
    """Book or network file, rates, and what the tank holds at time 0."""
    for decorate in (
        click.option("--initial", metavar="SPECIES=COUNT,...", help="Copies at time 0: monomer=20,dimer=20."),
        click.option("--cubes", type=click.IntRange(min=1), help="Start from so many single cubes."),
        click.option("--rates", "rates_name", metavar="NAME|FILE", help="Rates: table3, or a .toml file."),
        click.argument("book", metavar="NETWORK"),
    ):
        command = decorate(command)
    return command


@click.command(cls=NumbersCommand)
@starting_options
@click.option("--duration", type=float, help="Predict from 0 to here, tu.  [default: 2000]")
@click.option("--times", type=float, multiple=True, metavar="T ...", help="Predict at these times instead, tu.")
@click.option("--show", "shown", multiple=True, metavar="NAME", help="Only this species or observable; may come again.")
@click.option("--method", type=click.Choice(list(METHODS)), default="auto", show_default=True)
@click.option("--runs", type=click.IntRange(min=1), default=1000, show_default=True, help="Of a method that samples.")
@click.option("--threads", type=click.IntRange(min=1), help="At most so many.  [default: one a core]")
@click.option("--draws", type=click.IntRange(min=2), default=200, show_default=True, help="Of the rates.")
@csv_option
@plot_option
@seed_option
@json_option
def predict(
    book: str,
    rates_name: str | None,
    cubes: int | None,
    initial: str | None,
    duration: float | None,
    times: tuple[float, ...],
    shown: tuple[str, ...],
    method: str,
    runs: int,
    threads: int | None,
    draws: int,
    csv_file: str | None,
    plot_file: str | None,
    seed: int,
    as_json: bool,
) -> None:
    """Predict how the assembly by a rule book proceeds, or the reactions of a network file, as a Markov chain.

    NETWORK is a book, which needs --rates and --cubes, or a file that brings both (BioNetGen's .net and others).
    Mean and standard deviation of every species over time; a 95 % interval of the mean where the rates carry the
    evidence for one. The method `auto` samples runs, `exact` solves the master equation. Runs are not kept, so there
    may be millions; Ctrl-C tells of those made so far.
    """
    from kinetics.prediction import predict as make

    begin = start(book, rates_name, cubes, initial)
    grid = time_grid(duration, times)
    with progress_line() as progress:
        made = make(
            begin.network, begin.rates, begin.state, grid, METHODS[method](), runs, seed, draws, threads, progress,
            begin.watch(shown),
        )  # fmt: skip
    if csv_file:
        made.to_dataframe().to_csv(csv_file, index=False)
    if plot_file:
        from kinetics import plots

        plots.save(plot_file, made.plot)
    if as_json:
        has_interval = made.low is not None
        echo_json(
            {
                "book": book,
                "rates": rates_name,
                "convention": begin.convention,
                "initial": dict(zip(begin.network.species, begin.state, strict=True)),
                "method": method,
                "runs": made.runs,
                "complete": made.is_complete,
                "seed": seed,
                "times": made.times,
                "species": made.network.species,
                "mean": made.mean,
                "sd": made.sd,
                "interval": {"level": 0.95, "low": made.low, "high": made.high} if has_interval else None,
                "standard_error": made.standard_error,
                "error": made.error,
                "notes": made.notes,
                "cpu_seconds": made.cpu_seconds,
            }
        )
    else:
        click.echo(_prediction_table(made))
    if not made.is_complete:
        raise SystemExit(INTERRUPTED)


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
    from kinetics.prediction import evidence_notes, predict_passage

    began = time.process_time()
    begin = start(book, rates_name, cubes, initial)
    law, interval = predict_passage(begin.network, begin.rates, begin.state, species, copies, seed, draws)
    quantiles = law.quantile(QUANTILES)
    if plot_file:
        from kinetics import plots

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


@click.command()
@starting_options
@click.option(
    "--out", "out_file", metavar="FILE", callback=in_a_folder, help="Write it for other programs: .net, .xml, .sbml."
)
@seed_option
@json_option
def derive(
    book: str,
    rates_name: str | None,
    cubes: int | None,
    initial: str | None,
    out_file: str | None,
    seed: int,
    as_json: bool,
) -> None:
    """Show the reaction network of a rule book, with the ways counted from geometry, or that of a network file.

    For --out a book needs --rates, and --cubes or --initial. A network file may be written as one of another kind.
    Nothing here is random; --seed is taken because every command takes it.
    """
    if out_file or is_network_file(book):
        begin = start(book, rates_name, cubes, initial)
        network = begin.model.network
    else:
        network, _ = network_of_book(book)
    if out_file:
        from kinetics.formats import write

        write(begin.model, out_file)
        if not as_json:
            click.echo(f"{len(network.species)} species and {len(network.channels)} channels are in {out_file}")
    elif not as_json:
        click.echo(str(network))
    if not as_json:
        return
    titles = ("name", "reaction", "ways")
    echo_json(
        {
            "book": book,
            "species": network.species,
            "channels": [dict(zip(titles, row[:3], strict=True)) for row in network.rows()],
            "reactants": network.reactants,
            "stoichiometry": network.stoichiometry,
            "ways": network.ways,
            "conserved": dict(network.conserved),
            "out": out_file,
            "fingerprint": network.fingerprint,
            "seed": seed,
        }
    )


def _prediction_table(made: Prediction) -> str:
    """Mean, sd and interval at some of the times, and what to know about them."""
    step = max(1, -(-(made.times.size - 1) // (MAX_ROWS - 1))) if made.times.size > MAX_ROWS else 1
    rows = []
    for i in range(0, made.times.size, step):
        cells = [f"{made.times[i]:g}"]
        for s in range(len(made.network.species)):
            cell = f"{made.mean[i, s]:.4g} ± {made.sd[i, s]:.3g}"
            if made.low is not None and made.high is not None:
                cell += f" [{made.low[i, s]:.4g}, {made.high[i, s]:.4g}]"
            cells.append(cell)
        rows.append(cells)
    explained = "mean ± sd of a run" + ("" if made.low is None else " [95 % interval of the mean, from the rates]")
    precision = f"numerical error of the probabilities below {made.error:.1g}"
    if METHODS[made.method] in SAMPLING_METHODS:
        precision = f"largest Monte-Carlo error of a mean {made.standard_error.max():.2g}"
    head = f"{explained}; method {made.method}; {precision}; {made.cpu_seconds:.2g} s CPU"
    return "\n".join([text_table(("time (tu)", *made.network.species), rows), head, *made.notes])
