"""Kinds of options that many commands declare: whole numbers, and those whose help shows their default."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar

import click

Decorated = TypeVar("Decorated", bound=Callable[..., Any])
POSITIVE = click.FloatRange(min=0, min_open=True)


def default_option(*names: str, default: Any, **settings: Any) -> Callable[[Decorated], Decorated]:
    """An option whose help shows its default."""
    return click.option(*names, default=default, show_default=True, **settings)


def count_option(*names: str, least: int = 1, metavar: str = "N", **settings: Any) -> Callable[[Decorated], Decorated]:
    """An option whose value is a whole number of at least `least`, and whose help shows its default, if any."""
    shown = "default" in settings
    return click.option(*names, metavar=metavar, type=click.IntRange(min=least), show_default=shown, **settings)


def files_option(*names: str, **settings: Any) -> Callable[[Decorated], Decorated]:
    """An option that names a file, and may be repeated."""
    return click.option(*names, metavar="FILE", multiple=True, **settings)
