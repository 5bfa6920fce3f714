"""Methods as `--method` takes them; those that solve are imported only where one is asked for."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import click

from kinetics.predicting.methods import SAMPLING, names


class MethodName(click.Choice[str]):
    """The name of a sampling or solving method."""

    case_sensitive = True

    def __init__(self) -> None:
        """All of them."""

    @property
    def choices(self) -> Sequence[str]:  # type: ignore[override]
        """Their names, in the order of the help."""
        return names()

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> str:
        """The name itself; the error of `click.Choice` for any other."""
        return value if value in SAMPLING else super().convert(value, param, ctx)
