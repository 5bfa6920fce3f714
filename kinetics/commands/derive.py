"""`wellmixed rules derive`: the reaction network of a rule book or a network file, shown or written to a file."""

from __future__ import annotations

from pathlib import Path

import click

from kinetics.commands.models import applied, conditions, described, is_network_file, network_of_book
from kinetics.network import Model
from kinetics.network.network import channel_rows
from kinetics.rates.breaks import BREAK_MODELS, Expansion, break_model
from kinetics.support.cli.options import (
    HeadedCommand,
    ModelOptions,
    OptionToldLate,
    echo_json,
    in_a_folder,
    json_option,
    model_options,
)
from kinetics.support.packages import require

MOST_ENTRIES = 2**22  # of a table written as JSON: some 10 MB


def _about_out() -> str:
    from kinetics.formats import WRITTEN

    return f"Write the network to this file, in the format of its suffix: {', '.join(WRITTEN)}."


@click.command(cls=HeadedCommand)
@model_options
@click.option(
    "--out",
    "out_file",
    cls=OptionToldLate,
    metavar="FILE",
    callback=in_a_folder,
    told_by=_about_out,
)
@click.option(
    "--break-model",
    "break_name",
    type=click.Choice([model.name for model in BREAK_MODELS]),
    help="Show the network in which each break has the partners of this break model.",
)
@json_option
def derive(
    asked: ModelOptions,
    out_file: str | None,
    break_name: str | None,
    as_json: bool,
) -> None:
    """Derive the reaction network of a rule book, with multiplicities counted from geometry, or read a network file.

    NETWORK is a rule book or a network file; --out writes it in another format, for which a book needs --rates, and
    --cubes or --initial; the rates say how bonds break. The command draws no random numbers.
    """
    if break_name and (out_file or is_network_file(asked.source)):
        raise ValueError(
            "--break-model needs a rule book without rates; with --out the rates decide how bonds break, and the "
            "channels of a network file are fixed"
        )
    if out_file and Path(out_file).suffix.lower() in (".xml", ".sbml"):
        require("libsbml")
    breaks: object = {"model": break_name or "first-order"}
    model: Model | None = None
    if out_file or is_network_file(asked.source):
        given = described(asked)
        model, breaks = applied(*given), conditions(*given)["breaks"]
        network = model.network
    else:
        network, _ = network_of_book(asked.source)
        if break_name:
            network = Expansion.of(network, break_model(break_name)).network
    entries = len(network.species) * len(network.channels)
    if as_json and entries > MOST_ENTRIES:
        raise click.UsageError(
            f"--json writes tables of every channel by every species: {len(network.channels)} by "
            f"{len(network.species)} are {entries} entries each, at most {MOST_ENTRIES} are written; leave --json out, "
            f"and write the network to a file by --out"
        )
    if out_file and model:
        from kinetics.formats import write

        write(model, out_file)
        if not as_json:
            click.echo(f"{len(network.species)} species and {len(network.channels)} channels are in {out_file}")
    elif not as_json:
        click.echo("\n".join([str(network), *(model.notes if model else ())]))
    if not as_json:
        return
    titles = ("name", "reaction", "ways")
    echo_json(
        {
            "book": asked.source,
            "breaks": breaks,
            "species": network.species,
            "channels": [dict(zip(titles, row[:3], strict=True)) for row in channel_rows(network)],
            "reactants": network.reactants,
            "stoichiometry": network.stoichiometry,
            "ways": network.ways,
            "conserved": dict(network.conserved),
            "out": out_file,
            "fingerprint": network.fingerprint,
        }
    )
