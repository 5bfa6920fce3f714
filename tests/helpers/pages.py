"""Pages of documentation as what they ask a reader to type: files, commands with what they print, and lines to adapt.

A fenced block with a title is a file. A block `console` is typed line by line after its `$ `, in one folder, and what
follows a command is what it prints, `...` for anything. In other blocks each line that begins with `wellmixed` is a
command that takes too long to be run with every change, or wants files of the reader's own.
"""

from __future__ import annotations

import doctest
import re
import shlex
from collections.abc import Iterator
from itertools import takewhile
from pathlib import Path
from typing import NamedTuple

import click
from command_line import run_here
from command_tree import commands

from kinetics.support.cli.failures import INCOMPLETE

ROOT = Path(__file__).parents[2]
PAGES = sorted([ROOT / "README.md", *(ROOT / "docs").rglob("*.md")])
BLOCK = re.compile(r"^( *)```(\w*)(?: title=\"([^\"]+)\")?\n(.*?)^\1```$", re.MULTILINE | re.DOTALL)
COMMAND = re.compile(r"((?:[^\n]*\\\n)*[^\n]*\n)(.*)", re.DOTALL)  # a command over several lines, and what follows
FOR_THE_SHELL = {"|", ">", ">>", "2>", "<"}
SHIPPED = {path.stem for path in ROOT.glob("*/*/books/*.toml")} | {
    path.stem for path in ROOT.glob("mechsim/scenes/*.toml")
}
SAME = doctest.OutputChecker()


class Block(NamedTuple):
    """A fenced block; title and language are "" where there are none."""

    language: str
    title: str
    text: str


class Typed(NamedTuple):
    """A command of a console block, and what the page shows below it."""

    command: str
    shown: str


def blocks(page: Path) -> list[Block]:
    """All fenced blocks of a page, in order."""
    found = BLOCK.findall(page.read_text(encoding="utf-8"))
    return [
        Block(language, title, re.sub(f"^{indent}", "", text, flags=re.MULTILINE))
        for indent, language, title, text in found
    ]


def write_files(page: Path, folder: Path) -> None:
    """Write the files that the page shows."""
    for block in blocks(page):
        if block.title:
            (folder / block.title).write_text(block.text, encoding="utf-8")


def typed(page: Path) -> list[Typed]:
    """The commands of the console blocks."""
    text = "".join(block.text for block in blocks(page) if block.language == "console")
    parts = re.split(r"^\$ ", text, flags=re.MULTILINE)
    return [Typed(*COMMAND.fullmatch(part).groups()) for part in parts[1:]]


def lines(page: Path) -> list[str]:
    """The commands of all other blocks, as one line each."""
    text = "".join(f"{block.text}\n" for block in blocks(page) if block.language != "console" and not block.title)
    text = text.replace("\\\n", " ")
    return [line.strip() for line in text.splitlines() if line.strip().startswith("wellmixed ")]


def run_page(page: Path, folder: Path) -> list[str]:
    """Type all commands of a page in a folder; what differs from what the page shows."""
    write_files(page, folder)
    wrong = []
    for command, shown in typed(page):
        program, *words = shlex.split(command, comments=True)
        assert program == "wellmixed", f"{page.name} runs {program}"
        done = run_here(*words, cwd=folder)
        said = done.out + done.err
        if done.code and not ("Error: " in shown or (done.code == INCOMPLETE and "was truncated" in shown)):
            wrong.append(f"$ {command}ended with {done.code}: {said}")
        elif shown.strip() and not SAME.check_output(shown.strip() + "\n", said.strip() + "\n", doctest.ELLIPSIS):
            wrong.append(f"$ {command}{said}instead of\n{shown}")
    return wrong


def misspelt(line: str) -> str | None:
    """What is wrong with a command line, without running it: a command, an option or a value that is none."""
    words = list(takewhile(lambda word: word not in FOR_THE_SHELL, shlex.split(line, comments=True)))[1:]
    leaves = {name: command for name, command in commands() if not isinstance(command, click.Group)}
    for n in (3, 2, 1):
        name = " ".join(words[:n])
        if name in leaves:
            break
    else:
        return None if {"--help", "--version"} & set(words) else f"no command {words[:3]}"
    command, context = leaves[name], click.Context(leaves[name], info_name=name)
    try:
        for problem in _problems(command, context, words[n:]):
            return problem
    except click.UsageError as error:
        return error.format_message()
    return None


def _problems(command: click.Command, context: click.Context, words: list[str]) -> Iterator[str]:
    """Of a command's words: values that its options do not take, options that it lacks."""
    for option in command.params:  # numbers in a row, see `NumbersCommand`
        if isinstance(option, click.Option) and option.multiple:
            words = _repeated(words, option)
    values, _, _ = command.make_parser(context).parse_args(list(words))
    if {"--help", "-h"} & set(words):
        return
    source = str(next((values[each.name] for each in command.params if isinstance(each, click.Argument)), ""))
    fills = not (Path(source).suffix or source in SHIPPED)  # the folder of a study, which fills options
    for parameter in command.params:
        if parameter.name not in values or parameter.value_is_missing(values[parameter.name]):
            if parameter.required and (isinstance(parameter, click.Argument) or not fills):
                yield f"{command.name}: {parameter.human_readable_name} is missing"
        elif not isinstance(parameter.type, click.Path):  # files are the reader's own
            parameter.type_cast_value(context, values[parameter.name])


def _repeated(words: list[str], option: click.Option) -> list[str]:
    """`--times 1 2 3` as `--times 1 --times 2 --times 3`."""
    found, current = [], False
    for word in words:
        is_number = re.fullmatch(r"-?\d[\d.eE+-]*", word)
        if current and is_number and found[-1] not in option.opts:
            found.append(option.opts[0])
        current = word in option.opts or (current and bool(is_number))
        found.append(word)
    return found
