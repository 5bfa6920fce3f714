"""`wellmixed rules`: commands about rule books, one file each."""

from __future__ import annotations

import click

from kinetics.lazy import mount

COMMANDS = {
    "check": ("kinetics.commands.check", "check", "Tell all that is wrong with a rule book."),
}


@click.group()
def rules() -> None:
    """Examine rule books."""


mount(rules, COMMANDS)
