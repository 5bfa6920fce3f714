"""A progress line at the terminal."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import click

INTERRUPTED = 130  # exit code of a command that Ctrl-C ended early


def is_terminal(stream: Any) -> bool:
    """Whether a standard stream is there, open, and shown on a terminal; all that asks this asks it here."""
    try:
        return stream is not None and stream.isatty()
    except ValueError:  # closed
        return False


@contextmanager
def progress_line() -> Iterator[Callable[[str], None]]:
    """A function that shows its text in one line of the terminal, cleared at the end; silent where there is none."""
    if not is_terminal(sys.stderr):
        yield lambda _: None
        return
    try:
        yield lambda text: click.echo(f"\r\033[K{text}", err=True, nl=False)
    finally:
        click.echo("\r\033[K", err=True, nl=False)
