"""The command `wellmixed new`: from a shape to the folder of a study."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from calibration.commands.plan import asked_of_a_plan
from calibration.commands.shared import seed_option, sizes_option
from calibration.pipeline.new_study import new_study
from kinetics.assembly.compiler.result import sensing
from kinetics.assembly.compiler.yields import CONDITIONS
from kinetics.support.cli.completion import shipped
from kinetics.support.cli.declared import POSITIVE, default_option
from kinetics.support.cli.options import NumbersCommand, echo_json, json_option
from kinetics.support.cli.progress import progress_line


@click.command(cls=NumbersCommand)
@click.argument("target", metavar="TARGET|BOOK", shell_complete=shipped("target", "book"))
@click.argument("folder", required=False)
@sizes_option(
    "--cubes",
    "Numbers of cubes of the calibration.  [default: 60 and 120 in a tank of line4's size, more in a larger one]",
)
@sizes_option("--held-out", "Numbers of cubes of the held-out runs.  [default: 40, 80 and 160, likewise]")
@asked_of_a_plan
@default_option(
    "--time-limit",
    metavar="SECONDS",
    type=POSITIVE,
    default=600,
    help="Wall time allowed for the search of a rule book, s.",
)
@seed_option(1)
@json_option
def new(target: str, folder: str | None, time_limit: float, as_json: bool, **wanted: Any) -> None:
    """Create the FOLDER of a study of TARGET or BOOK: a rule book, a scene, and a plan with its cost in CPU hours.

    TARGET is a shipped target or a .toml file, as `wellmixed rules compile` takes it; a rule BOOK is used as it is, and
    a name that is shipped as both means the target. FOLDER is by default that name.

    The yield of the book is printed, with a warning if it is below 0.1, and the cost with another engine (--engine). If
    the plan falls short of the wanted power or width, a line says which option would reach it.

    Only a few short trials are simulated, to forecast the cost. The plan takes tanks from the assembly path that rates
    like those of lines and Ts predict. A target that grows from a seed is studied by rate class instead, in growth from
    time 0; --along then has no effect. The commands simulate, calibrate, predict and validate need no argument but the
    folder.
    """

    asked = {name: value for name, value in wanted.items() if value != ()}
    with progress_line():
        made = new_study(target, folder or Path(target).stem, time_limit, **asked)
    planned = made.planned
    compiled, yields = made.compiled, made.yields
    if as_json:
        echo_json(
            planned.to_dict()
            | {
                "folder": str(made.folder),
                "letters": len(made.book.letters),
                "senses": sensing(made.book.senses),
                "verified": [] if compiled is None else compiled.verified,
                "yields": None if yields is None else yields.as_dict(),
                "gain": None if compiled is None else compiled.gain,
                "tank": made.scene.tank.size,
                "seed": wanted["seed"],
            }
        )
    else:
        click.echo(
            f"{made.folder}: a book of {len(made.book.letters)} letters; cubes sense: {sensing(made.book.senses)}"
        )
        if compiled is not None:
            click.echo("\n".join([*compiled.searched[-1:], *compiled.verified]))
        if yields is not None:
            click.echo(f"{yields} ({CONDITIONS})")
        click.echo(planned.tables())
        steps = "\n".join(
            f"  wellmixed {step} {made.folder}" for step in ("simulate", "calibrate", "predict", "validate")
        )
        click.echo(f"next:\n{steps}")
    if yields is not None and yields.warning:
        click.echo(f"warning: {yields.warning}", err=True)
    for shortfall in planned.shortfalls:
        click.echo(f"falls short: {shortfall}", err=True)
