"""What the shell offers where a command takes a shipped book, scene or table: their names, then files."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import click
from click.shell_completion import CompletionItem

ROOT = Path(__file__).parents[3]
# what a command takes -> the folder of those that are shipped
SHIPPED = {
    "book": "kinetics/assembly/books",
    "target": "kinetics/assembly/targets",
    "rates": "kinetics/rates/tables",
    "scene": "mechsim/scenes",
    "study": "mechsim/studies/shipped",
}


def shipped(*kinds: str) -> Callable[[click.Context, click.Parameter, str], list[CompletionItem]]:
    """Completion of an argument or option by the names of these kinds, and by the files of the user.

    >>> [item.value for item in shipped("book")(None, None, "t5_")]
    ['t5_all', 't5_as_printed', 't5_bar', 't5_']
    """

    def offered(_ctx: click.Context, _param: click.Parameter, begun: str) -> list[CompletionItem]:
        files = (file for kind in kinds for file in (ROOT / SHIPPED[kind]).glob("*.toml"))
        names = sorted({file.stem for file in files if file.stem.startswith(begun)})
        return [*map(CompletionItem, names), CompletionItem(begun, type="file")]

    return offered
