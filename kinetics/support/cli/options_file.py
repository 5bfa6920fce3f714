"""Options from a file, for those that the command line does not give.

    [predict]
    runs = 500
    rates = "table3"

    [rules.grow]
    cubes = 100

A table is a command, a name an option without its dashes; flags are `true`, options that may be repeated are lists, or
one value.
"""

from __future__ import annotations

import difflib
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

import click

FILE = "wellmixed.options_file"  # where a context keeps the file's name


def options_in(ctx: click.Context, path: str) -> None:
    """Make the tables of a file the defaults of the commands below this context."""
    from kinetics.support.config import read_toml

    if not Path(path).exists():
        raise click.UsageError(f"--config {path}: there is no such file", ctx)
    ctx.meta[FILE] = path
    ctx.default_map = read_toml(Path(path))
    _check_commands(ctx, ctx.command, ctx.default_map, "")


def _check_commands(ctx: click.Context, group: click.Command, tables: Mapping[str, Any], above: str) -> None:
    """A UsageError where a table is named like no command of the group, or of the groups in it."""
    if isinstance(group, click.Group):
        for name, table in tables.items():
            if name not in group.commands or not isinstance(table, Mapping):
                raise _unknown(ctx, f"[{above}{name}]", "table of a command", name, group.commands)
            _check_commands(ctx, group.commands[name], table, f"{above}{name}.")


def defaults_of(ctx: click.Context, command: click.Command, name: str) -> dict[str, Any] | None:
    """The table of a command as defaults of its parameters, by their names in Python; None if there is none."""
    table = (ctx.default_map or {}).get(name)
    if table is None or FILE not in ctx.meta:
        return table
    options = {
        spelled.lstrip("-"): option
        for option in command.params
        if isinstance(option, click.Option)
        for spelled in option.opts
        if spelled.startswith("--")
    }
    for key, value in table.items():
        if key not in options:
            raise _unknown(ctx, f"{key} in [{name}]", f"option of {name}", key, options)
        expected = _form(options[key], value)
        if expected:
            message = f"--config {ctx.meta[FILE]}: {key} = {value!r} in [{name}]; expected {expected}"
            raise click.UsageError(message, ctx)
    return {
        str(options[key].name): [value] if options[key].multiple and not isinstance(value, list) else value
        for key, value in table.items()
    }


def _form(option: click.Option, value: Any) -> str:
    """What form an option's value should have had; "" if it has that."""
    if option.is_flag:
        return "" if isinstance(value, bool) else "true or false"
    if option.nargs != 1:
        return "" if isinstance(value, list) else "a list"
    if option.multiple:
        return "one value or a list" if isinstance(value, bool | dict) else ""
    return "one number or text" if isinstance(value, bool | list | dict) else ""


def _unknown(ctx: click.Context, what: str, expected: str, name: str, known: Iterable[str]) -> click.UsageError:

    near = difflib.get_close_matches(name, list(known), n=3, cutoff=0.6)
    hint = f"; did you mean {' or '.join(near)}?" if near else f"; expected one of {', '.join(sorted(known))}"
    return click.UsageError(f"--config {ctx.meta[FILE]}: {what} is no {expected}{hint}", ctx)
