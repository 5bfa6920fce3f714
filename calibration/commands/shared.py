"""Options and exit codes shared by the commands of calibration."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import click
from click.core import ParameterSource

from kinetics.support.cli.declared import count_option, default_option
from kinetics.support.cli.failures import BROKEN, INCOMPLETE
from kinetics.support.cli.options import in_a_folder, table_of

Decorator = Callable[[Callable[..., Any]], Callable[..., Any]]


def seed_option(default: int) -> Decorator:
    """--seed, with the command's own default."""
    return count_option("--seed", least=0, default=default, help="Random seed; the same seed gives the same result.")


def sizes_option(name: str, text: str, **default: Any) -> Decorator:
    """An option that takes several numbers of cubes."""
    return count_option(name, multiple=True, metavar="N ...", help=text, **default)


def time_option(name: str, default: float, text: str) -> Decorator:
    """An option that takes a time."""
    return default_option(name, metavar="T", type=float, default=default, help=text)


def out_option(text: str) -> Decorator:
    """--out, a TOML file to be written."""

    def checked(ctx: click.Context, param: click.Parameter, value: str | None) -> str | None:
        if value is not None and Path(value).suffix != ".toml":
            raise ValueError(f"--out {value}: expected a name that ends in .toml")
        return in_a_folder(ctx, param, value)

    return click.option(
        "--out", required=True, metavar="FILE", type=click.Path(dir_okay=False), callback=checked, help=text
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
    """ValueError if an option of these parameters was given beside a plan."""
    given = given_options()
    for name in names:
        if name in given:
            raise ValueError(f"{given[name]} is fixed by the plan {plan}; leave it out, or change the plan")


def leave(problems: Sequence[str], is_broken: bool = False) -> None:
    """Say what went wrong in single runs, with exit code 4; with 5 if a rule of a plan is broken."""
    for problem in problems:
        click.echo(f"left out: {problem}", err=True)
    if problems or is_broken:
        click.get_current_context().exit(BROKEN if is_broken else INCOMPLETE)
