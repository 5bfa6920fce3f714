"""Commands of the kinetics, one file each, and the group `wellmixed rules`."""

from __future__ import annotations

import click

from kinetics.support.cli.lazy_commands import mount

COMMANDS = {
    "check": ("kinetics.commands.check", "check", "Verify a rule book by exhausting everything it can assemble."),
    "certify": (
        "kinetics.commands.certify",
        "certify",
        "Verify the certificate of a compiled rule book.",
    ),
    "compile": (
        "kinetics.commands.compile",
        "compile_",
        "Synthesise a rule book that builds a target structure.",
    ),
    "draw": (
        "kinetics.commands.draw",
        "draw",
        "Draw structures, state diagrams, networks and growth.",
    ),
    "grow": (
        "kinetics.commands.grow",
        "grow",
        "Simulate assembly directly from the rules, without a network.",
    ),
    "rank": ("kinetics.commands.rank", "rank", "Rank rule books of one target by yield or first-assembly time."),
}


@click.group()
def rules() -> None:
    """Check, compile, draw, grow and rank rule books."""


mount(rules, COMMANDS)
