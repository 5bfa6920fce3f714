"""Lazy commands: only the help line is known until the command is run."""

from __future__ import annotations

import importlib
from collections.abc import Iterator, Mapping
from itertools import islice
from typing import Any

import click

from kinetics.support.cli.options_file import defaults_of

Commands = Mapping[str, tuple[str, str, str]]  # words -> (module, attribute, the line that `--help` shows)


class LazyCommand(click.Command):
    """A command whose module is imported when it runs or shows its own help."""

    def __init__(self, name: str, module: str, attribute: str, help_line: str):
        super().__init__(name, help=help_line, add_help_option=False)
        self.source = (module, attribute)

    def load(self) -> click.Command:
        """Import the real command."""
        module, attribute = self.source
        command: click.Command = getattr(importlib.import_module(module), attribute)
        return command

    def make_context(
        self, info_name: str | None, args: list[str], parent: click.Context | None = None, **extra: Any
    ) -> click.Context:
        """Hand over to the real command, with what a file of options says of it."""
        real = self.load()
        if not extra.get("resilient_parsing"):  # a shell that completes
            refuse_second_values(real, args, info_name, parent)
        if parent is not None and parent.default_map:
            extra["default_map"] = defaults_of(parent, real, self.name or "")
        return real.make_context(info_name, args, parent=parent, **extra)


def refuse_second_values(
    command: click.Command, args: list[str], name: str | None, parent: click.Context | None
) -> None:
    """UsageError where an option that takes one value comes twice with different ones: click would keep the last."""
    options = {spelled: p for p in command.params if isinstance(p, click.Option) for spelled in p.opts}
    given: dict[str | None, list[str]] = {}
    words = iter(args)
    for word in words:
        if word == "--":
            break
        spelled, equals, value = word.partition("=")
        option = options.get(spelled)
        if option is None or option.is_flag or option.count:
            continue
        values = [value] * bool(equals)
        values += islice(words, option.nargs - len(values))
        if not option.multiple and given.setdefault(option.name, values) != values:
            first, second = " ".join(given[option.name]), " ".join(values)
            told = f"{spelled} was given twice, with {first} and with {second}; it takes one value, so leave one out"
            raise click.UsageError(told, click.Context(command, info_name=name, parent=parent))


def below(command: click.Command, words: tuple[str, ...] = ()) -> Iterator[tuple[str, click.Command]]:
    """This command and all below it, imported, each with the words that a user types; "" are those of this one."""
    if isinstance(command, LazyCommand):
        command = command.load()
    yield " ".join(words), command
    if isinstance(command, click.Group):
        for name, each in command.commands.items():
            yield from below(each, (*words, name))


class Menu(click.Group):
    """A group whose help lists its commands in the order in which they were added."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        """The names of its commands."""
        del ctx
        return list(self.commands)


def mount(top: click.Group, commands: Commands, groups: Mapping[str, str]) -> None:
    """Add commands without importing them, and the groups that their words name, each with the line of its help."""
    made = {"": top}
    for words, (module, attribute, help_line) in commands.items():
        *above, name = words.split()
        for depth, word in enumerate(above, 1):
            path = " ".join(above[:depth])
            if path not in made:
                made[path] = Menu(word, help=groups[path])
                made[" ".join(above[: depth - 1])].add_command(made[path])
        made[" ".join(above)].add_command(LazyCommand(name, module, attribute, help_line))
