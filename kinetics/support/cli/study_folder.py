"""The folder of a study as an argument: it stands for the files that it holds, and the command's options with them.

    target.toml, book.toml, scene.toml, plan.toml    what is to be built and how it is studied
    rates.toml, calibration.html, validation.html    what came of it
    runs/                                            the mechanics runs

`wellmixed new` makes such folders.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path
from typing import Any

import click
from click.core import ParameterSource

from kinetics.support.config import read_toml

TARGET, BOOK, SCENE, PLAN, RATES, RUNS = "target.toml", "book.toml", "scene.toml", "plan.toml", "rates.toml", "runs"
FILLED = "wellmixed.filled"  # where a context keeps which options the folder has filled
Filler = str | Callable[[Path], Any]


def or_study_folder(file: str, fills: Mapping[str, Filler]) -> dict[str, Any]:
    """Settings of a click argument that takes a file of its kind, or the folder of a study that holds one.

    file : which of the folder's files the folder then stands for
    fills : options that the folder fills if they are not given: parameter -> its file there, or a function of the
        folder

    BadParameter: a folder that does not hold the file.
    """

    def found(ctx: click.Context, param: click.Parameter, value: str) -> str:
        folder = Path(value)
        if not folder.is_dir():
            return value
        if not (folder / file).is_file():
            raise click.BadParameter(
                f"the folder {value} holds no {file}; `wellmixed new` makes such folders", ctx, param
            )
        values = {name: partial(fill, folder) if callable(fill) else str(folder / fill) for name, fill in fills.items()}
        asked = ctx.default_map or {}  # by a file of options
        ctx.meta[FILLED] = values.keys() - asked.keys()
        ctx.default_map = {**values, **asked}  # what is a function is called only if it is needed
        return str(folder / file)

    return {"callback": found, "is_eager": True}  # eager: before the options, whose defaults it sets


def rates_of(folder: Path) -> str:
    """The rates of a study; BadParameter: it has none yet."""
    if not (folder / RATES).is_file():
        raise click.BadParameter(f"{folder} holds no {RATES} yet; `wellmixed calibrate {folder}` makes them")
    return str(folder / RATES)


def is_filled(name: str) -> bool:
    """Whether the folder of a study gave this option to the command, rather than the user."""
    ctx = click.get_current_context()
    return name in ctx.meta.get(FILLED, ()) and ctx.get_parameter_source(name) is ParameterSource.DEFAULT_MAP


def start_of(folder: Path) -> str:
    """What the tank holds at the start of the first held-out runs that a study has planned: `monomer=40`."""
    composition = read_toml(folder / PLAN)["held_out"]["tanks"][0]["composition"]
    return ",".join(f"{name}={n}" for name, n in composition.items())
