"""All commands of `wellmixed`, each imported and named by the words that a user types."""

from collections.abc import Iterator

import click

from kinetics.support.cli.lazy_commands import below
from wellmixed import main


def commands() -> Iterator[tuple[str, click.Command]]:
    """(words, command) of `wellmixed` and of all below it; its own words are empty."""
    return below(main)
