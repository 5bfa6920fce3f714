"""The command `wellmixed derive`: the network of a book or of a file, shown or written for other programs."""

from __future__ import annotations

import click

from kinetics.commands.start import is_network_file, network_of_book, start
from kinetics.formats import SUFFIXES
from kinetics.support.cli.options import echo_json, in_a_folder, json_option, seed_option, starting_options


@click.command()
@starting_options
@click.option(
    "--out", "out_file", metavar="FILE", callback=in_a_folder, help=f"Write a network file: {', '.join(SUFFIXES)}."
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
