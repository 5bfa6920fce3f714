"""`wellmixed rules`: commands about rule books, one file each."""

from __future__ import annotations

import click

from kinetics.support.cli.lazy_commands import mount

COMMANDS = {
    "check": ("kinetics.commands.check", "check", "Tell all that is wrong with a rule book."),
    "compile": ("kinetics.commands.compile", "compile_", "Make the rule book that builds a target."),
    "draw": ("kinetics.commands.draw", "draw", "Draw structures, state diagrams, networks and growths."),
    "grow": ("kinetics.commands.grow", "grow", "Grow structures by a rule book, however many there can be."),
    "rank": ("kinetics.commands.rank", "rank", "Rank books of one target by time and yield."),
}


@click.group()
def rules() -> None:
    """Examine rule books."""


mount(rules, COMMANDS)
