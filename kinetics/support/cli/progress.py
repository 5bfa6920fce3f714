"""A progress line at the terminal."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager

import click

INTERRUPTED = 130  # exit code of a command that Ctrl-C ended early


@contextmanager
def progress_line() -> Iterator[Callable[[str], None]]:
    """A function that shows its text in one line of the terminal, cleared at the end; silent where there is none."""
    if not sys.stderr.isatty():
        yield lambda _: None
        return
    try:
        yield lambda text: click.echo(f"\r\033[K{text}", err=True, nl=False)
    finally:
        click.echo("\r\033[K", err=True, nl=False)
