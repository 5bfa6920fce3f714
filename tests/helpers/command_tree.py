"""All commands of `wellmixed`, each imported and named by the words that a user types."""

from collections.abc import Iterator

import click

from kinetics.support.cli.lazy_commands import LazyCommand
from wellmixed import main


def commands(command: click.Command = main, words: tuple[str, ...] = ()) -> Iterator[tuple[str, click.Command]]:
    """(words, command) of this command and of all below it; the words of `wellmixed` itself are empty."""
    if isinstance(command, LazyCommand):
        command = command.load()
    yield " ".join(words), command
    if isinstance(command, click.Group):
        for name, below in command.commands.items():
            yield from commands(below, (*words, name))
