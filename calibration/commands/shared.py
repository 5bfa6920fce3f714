"""Options and exit codes shared by the commands of calibration."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import click
from click.core import ParameterSource

from kinetics.support.cli.failures import STOPPED
from kinetics.support.cli.options import table_of


def seed_option(default: int) -> Any:
    """--seed, with the command's own default."""
    return click.option(
        "--seed",
        metavar="N",
        type=click.IntRange(min=0),
        default=default,
        show_default=True,
        help="Random seed; the same seed gives the same result.",
    )


report_option = click.option(
    "--report",
    metavar="FILE",
    type=click.Path(dir_okay=False),
    callback=table_of("matplotlib"),
    help="Write an HTML report to this file, and its tables (CSV) and figures (SVG) beside it.",
)


def given_options() -> dict[str, str]:
    """Options that the user has given to this command: name of the parameter -> `--option`."""
    context = click.get_current_context()
    return {
        option.name: option.opts[0]
        for option in context.command.params
        if option.name is not None and context.get_parameter_source(option.name) is ParameterSource.COMMANDLINE
    }


def refuse_what_a_plan_fixes(plan: str, *names: str) -> None:
    """ValueError where an option of these parameters was given beside a plan."""
    given = given_options()
    for name in names:
        if name in given:
            raise ValueError(f"{given[name]} is fixed by the plan {plan}; leave it out, or change the plan")


def leave(problems: Sequence[str]) -> None:
    """Say what went wrong in single runs, with exit code 4."""
    for problem in problems:
        click.echo(f"left out: {problem}", err=True)
    if problems:
        click.get_current_context().exit(STOPPED)
