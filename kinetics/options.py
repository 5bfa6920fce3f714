"""Options that the rooms' commands share."""

from __future__ import annotations

import json
import math
from typing import Any

import click
import numpy as np

seed_option = click.option(
    "--seed", type=click.IntRange(min=0), default=0, show_default=True, help="One seed, one result."
)
json_option = click.option("--json", "as_json", is_flag=True, help="Print one JSON object.")


class NumbersCommand(click.Command):
    """A command whose repeatable options take several numbers in one go: `--times 10 50 100`.

    Every option declared with `multiple=True` does; `--times 10 --times 50` means the same.
    """

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        """Name the option again before each further number, then parse as ever."""
        repeatable = {
            name
            for option in self.params
            if isinstance(option, click.Option) and option.multiple
            for name in option.opts
        }
        spelled: list[str] = []
        current, values = "", 0
        for position, word in enumerate(args):
            if word == "--":
                spelled += args[position:]
                break
            name = word.split("=", 1)[0]
            if name in repeatable:
                current, values = name, int("=" in word)
            elif not (current and _is_number(word)):
                current = ""
            else:
                if values:
                    spelled.append(current)
                values += 1
            spelled.append(word)
        return super().parse_args(ctx, spelled)


def echo_json(data: dict[str, Any]) -> None:
    """One JSON object on standard output; arrays become lists, and what is not finite becomes null."""
    click.echo(json.dumps(plain(data), allow_nan=False))


def plain(data: Any) -> Any:
    """`data` in the types that JSON knows."""
    if isinstance(data, dict):
        return {str(key): plain(value) for key, value in data.items()}
    if isinstance(data, np.ndarray | np.generic):
        return plain(data.tolist())
    if isinstance(data, list | tuple):
        return [plain(value) for value in data]
    if isinstance(data, float) and not math.isfinite(data):
        return None
    return data


def _is_number(word: str) -> bool:
    try:
        float(word)
    except ValueError:
        return False
    return True
